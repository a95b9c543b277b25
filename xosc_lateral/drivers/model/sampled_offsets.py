"""Snippets of measured runs, and sampled offsets beside them, under their context, or free.

References
----------
.. [1] N. Neis, J. Beyerer, arXiv:2405.17080, 2024: offsets are compared in snippets of equal length.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import DriverProfileError, NotEnoughDataError
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.drives.drive import STEP, CutRules, Drive, Run, all_runs, cut_runs, whole_run
from xosc_lateral.drivers.model.plausibility import check_offsets
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import sample_offsets
from xosc_lateral.drivers.model.seeds import DriveSeed, child, generator
from xosc_lateral.drivers.model.sensor import SensorModel

MEAN_SPEED = 30.0
"""Of a free run whose speed nobody named: about 108 km/h. [m/s]"""

WHERE_LANES_CHANGE = CutRules(min_speed=0.0, min_run=0.0)
"""Free runs under a drive's context go on through slow driving, however short they are."""

MAX_DURATION = 1e7
"""Of a free run [s]: 2 GB of offsets, anything longer is a slip."""


@dataclass(frozen=True, eq=False, slots=True)
class SampledOffsets:
    """Sampled offsets of one snippet or drive."""

    drive: str
    snippet: int
    time: FloatArray
    offset: FloatArray
    offset_real: FloatArray | None
    lane_width: FloatArray
    speed: FloatArray  # NaN where it is not known. [m/s]


def sample_like(
    profile: DriverProfile,
    drives: Sequence[Drive],
    seconds: float,
    seed: int,
    *,
    with_sensor: bool = False,
) -> Iterator[SampledOffsets]:
    """For each snippet of the measured drives a sampled one of the same length, start, lane width and context."""
    sensor = known_sensor(profile) if with_sensor else None
    numbers = {drive.name: number for number, drive in enumerate(drives)}
    root = np.random.SeedSequence(seed)
    for snippet in cut_snippets(all_runs(drives), seconds):
        name, seed_of_snippet = snippet.run.drive, child(root, numbers[snippet.run.drive], snippet.index)
        segment = segment_of(snippet.run, snippet.rows)
        offset = recorded_offsets(profile, segment, seed_of_snippet, sensor, float(snippet.offset[0]))
        _check(offset, segment, profile, name)
        yield SampledOffsets(name, snippet.index, snippet.time, offset, snippet.offset, *_driven(segment))


def sample_context(
    profile: DriverProfile, drives: Sequence[Drive], seed: int, *, with_sensor: bool = False
) -> Iterator[SampledOffsets]:
    """One free run per measured drive, under its context from its first row to its last.

    It is cut where the drive is, at lane changes and gaps: there the context jumps, and the offset with it.
    """
    sensor = known_sensor(profile) if with_sensor else None
    root = np.random.SeedSequence(seed)
    for number, drive in enumerate(drives):
        segment = segment_of(whole_run(drive))
        offset = recorded_offsets(profile, segment, child(root, number), sensor)
        _check(offset, segment, profile, drive.name)
        width, speed = _driven(segment)
        for run in cut_runs(drive, WHERE_LANES_CHANGE):
            first = round(float(run.time[0] - segment.time[0]) / profile.model.step)
            rows = slice(first, first + len(run))
            yield SampledOffsets(drive.name, run.index, run.time, offset[rows], None, width[rows], speed[rows])


def _driven(segment: Segment) -> tuple[FloatArray, FloatArray]:
    """Lane width [m] and speed [m/s] inside a segment."""
    return segment.lane_width[segment.inside], segment.speed[segment.inside]


def _check(offset: FloatArray, segment: Segment, profile: DriverProfile, drive: str) -> None:
    inside = segment.inside
    subject = f"profile {profile.name} under the context of drive {drive}"
    check_offsets(offset, segment.lane_width[inside], subject, segment.time[inside])


def sample_free(
    profile: DriverProfile,
    duration: float,
    seed: int,
    *,
    speed: float = MEAN_SPEED,
    lane_width: float | None = None,
    with_sensor: bool = False,
) -> Iterator[SampledOffsets]:
    """One free run in even traffic: constant speed [m/s] for a duration [s], no other context.

    In a lane of `lane_width`, or of the profile's own. [m]
    """
    if not 0 < duration < MAX_DURATION:
        raise ValueError(f"a free run of {duration} s, expected more than 0 and less than {MAX_DURATION:g} s")
    width = profile.lane_width if lane_width is None else lane_width
    segment = Segment.even(duration, profile.model.step, width, speed)
    sensor = known_sensor(profile) if with_sensor else None
    offset = recorded_offsets(profile, segment, child(np.random.SeedSequence(seed), 0), sensor)
    yield SampledOffsets(profile.name, 0, segment.time, offset, None, *_driven(segment))


def known_sensor(profile: DriverProfile) -> SensorModel:
    """What the profile's drives were measured by.

    Raises `DriverProfileError` when the profile doesn't know.
    """
    if profile.sensor is None:
        raise DriverProfileError(f"profile {profile.name} holds no sensor: fit it anew, or sample the driver alone")
    return profile.sensor


def sensor_error(
    sensor: SensorModel | None,
    path: FloatArray,
    step: float,
    seed: np.random.SeedSequence,
    part: int = 0,
) -> FloatArray:
    """Error on a drive's sampled path, shape (n,), from random numbers of its own; zeros without a sensor. [m]

    `part` numbers the pieces of one drive: a sensor knows nothing of what it measured minutes ago.
    """
    if sensor is None:
        return np.zeros(len(path))
    return sensor.sample(len(path), step, generator(seed, DriveSeed.SENSOR, part))


def recorded_offsets(
    profile: DriverProfile,
    segment: Segment,
    seed: np.random.SeedSequence,
    sensor: SensorModel | None = None,
    start: float | None = None,
) -> FloatArray:
    """A sampled path with the sensor's error on it, shape (n,), the sum of which begins at `start`. [m]"""
    if sensor is None:
        return sample_offsets(profile, segment, seed, start=start)
    error = sensor_error(sensor, segment.lane_width[segment.inside], profile.model.step, seed)
    begin = None if start is None else start - float(error[0])
    return sample_offsets(profile, segment, seed, start=begin) + error


PAST_CONTEXT, FUTURE_CONTEXT = 30.0, 10.0
"""Context before and after a snippet that effects may look at. [s]"""


@dataclass(frozen=True, slots=True)
class Snippet:
    """A stretch of a run: `rows` of `run`, the `index`-th of its drive."""

    run: Run
    index: int
    rows: slice

    @property
    def time(self) -> FloatArray:
        """Shape (n,). [s]"""
        return self.run.time[self.rows]

    @property
    def offset(self) -> FloatArray:
        """As measured, positive left, shape (n,). [m]"""
        return self.run.offset[self.rows]


def cut_snippets(runs: Sequence[Run], seconds: float, step: float = STEP) -> list[Snippet]:
    """Successive snippets without overlap; each has ``seconds / step + 1`` rows and lies in one run.

    Raises `NotEnoughDataError` when no run is as long.
    """
    length = round(seconds / step) + 1
    if length < 2:
        raise ValueError(f"a snippet of {seconds} s holds no two steps of {step} s")
    snippets: list[Snippet] = []
    count: dict[str, int] = {}
    for run in runs:
        for first in range(0, len(run) - length + 1, length):
            index = count.get(run.drive, 0)
            snippets.append(Snippet(run, index, slice(first, first + length)))
            count[run.drive] = index + 1
    if not snippets:
        longest = max((len(run) for run in runs), default=0) * step
        raise NotEnoughDataError(f"the longest run lasts {longest:.1f} s, a snippet needs {seconds:g} s")
    return snippets


def segment_of(run: Run, rows: slice | None = None) -> Segment:
    """A run, or rows of it with the context around them, as the segment that is sampled on.

    Columns that are empty all along stay in the context: there is none, which is not the same as not being known.
    """
    first, last = (0, len(run)) if rows is None else (rows.start, rows.stop)
    begin = max(0, first - round(PAST_CONTEXT / STEP))
    end = min(len(run), last + round(FUTURE_CONTEXT / STEP))
    cut = slice(begin, end)
    speed = np.full(end - begin, np.nan) if run.speed is None else run.speed[cut]
    return Segment(
        time=run.time[cut],
        lane_width=run.lane_width[cut],
        speed=speed,
        context={name: np.full(end - begin, np.nan) for name in run.empty}
        | {name: values[cut] for name, values in run.context.items()},
        before=first - begin,
        after=end - last,
    )
