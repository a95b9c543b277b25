"""Measured drives on one uniform grid, context throughout, offsets where road-following: what the loop computes on.

Drives stand one after the other with a pad between them that is longer than any lag, so that shifting a column by a few
seconds never brings in another drive's values.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.drives.drive import STEP, CutRules, Drive
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect
from xosc_lateral.drivers.model.effects.response import respond
from xosc_lateral.extras.loop.gridding import grid_drives

# Samples of the 0.2 s grid per sample of the coarse one: effects take seconds, so they are tested at 1 Hz. [-]
COARSE = 5
PAD = 75  # Samples before and after each drive in which the context holds its outermost value: 15 s. [-]
# What is cut for tracing: a little more around lane changes than for fitting, or their last second looks like an effect
# of the lane.
TRACE_RULES = CutRules(lane_change_margin=6.0)
LOCAL_S = 20.0  # Movement slower than this counts as mean, faster as spread. [s]
# Stretches of a drive that count as independent in the errors of sizes: far beyond what whitening leaves of the memory,
# and the whole of a passing vehicle. [s]
CLUSTER_S = 60
MIN_DRIFT_S = 600.0  # A shorter drive tells nothing about drift or a trend of the variance. [s]
FORGOTTEN = 1e-30  # Share of a start that no response shows. [-]
KEPT_FITS = 16  # Of one table or fold: those that its effects are weighed by. [-]
MIN_VALID_S = 120.0  # Road-following time below which nothing can be said. [s]


@dataclass(frozen=True, eq=False, slots=True)
class Timeline:
    """All drives on the 0.2 s grid."""

    names: tuple[str, ...]  # Drives.
    drive: IntArray  # shape (n,): Index into `names`.
    time: FloatArray  # shape (n,): The drive's own clock. [s]
    offset: FloatArray  # shape (n,): 0 outside `valid`. [m]
    valid: BoolArray  # shape (n,): Road-following, not cut out.
    lane_width: FloatArray  # shape (n,): [m]
    context: Mapping[str, FloatArray]  # shape (n,): NaN: there is none.
    levels: frozenset[str]  # Columns of whole numbers.
    periods: Mapping[str, float] = field(default_factory=dict)  # Full circle of the columns that wrap around.
    # Columns measured by the camera that measured the offset, and misjudged markings: their errors are the offset's.
    of_one_camera: frozenset[str] = frozenset()
    valid_below: float | None = None  # Frequency up to which all drives that state one show driving. [Hz]
    resolution: float | None = None  # Coarsest of the offsets. [m]

    def __len__(self) -> int:
        return len(self.time)

    @property
    def step(self) -> float:
        """Of the grid. [s]"""
        return STEP

    @property
    def spans(self) -> list[slice]:
        """Rows of each drive, pads included."""
        edges = np.searchsorted(self.drive, np.arange(len(self.names) + 1))
        return [slice(int(first), int(last)) for first, last in pairwise(edges)]

    def respond(self, values: FloatArray, lag_s: float, response_s: float) -> FloatArray:
        """`effects.response.respond` drive by drive, of `values`, shape (n,) or (n, k), whatever the lag."""
        response = respond(values, self.step, lag_s, response_s)
        if response_s <= 0.0:
            return response
        # amid the pad, what is shifted is the drive's own; before, it is as it is there
        rows = np.arange(len(values))
        amid = self.drive[np.maximum(rows - PAD // 2, 0)]
        anew = start_anew(response, values, float(np.exp(-self.step / response_s)), amid)
        starts = np.searchsorted(self.drive, np.arange(len(self.names)))
        return anew[np.maximum(rows, np.minimum(starts + PAD // 2, len(rows) - 1)[self.drive])]

    def held(self, values: FloatArray, episode: float) -> FloatArray:
        """Values, shape (n, k), with the peak of the last episode of each drive held; as they are where it is 0."""
        if not episode:
            return values
        return np.concatenate([respond(values[rows], STEP, 0.0, 0.0, episode=episode) for rows in self.spans])

    def shifted(self, values: FloatArray, late_s: float) -> FloatArray:
        """Values so much later [s], shape (n, ...), in their unit; beyond a drive's ends its outermost value holds."""
        rows, edges = np.arange(len(values)), np.searchsorted(self.drive, np.arange(len(self.names) + 1))
        return values[np.clip(rows - round(late_s / STEP), edges[self.drive], edges[self.drive + 1] - 1)]


def missing_throughout(values: FloatArray, timeline: Timeline) -> BoolArray:
    """Rows of drives of ten minutes and more without a single value: what was not measured says which drive it is."""
    there, gone = np.isfinite(values) & timeline.valid, np.zeros(len(values), dtype=np.bool_)
    for span in timeline.spans:
        gone[span] = timeline.valid[span].sum() * timeline.step >= MIN_DRIFT_S and not there[span].any()
    return gone if there.any() else np.zeros(len(values), dtype=np.bool_)


def unsized(effect: ColumnEffect) -> ColumnEffect:
    """The same effect before it was fitted."""
    fitted = dict.fromkeys(("coefficients", "errors", "reference", "between_drivers", "response_range", "driven"), ())
    return structs.replace(effect, **fitted)


def join_drives(drives: Sequence[Drive], rules: CutRules = TRACE_RULES) -> Timeline:
    """Put drives on one grid; refuses less than two minutes of road-following (`NotEnoughDataError`)."""
    kept, periods = grid_drives(drives, rules, pad=PAD, multiple=COARSE)
    valid_s = STEP * sum(float(part.valid.sum()) for part in kept)
    if valid_s < MIN_VALID_S:
        raise NotEnoughDataError(
            f"{valid_s:.0f} s of road-following in {len(drives)} drives; closing the loop needs {MIN_VALID_S:.0f} s"
        )
    names = sorted({name for part in kept for name in part.context})
    return Timeline(
        names=tuple(part.name for part in kept),
        drive=np.repeat(np.arange(len(kept)), [len(part) for part in kept]),
        time=np.concatenate([part.time for part in kept]),
        offset=np.concatenate([part.offset for part in kept]),
        valid=np.concatenate([part.valid for part in kept]),
        lane_width=np.concatenate([part.lane_width for part in kept]),
        # a drive that never met one has no such column: there is none, all along
        context={
            name: np.concatenate([part.context.get(name, np.full(len(part), np.nan)) for part in kept])
            for name in names
        },
        levels=frozenset.intersection(*(part.levels for part in kept)),
        periods=periods,
        of_one_camera=frozenset({"lane_width"} if any(drive.mended for drive in drives) else ()),
        valid_below=min((drive.valid_below for drive in drives if drive.valid_below is not None), default=None),
        resolution=max((drive.resolution for drive in drives if drive.resolution is not None), default=None),
    )


def coarse_mean(values: FloatArray) -> FloatArray:
    """Mean over each second, shape (n // 5, ...), in the unit of the values."""
    n = len(values) // COARSE
    return np.asarray(values[: n * COARSE].reshape(n, COARSE, *values.shape[1:]).mean(axis=1))


def coarse_middle(values: NDArray[Any]) -> NDArray[Any]:
    """Value in the middle of each second, shape (n // 5,), in its own unit: for what can't be averaged."""
    return values[COARSE // 2 :: COARSE][: len(values) // COARSE]


def coarse_all(mask: BoolArray) -> BoolArray:
    """Whether the whole second is valid, shape (n // 5,)."""
    n = len(mask) // COARSE
    return np.asarray(mask[: n * COARSE].reshape(n, COARSE).all(axis=1))


def start_anew(
    response: FloatArray, values: NDArray[np.floating[Any]], keep: float, drive: NDArray[np.intp]
) -> FloatArray:
    """A first-order lag over drives in a row, settled anew where each starts: what is constant in drives stays so."""
    starts = np.flatnonzero(np.diff(drive, prepend=-1))  # drives are in order
    lasting = round(np.log(FORGOTTEN) / np.log(max(keep, FORGOTTEN))) + 1
    lengths = np.minimum(np.diff(starts, append=len(drive)), lasting)
    number = np.repeat(np.arange(len(starts)), lengths)
    since = np.arange(len(number)) - (np.cumsum(lengths) - lengths)[number]
    left = (keep ** np.arange(lasting).astype(values.dtype))[since]
    off, anew = (response[starts] - values[starts])[number], response.copy()
    anew[starts[number] + since] -= off * (left[:, None] if values.ndim == 2 else left)
    return anew


def on_fine_grid(values: FloatArray, timeline: Timeline) -> FloatArray:
    """From the middles of the seconds, shape (n // 5, ...), to the 0.2 s grid: steps of a second would be noise."""
    n = len(timeline)
    at = np.clip((np.arange(n) - 0.5 * (COARSE - 1)) / COARSE, 0.0, len(values) - 1.0)
    low = np.minimum(at.astype(np.intp), max(0, len(values) - 2))
    share = (at - low).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(values[low] * (1.0 - share) + values[np.minimum(low + 1, len(values) - 1)] * share)


def local_mean(values: FloatArray, valid: BoolArray, seconds: float) -> FloatArray:
    """Moving average on the 0.2 s grid over the valid rows within `seconds`, shape (n,); 0 where there are none."""
    half = max(1, round(0.5 * seconds / STEP))
    sums = np.concatenate([[0.0], np.cumsum(np.where(valid, values, 0.0))])
    counts = np.concatenate([[0.0], np.cumsum(valid.astype(np.float64))])
    index = np.arange(len(values))
    low, high = np.maximum(index - half, 0), np.minimum(index + half + 1, len(values))
    return np.asarray((sums[high] - sums[low]) / np.maximum(counts[high] - counts[low], 1.0))


@dataclass(frozen=True, eq=False)
class Coarse:
    """The timeline at 1 Hz, and every column effect's response on it."""

    timeline: Timeline
    offset: FloatArray  # shape (n,): Mean of each second. [m]
    valid: BoolArray  # shape (n,)
    drive: IntArray  # shape (n,)
    time: FloatArray  # shape (n,): [s]
    # Columns on the fine grid, lane width included, clipped to what occurs while road-following: a traffic jam that is
    # cut out must not stretch a column's range.
    context: Mapping[str, FloatArray]
    _responses: dict[ColumnEffect, FloatArray] = field(default_factory=dict, repr=False)
    _fits: dict[tuple[object, ...], Any] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, timeline: Timeline) -> Coarse:
        """Average to 1 Hz."""
        columns = {"lane_width": timeline.lane_width, **timeline.context}
        for name, values in columns.items():
            if len(seen := values[timeline.valid & np.isfinite(values)]):
                columns[name] = np.where(np.isinf(values), values, np.clip(values, seen.min(), seen.max()))
        return cls(
            timeline,
            coarse_mean(timeline.offset),
            coarse_all(timeline.valid),
            coarse_middle(timeline.drive),
            coarse_mean(timeline.time),
            columns,
        )

    def __len__(self) -> int:
        return len(self.offset)

    def only(self, rows: BoolArray) -> Coarse:
        """The same with fewer valid rows; `rows`: shape (n,)."""
        return replace(self, valid=self.valid & rows, _responses={}, _fits={})

    def once(self, terms: tuple[object, ...], fit: Callable[[], Any]) -> Any:
        """A fit of these very terms to these rows, made once; the last few are kept."""
        if terms not in self._fits:
            self._fits[terms] = fit()
            for old in list(self._fits)[:-KEPT_FITS]:
                del self._fits[old]
        return self._fits[terms]

    @cached_property
    def drives(self) -> int:
        """Number of drives."""
        return int(self.drive.max()) + 1

    @cached_property
    def cluster(self) -> IntArray:
        """Clusters: minutes within drives, numbered, shape (n,); they count as independent of each other."""
        _, first = np.unique(self.drive, return_index=True)
        minute = (np.arange(len(self)) - first[self.drive]) // CLUSTER_S
        _, cluster = np.unique(self.drive * len(self) + minute, return_inverse=True)
        return cluster.astype(np.intp)

    @cached_property
    def lasts(self) -> bool:
        """Whether a drive is long enough to change with time: minutes, not the minute of a passing vehicle."""
        return bool(np.bincount(self.drive, self.valid.astype(float)).max() >= MIN_DRIFT_S)

    def response(self, effect: ColumnEffect, *, keep: bool = False) -> FloatArray:
        """The effect's quantity [own unit] as the driver responds to it, less its mean where valid; shape (n, k)."""
        key = structs.replace(unsized(effect), acts=Acts.LOCATION)
        if key in self._responses:
            return self._responses[key]
        response = coarse_mean(self.fine_response(key))
        response = response - response[self.valid].mean(axis=0)
        if keep:
            self._responses[key] = response
        return np.asarray(response, dtype=np.float64)

    def fine_response(self, effect: ColumnEffect) -> FloatArray:
        """The same on the 0.2 s grid, as it is, shape (fine n, k). [own unit]"""
        timeline, course = self.timeline, effect.course
        quantity = timeline.held(effect.known(self.context), effect.episode)
        response = timeline.respond(quantity, effect.lag_s, effect.response_s)
        return response if not course else np.sum([w * timeline.shifted(response, late) for late, w in course], axis=0)

    def strength(self, effect: ColumnEffect) -> FloatArray:
        """What an effect of columns that the table has does on the 0.2 s grid, shape (fine n,). [m], or log factor"""
        return effect.weighed(self.fine_response(effect))

    def by_drive(self, values: FloatArray) -> FloatArray:
        """Mean over the valid rows of each drive, shape (drives,), in the values' unit; 0 where there are none."""
        count = np.bincount(self.drive, self.valid.astype(float), minlength=self.drives)
        sums = np.bincount(self.drive, np.where(self.valid, values, 0.0), minlength=self.drives)
        return np.asarray(sums / np.maximum(count, 1.0))
