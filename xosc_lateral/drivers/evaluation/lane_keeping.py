"""What traffic psychology, lane keeping assistance and UN R157 read in a stretch of driving, window by window."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from xosc_lateral.base.arrays import NORMAL_95, FloatArray, rate, true_slices
from xosc_lateral.drivers.drives.drive import HALF_WIDTH
from xosc_lateral.drivers.evaluation.metrics import free_runs
from xosc_lateral.drivers.model.profile import DriverProfile

NEAR_MARKING = 1.2  # A reference point this close to a marking counts as near: half a car (0.9 m) and 0.3 m of air. [m]


@dataclass(frozen=True)
class Margins:
    """How a driver uses the lane's margins."""

    share_near: float  # Share of time with the reference point within `NEAR_MARKING` of a marking. [-]
    excursions_per_hour: float  # How often that zone is entered. [1/h]
    largest: float  # Largest |offset|. [m]


def margins(offsets: Sequence[FloatArray], lane_widths: Sequence[FloatArray], step: float) -> Margins:
    """Time near a marking and rate of excursions over runs, shape (n_i,) each [m], at an even step [s]."""
    near = [np.abs(x) > 0.5 * w - NEAR_MARKING for x, w in zip(offsets, lane_widths, strict=True)]
    rows = sum(len(one) for one in near)
    entries = sum(int((one[1:] & ~one[:-1]).sum()) for one in near)
    return Margins(
        share_near=sum(int(one.sum()) for one in near) / rows,
        excursions_per_hour=entries / (rows * step / 3600.0),
        largest=max(float(np.abs(x).max()) for x in offsets),
    )


LONGEST_TLC = 20.0  # Times to line crossing beyond it count as it: far above the 2 s that warning systems look at. [s]


def time_to_line_crossing(
    offset: FloatArray, lane_width: FloatArray, step: float, *, half_width: float = HALF_WIDTH
) -> FloatArray:
    """Time until the side that the vehicle moves towards reaches its marking, at constant lateral speed.

    0 where the side is beyond the marking already, at most `LONGEST_TLC`, shape (..., m - 1); from `offset` and
    `lane_width`, shape (..., m).
    """
    speed = rate(offset, step, past=True)[..., 1:]
    towards = np.sign(speed) * offset[..., 1:]
    room = np.maximum(0.5 * lane_width[..., 1:] - half_width - towards, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        time = np.where(speed == 0.0, np.inf, room / np.abs(speed))
    return np.minimum(time, LONGEST_TLC)


# Columns of `lane_keeping_indicators`.
INDICATORS = (
    *("sdlp", "tlc_min", "tlc_median", "beyond_wandering_zone", "near_marking"),
    *("lateral_acceleration", "lateral_jerk"),
)

UNITS = ("m", "s", "s", "-", "-", "m/s2", "m/s3")
# UN R157, guidance on performance models: a neighbour this far from its lane's centre is no longer wandering. [m]
WANDERING_ZONE = 0.375


def lane_keeping_indicators(offset: FloatArray, lane_width: FloatArray, step: float) -> FloatArray:
    """Indicators of each window, shape (n, 7), from `offset` and `lane_width`, shape (n, m >= 4) [m].

    Columns as in `INDICATORS`, units as in `UNITS`: standard deviation of lateral position [1]_; smallest and median
    time to line crossing [2]_; shares of time beyond the wandering zone of UN R157 [3]_ and near a marking; root mean
    square of lateral acceleration and jerk, from differences of the offset.

    References
    ----------
    .. [1] J. F. O'Hanlon et al., "Diazepam impairs lateral position control in highway driving", Science 217, 1982.
    .. [2] W. van Winsum, K. A. Brookhuis, D. de Waard, "A comparison of different ways to approximate time-to-line
       crossing (TLC) during car driving", Accident Analysis & Prevention 32, 2000: here distance over lateral speed.
    .. [3] UN Regulation No. 157, guidance on performance models, cut-in scenario.
    """
    crossing = time_to_line_crossing(offset, lane_width, step)
    acceleration = np.diff(offset, 2, axis=1) / step**2
    jerk = np.diff(offset, 3, axis=1) / step**3
    near = np.abs(offset) > 0.5 * lane_width - NEAR_MARKING
    return np.column_stack(
        [
            offset.std(axis=1),
            crossing.min(axis=1),
            np.median(crossing, axis=1),
            (np.abs(offset) > WANDERING_ZONE).mean(axis=1),
            near.mean(axis=1),
            np.sqrt((acceleration**2).mean(axis=1)),
            np.sqrt((jerk**2).mean(axis=1)),
        ]
    )


# ---- the highway driving test ----------------------------------------------------------------------------------------
# The test's speed [m/s] and the length of its drive [s]: 100 km at 95 km/h [4]_.
HIGHWAY_SPEED, HIGHWAY_DRIVE = 95.0 / 3.6, 3600.0
HIGHWAY_DRIVES = 60  # Sampled drives: the standard error of an SDLP is below 0.5 % then.
WITHIN_DRIVER = 300.0  # Windows of which the deviation within one driver is taken besides. [s]
NEAR_LINE = 0.2  # A side of the vehicle so near to a marking is near the line. [m]
DRIFT_DISTANCE, DRIFT_LASTS = 1.0, 8.0  # A lane drift is so far from the drive's mean [m] for so long [s] [5]_.


@dataclass(frozen=True, slots=True)
class LaneKeeping:
    """How a driver keeps the lane in drives of an hour.

    References
    ----------
    .. [4] J. C. Verster, T. Roth, "Standard operation procedures for conducting the on-the-road driving test",
       International J. of General Medicine 4, 2011, doi:10.2147/IJGM.S19639.
    .. [5] "Validating lane drifts as a predictive measure of drug or sleepiness induced driving impairment",
       Psychopharmacology, 2020: deviations of more than 100 cm from the mean for 8 s.
    """

    sdlp: float  # Standard deviation of lateral position within a drive, its mean over drives quadratic [4]_. [m]
    mean: float  # Mean offset, positive left. [m]
    restlessness: float  # Root mean square of lateral speed. [m/s]
    memory: float  # After which the autocorrelation within a drive is 1/e. [s]
    near_line: float  # Share of time with a side within `NEAR_LINE` of a marking or beyond. [-]
    drifts: float  # Lane drifts. [1/h]
    line_crossing: float  # Time to line crossing that is undercut in 5 % of the time. [s]
    errors: Mapping[str, float] = field(default_factory=dict)  # Standard errors by field; empty: not known.
    limit_near_line: float = 0.0  # |offset| from which on a side is near the line. [m]

    def line(self, name: str, unit: str = "", digits: int = 2) -> str:
        """A figure with its 95 % interval, where that is known."""
        interval = f" +- {NORMAL_95 * self.errors[name]:.{digits}f}" if name in self.errors else ""
        return f"{getattr(self, name):.{digits}f}{interval}{unit and ' '}{unit}"

    @property
    def words(self) -> str:
        """Figures that traffic psychology asks for, in a line."""
        return (
            f"SDLP {self.line('sdlp', 'm')}, lane drifts {self.line('drifts', 'an hour', 1)}, "
            f"5 % of times to line crossing below {self.line('line_crossing', 's', 1)}, "
            f"near a line {self.line('near_line', digits=3)} of the time"
        )


@dataclass(frozen=True)
class MovementSummary:
    """What a profile does in even traffic, in figures that a person can picture."""

    mean_offset: float  # Positive: left of the lane centre. [m]
    spread: float  # Standard deviation over all drivers and times. [m]
    spread_within: float  # Mean standard deviation of one driver over 5 min. [m]
    low: float  # 5 % and 95 % quantile. [m]
    high: float  # 5 % and 95 % quantile. [m]
    lateral_speed: float  # Root mean square. [m/s]


def summarise(drives: FloatArray, step: float) -> MovementSummary:
    """Sum up drives, shape (drivers, n) [m], with rows `step` seconds apart."""
    low, high = np.quantile(drives, [0.05, 0.95])
    rows = min(round(WITHIN_DRIVER / step), drives.shape[1])
    windows = drives[:, : drives.shape[1] // rows * rows].reshape(-1, rows)
    return MovementSummary(
        mean_offset=float(drives.mean()),
        spread=float(drives.std()),
        spread_within=float(windows.std(axis=1).mean()),
        low=float(low),
        high=float(high),
        lateral_speed=float(np.sqrt((rate(drives, step, past=True)[:, 1:] ** 2).mean())),
    )


def figures_of(
    profile: DriverProfile, seed: int = 0, drives: FloatArray | None = None
) -> tuple[MovementSummary, LaneKeeping]:
    """The figures by which a profile is known everywhere, of one set of sampled drives in even traffic."""
    drives, step = highway_drives(profile, seed) if drives is None else drives, profile.model.step
    known = profile.provenance
    recorded = None
    if known.hours > 0.0 and known.drives and "derived_from" not in known.fit:
        recorded = (3600.0 * known.hours, known.drives)
    return summarise(drives, step), lane_keeping(drives, profile.lane_width, step, recorded=recorded)


def highway_drives(
    profile: DriverProfile, seed: int, *, speed: float = HIGHWAY_SPEED, drives: int = HIGHWAY_DRIVES
) -> FloatArray:
    """Offsets of drives of an hour in even traffic, each a driver of his own, shape (drives, n); `speed` in [m/s]."""
    return free_runs(profile, seed, drivers=drives, duration=HIGHWAY_DRIVE, speed=speed)


def lane_keeping(
    drives: FloatArray,
    lane_width: float,
    step: float,
    *,
    half_width: float | None = None,
    recorded: tuple[float, int] | None = None,
) -> LaneKeeping:
    """Measure drives, shape (drives, n) [m], in a lane of a width [m], with rows `step` seconds apart.

    The errors say how far the figures of as much recorded driving (seconds, drives) would differ if it were driven
    again: as far as stretches of that length differ from drive to drive. Without `recorded` there are none.
    """
    half_width = HALF_WIDTH if half_width is None else half_width
    within = drives - drives.mean(axis=1, keepdims=True)
    limit = 0.5 * lane_width - half_width - NEAR_LINE
    crossing = time_to_line_crossing(drives, np.broadcast_to(lane_width, drives.shape), step, half_width=half_width)

    def by_drive(rows: int) -> dict[str, FloatArray]:
        return {
            "mean": drives[:, :rows].mean(axis=1),
            "near_line": (np.abs(drives[:, :rows]) > limit).mean(axis=1),
            "drifts": np.array([_drifts(deviation[:rows], step) for deviation in within]) / (rows * step / 3600.0),
            "line_crossing": np.quantile(crossing[:, :rows], 0.05, axis=1),
            "sdlp": (within[:, :rows] ** 2).mean(axis=1),  # squares, until they are averaged
            "restlessness": (np.diff(drives[:, :rows], axis=1) ** 2).mean(axis=1) / step**2,
        }

    whole = by_drive(drives.shape[1])
    figures = {name: float(values.mean()) for name, values in whole.items()}
    for name in ("sdlp", "restlessness"):
        figures[name] = float(np.sqrt(figures[name]))
    errors = {}
    if recorded is not None and len(drives) > 1:
        seconds, count = recorded
        rows = min(max(round(seconds / count / step), 2), drives.shape[1])
        parts = whole if rows == drives.shape[1] else by_drive(rows)
        stretches = max(seconds / (rows * step), 1.0)
        errors = {name: float(values.std(ddof=1)) / stretches**0.5 for name, values in parts.items()}
        for name in ("sdlp", "restlessness"):
            errors[name] /= 2.0 * figures[name] or 1.0
    return LaneKeeping(**figures, memory=_memory(within, step), errors=errors, limit_near_line=limit)


def _drifts(deviation: FloatArray, step: float) -> int:
    """How often one is `DRIFT_DISTANCE` or more from the mean, on one side, for `DRIFT_LASTS` or longer."""
    sides = (deviation > DRIFT_DISTANCE, deviation < -DRIFT_DISTANCE)
    return sum((part.stop - part.start) * step >= DRIFT_LASTS for far in sides for part in true_slices(far))


def _memory(within: FloatArray, step: float) -> float:
    """Lag at which the mean autocovariance falls to 1/e of the variance, linear between rows. [s]"""
    n = within.shape[1]
    spectrum = np.abs(np.fft.rfft(within, 2 * n, axis=1)) ** 2
    covariance = np.fft.irfft(spectrum.mean(axis=0))[:n] / np.arange(n, 0, -1)
    if not covariance[0] > 0.0:
        return 0.0
    share = covariance / covariance[0]
    below = int(np.argmax(share < np.exp(-1.0)))
    high, low = share[below - 1], share[below]
    return float(step * (below - 1 + (high - np.exp(-1.0)) / (high - low))) if below else n * step
