"""Fit of a maneuver law to measured lane changes.

Lane changes of one vehicle are hardly more alike than those of two (correlation of log durations 0.02 on one motorway):
intervals take each as one observation.

References
----------
.. [1] E. B. Wilson, "Probable inference, the law of succession, and statistical inference", Journal of the American
   Statistical Association 22, 1927: interval of a share.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from xosc_lateral.base.arrays import NORMAL_95, BoolArray, FloatArray, all_significant, significant
from xosc_lateral.base.errors import DriverProfileError, NotEnoughDataError
from xosc_lateral.drivers.model.profile import Figure, Maneuvers, Spread

DIGITS = 4
"""Significant digits of a figure: its error is far above. [-]"""

LEAST_CHANGES = 20
"""Lane changes that a law takes: the error of their median duration is then 8 %. [-]"""

SIDES = ("left", "right")


class MeasuredChanges(NamedTuple):
    """Lane changes from begin to end, shape (n,) each."""

    duration: FloatArray  # [s]
    gap: FloatArray  # to the vehicle ahead in its own lane at the begin, between bumpers; NaN: none within sight [m]
    speed_change: FloatArray  # from begin to end [m/s]
    end: FloatArray  # offset there from the middle of the new lane, positive left [m]
    left: BoolArray  # to which side


def fit_maneuvers(
    changes: MeasuredChanges, *, before: Mapping[str, FloatArray], hours: float, aborted: float, recording: str
) -> Maneuvers:
    """Law of measured lane changes; raises `NotEnoughDataError`.

    Where all of them have somebody ahead, or none has, both durations are those of all.

    - `before`: side -> ways before, shape (k, m) [m]
    - `hours`: of lane keeping beside them [h]; `aborted`: lane changes beside them that were given up
    """
    n = len(changes.duration)
    if n < LEAST_CHANGES:
        raise NotEnoughDataError(
            f"{recording}: {n} lane changes from begin to end; a maneuver law takes {LEAST_CHANGES}"
        )
    log, is_behind = np.log(changes.duration), np.isfinite(changes.gap)
    alone, behind = (rows if rows.any() else ~rows for rows in (~is_behind, is_behind))
    gaps = np.log(np.maximum(changes.gap[is_behind], 1.0)) if is_behind.any() else np.zeros(n)
    away = gaps - gaps.mean()
    power = float(away @ log[behind] / max(float(away @ away), 1e-9))
    alone_spread, behind_spread = _spread(log[alone]), _spread(log[behind] - power * away)
    error = behind_spread.deviation.value / max(float(np.sqrt(away @ away)), 1e-9)
    rate = n / hours
    sides = {side: changes.left == (side == "left") for side in SIDES}
    return Maneuvers(
        changes=n,
        hours=significant(hours, DIGITS),
        duration_alone=_of(np.exp, alone_spread.mean),
        spread_alone=alone_spread.deviation,
        duration_behind=_of(np.exp, behind_spread.mean),
        gap=_rounded(np.exp([gaps.mean(), *np.quantile(gaps, (0.05, 0.95))]).tolist()),
        gap_exponent=_figure(power, error),
        spread_behind=behind_spread.deviation,
        behind=_share(float(is_behind.sum()), n),
        left=_share(float(changes.left.sum()), n),
        rate=_figure(rate, np.sqrt(n) / hours),
        given_up=_share(aborted, n + aborted),
        end={side: _spread(changes.end[rows]) for side, rows in sides.items() if np.isfinite(changes.end[rows]).any()},
        speed_change={side: _spread(changes.speed_change[rows]) for side, rows in sides.items() if rows.any()},
        before={side: all_significant(rows.mean(axis=0), DIGITS) for side, rows in before.items() if len(rows)},
        recording=recording,
    )  # fmt: skip


def law_of_rows(values: Mapping[str, Any]) -> Maneuvers:
    """The law of what profiles held before: rows of a smoothed sample; raises `DriverProfileError`.

    Intervals are those of as many lane changes as were measured.
    """
    try:
        sample = {name: np.array(rows, dtype=np.float64) for name, rows in values["sample"].items()}
        left, measured = np.array(values["left"], dtype=np.bool_), int(values["changes"])
        times = int(np.ceil(measured / len(left)))  # the sample, as often as makes so many
        rows = np.tile(np.arange(len(left)), times)[: max(measured, LEAST_CHANGES)]
        duration, gap, speed_change = (sample[name][rows] for name in ("duration", "gap", "speed_change"))
        changes = MeasuredChanges(duration, gap, speed_change, np.full(len(rows), np.nan), left[rows])
        before = {side: np.array([way], dtype=np.float64) for side, way in values["before"].items()}
        hours, aborted = float(values["hours"]), float(values["aborted"])
        return fit_maneuvers(
            changes, before=before, hours=hours, aborted=aborted, recording=values.get("recording", "")
        )
    except (KeyError, TypeError, ValueError, AttributeError, ZeroDivisionError, IndexError) as error:
        raise DriverProfileError(f"maneuvers: no smoothed sample of lane changes ({error})") from error


def _spread(values: FloatArray) -> Spread:
    """Mean and standard deviation, with the errors that they have of normal values."""
    known = values[np.isfinite(values)]
    n, deviation = max(len(known), 1), float(known.std(ddof=1)) if len(known) > 1 else 0.0
    return Spread(
        _figure(float(known.mean()), deviation / np.sqrt(n)), _figure(deviation, deviation / np.sqrt(2.0 * n))
    )


def _figure(value: float, error: float) -> Figure:
    """A figure with a standard error."""
    return _rounded((value, value - NORMAL_95 * error, value + NORMAL_95 * error))


def _of(function: Callable[[FloatArray], FloatArray], figure: Figure) -> Figure:
    """Of a figure and its interval."""
    return _rounded(function(np.array(figure)).tolist())


def _share(count: float, n: float) -> Figure:
    """Of n, with Wilson's interval [1]_."""
    p, z = count / n, NORMAL_95**2 / n
    middle, half = (p + 0.5 * z) / (1.0 + z), np.sqrt(z * (p * (1.0 - p) + 0.25 * z)) / (1.0 + z)
    return _rounded((p, max(middle - half, 0.0), min(middle + half, 1.0)))


def _rounded(values: Sequence[float]) -> Figure:
    return Figure(*all_significant(values, DIGITS))
