"""Whatever moves, over time: columns of known meaning on one axis of time, with the rows where something new begins."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Generic, Literal, Self, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray, IndexArray, blocks

Kind = TypeVar("Kind", bound=np.generic)
Between = Literal["linear", "angle", "nearest", "across"]
"""What is between two rows. `across`: linear from lane to lane; the step from one lane's centre to the next is none."""

KNOWN: dict[str, Column[Any]] = {}
"""Columns that have an accessor, by name; any other is a context column: float64, NaN where there is nothing."""

MAX_GAP = 0.5
"""Missing rows up to this long are bridged; longer ones end a run. [s]"""


class Column(Generic[Kind]):
    """A column of known meaning, and its accessor: `track.speed` is `track.columns["speed"]`, typed."""

    __slots__ = ("between", "kind", "name", "unit")

    def __init__(self, kind: type[Kind], unit: str = "", between: Between = "linear") -> None:
        self.kind, self.unit, self.between = kind, unit, between

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name
        KNOWN[name] = self

    @overload
    def __get__(self, track: None, owner: type) -> Self: ...
    @overload
    def __get__(self, track: Track, owner: type) -> NDArray[Kind]: ...
    def __get__(self, track: Track | None, owner: type) -> NDArray[Kind] | Self:
        if track is None:
            return self
        try:
            return track.columns[self.name]
        except KeyError:
            raise AttributeError(track.lacks(self.name)) from None


@dataclass(frozen=True, eq=False, slots=True)
class Track:
    """Rows of one thing that moves; `at`, `every` and `pieces` give tracks of the same kind."""

    name: str
    time: FloatArray  # strictly increasing, shape (n,) [s]
    columns: Mapping[str, NDArray[Any]]  # by name, read-only, shape (n,) each
    breaks: IndexArray  # rows, from 1 on, where something new begins: placed anew, a gap, a cut

    # the pose of the reference point (rear axle), and the signed speed
    x = Column(np.float64, "m")
    y = Column(np.float64, "m")
    z = Column(np.float64, "m")
    heading = Column(np.float64, "rad", "angle")
    pitch = Column(np.float64, "rad")
    roll = Column(np.float64, "rad")
    speed = Column(np.float64, "m/s")
    # the place on the road
    road = Column(np.int32, "index into `RoadNetwork.road_ids`; -1: on none", "nearest")
    lane = Column(np.int32, "OpenDRIVE lane id; 0: on no road", "nearest")
    s = Column(np.float64, "m", "nearest")  # along the road's reference line: another road's begins anew
    offset = Column(np.float64, "m", "across")  # from the centre of `lane`, positive to the LEFT of the LANE's travel
    heading_relative = Column(np.float64, "rad", "angle")  # from its direction of travel, in the road's surface
    activity = Column(np.uint8, "bits", "nearest")
    # the lane
    lane_width = Column(np.float64, "m")
    lane_index = Column(np.float64, "from the rightmost; NaN: not known", "nearest")
    lane_count = Column(np.float64, "NaN: not known", "nearest")
    following = Column(np.bool_, "", "nearest")  # in a driving lane at 40 km/h or more

    def __post_init__(self) -> None:
        """Lock the columns, not the caller's arrays; a column of another length or kind is a mistake of ours."""
        columns = {name: _locked(self, name, values) for name, values in self.columns.items()}
        object.__setattr__(self, "columns", columns)

    def __len__(self) -> int:
        return len(self.time)

    def lacks(self, name: str) -> str:
        """Says that there is no such column."""
        unit = f" [{KNOWN[name].unit}]" if name in KNOWN and KNOWN[name].unit else ""
        return f"track {self.name!r}: no column {name!r}{unit}; there are {', '.join(self.columns) or 'none'}"

    def validate(self, *needed: str) -> Self:
        """Itself, at the door; raises `ValueError` where a needed column is not there, or time does not increase."""
        for name in needed:
            if name not in self.columns:
                raise ValueError(self.lacks(name))
        for rows in blocks(len(self), 1):
            if not (np.diff(self.time[rows.start - 1 : rows.stop]) > 0.0).all():
                raise ValueError(f"track {self.name!r}: time does not increase")
        return self

    def having(self, **columns: NDArray[Any]) -> Self:
        """With these columns, in place of its own of those names."""
        return replace(self, columns={**self.columns, **columns})

    def at(self, rows: slice | IndexArray) -> Self:
        """On some of its rows, in order; a slice's columns are views."""
        taken = range(len(self))[rows] if isinstance(rows, slice) else rows
        breaks = np.unique(np.searchsorted(taken, self.breaks)) if len(self.breaks) else self.breaks
        columns = {name: values[rows] for name, values in self.columns.items()}
        inside = breaks[(breaks > 0) & (breaks < len(taken))]
        return replace(self, time=self.time[rows], columns=columns, breaks=inside)

    def pieces(self, max_gap: float = np.inf, cuts: Iterable[int] = ()) -> list[Self]:
        """Stretches without a break: neither its own, nor a gap above this [s], nor a cut before one of these rows."""
        gaps = np.flatnonzero(np.diff(self.time) > max_gap) + 1
        edges = sorted({0, *self.breaks.tolist(), *gaps.tolist(), *cuts, len(self)})
        return [self.at(slice(first, stop)) for first, stop in pairwise(edges)]

    def every(self, step: float) -> Self:
        """At k * step for whole k, each column by what is between its rows; of a track without a break. [s]"""
        if len(self.breaks):
            raise ValueError(f"track {self.name!r}: breaks at rows {self.breaks.tolist()}; take its pieces")
        first, last = np.ceil(self.time[0] / step - 1e-6), np.floor(self.time[-1] / step + 1e-6)
        at = step * np.arange(first, last + 1)
        nearest = np.clip(np.searchsorted(self.time, at), 1, len(self) - 1) if len(self) > 1 else np.zeros(len(at), int)
        if len(self) > 1:
            nearest -= at - self.time[nearest - 1] < self.time[nearest] - at
        columns = {name: self._between(name, at, nearest) for name in self.columns}
        return replace(self, time=at, columns=columns)

    def _between(self, name: str, at: FloatArray, nearest: IndexArray) -> NDArray[Any]:
        values = self.columns[name]
        between = KNOWN[name].between if name in KNOWN else "linear"
        if between == "nearest":
            return values[nearest]
        if between == "angle":
            return np.asarray(np.interp(at, self.time, np.unwrap(values)))
        if between == "across":
            base, _ = lane_levels(values, self.lane_width)
            return np.asarray(np.interp(at, self.time, values + base) - base[nearest])
        return np.asarray(np.interp(at, self.time, values))


def _locked(track: Track, name: str, values: NDArray[Any]) -> NDArray[Any]:
    kind = KNOWN[name].kind if name in KNOWN else np.float64
    if values.shape != track.time.shape or values.dtype != kind:
        wanted = f"{np.dtype(kind)} of shape {track.time.shape}"
        raise ValueError(f"track {track.name!r}: column {name!r} is {values.dtype} of {values.shape}, not {wanted}")
    view = values.view()
    view.flags.writeable = False
    return view


def lane_levels(offset: FloatArray, lane_width: FloatArray) -> tuple[FloatArray, NDArray[np.int64]]:
    """Lateral position of each row's lane centre from the first row's [m], and how many lanes to its left; shape (n,).

    A step of the offset by more than half a lane is a new lane; one lane that goes over into another ahead has none.
    """
    step, width = np.diff(offset), 0.5 * (lane_width[1:] + lane_width[:-1])
    lanes = np.where(np.abs(step) > 0.5 * width, -np.round(step / width), 0.0)
    return np.r_[0.0, np.cumsum(lanes * width)], np.r_[0, np.cumsum(lanes)].astype(np.int64)
