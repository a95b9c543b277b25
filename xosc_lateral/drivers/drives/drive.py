"""Measured drives as numbers: rows as recorded, and the separate runs on an even grid that a cut leaves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from xosc_lateral.base.arrays import FloatArray, IntArray


@dataclass(frozen=True, slots=True)
class MarkingShares:
    """Rows in which a camera had misjudged a lane marking."""

    one_marking: float
    # Shares of a drive's rows that follow one marking because the other was misjudged (by 5 cm of offset and more), and
    # that were left out because both were. [-]
    no_marking: float


@dataclass(frozen=True, eq=False, slots=True)
class Drive:
    """One drive as recorded, in clean units: finite, sorted, each time once. Arrays of shape (n,)."""

    name: str  # Drive in the table, else the file's stem.
    time: FloatArray  # Strictly increasing, steps may vary. [s]
    offset: FloatArray  # From the lane centre, positive to the LEFT of travel. [m]
    lane_width: FloatArray  # [m]
    # Every other numeric column, and `speed` and `lane_width` under these names. NaN: there is none.
    context: Mapping[str, FloatArray] = field(default_factory=dict)
    # Context columns that hold a few whole numbers (lane index, flags): never averaged.
    levels: frozenset[str] = frozenset()
    source: str = ""  # Where it was read. For messages.
    # Number of each row's road-following stretch, where an import has cut the drive already: lane changes and their
    # margins are gone, and none are searched again. None: nothing has been cut.
    run: IntArray | None = None
    mended: MarkingShares | None = None  # Rows in which a camera had misjudged a marking, see `markings`.
    # Columns of its table that hold nothing in this drive, and are not in `context`: there is none, all along (no lane
    # to that side). Of a column that the table lacks, nothing is known.
    empty: frozenset[str] = frozenset()
    # Half the lane width as a camera recorded it, with errors of both markings, as the offset has them. None: the lane
    # width comes from a map, or from elsewhere than the offset. [m]
    half_width: FloatArray | None = None
    valid_below: float | None = None  # Frequency below which the recording shows driving, where it is known. [Hz]
    resolution: float | None = None  # Step or noise of the offsets, where it is known. [m]
    driver: str = ""  # Who drove, where the table says; several drives may be one driver's.
    frozen: int = 0  # Rows left out because a camera had repeated itself, see `frozen_rows`.

    def __post_init__(self) -> None:
        """Copy and freeze; refuse unequal lengths and what readers must have taken out."""
        _freeze(self, self.name)
        if np.any(np.diff(self.time) <= 0):
            raise ValueError(f"drive {self.name}: time does not increase")

    def __len__(self) -> int:
        return len(self.time)

    @property
    def speed(self) -> FloatArray | None:
        """Shape (n,) [m/s], None when not recorded."""
        return self.context.get("speed")


@dataclass(frozen=True, eq=False, slots=True)
class Run:
    """Road-following driving on an even grid, arrays of shape (n,); nothing may be counted across two runs."""

    drive: str  # Name of the drive that it comes from.
    index: int  # Number of the run in its drive, from 0.
    time: FloatArray  # Even, in the drive's own clock. [s]
    offset: FloatArray  # Positive to the LEFT of travel. [m]
    lane_width: FloatArray  # [m]
    context: Mapping[str, FloatArray] = field(default_factory=dict)  # As in `Drive`.
    levels: frozenset[str] = frozenset()
    empty: frozenset[str] = frozenset()  # As in `Drive`, as are the next two.
    valid_below: float | None = None
    resolution: float | None = None

    def __post_init__(self) -> None:
        """Copy and freeze; refuse unequal lengths and missing values."""
        _freeze(self, self.drive)

    def part(self, rows: slice, drive: str | None = None) -> Run:
        """Some of its rows, under its drive's name or another."""
        return replace(
            self,
            drive=drive or self.drive,
            time=self.time[rows],
            offset=self.offset[rows],
            lane_width=self.lane_width[rows],
            context={name: values[rows] for name, values in self.context.items()},
        )

    def __len__(self) -> int:
        return len(self.time)

    @property
    def rel_offset(self) -> FloatArray:
        """Offset / lane width, shape (n,). [-]"""
        return self.offset / self.lane_width

    @property
    def speed(self) -> FloatArray | None:
        """Shape (n,) [m/s], None when not recorded."""
        return self.context.get("speed")


def _freeze(series: Drive | Run, name: str) -> None:
    """Copies that nobody can write to in place of its arrays; all but context and the run's number are finite."""
    n = len(series.time)

    def frozen(label: str, values: NDArray[Any], kind: DTypeLike = np.float64) -> NDArray[Any]:
        array = np.array(values, dtype=kind)
        if array.shape != (n,):
            raise ValueError(f"drive {name}: {label}: shape {array.shape}, expected ({n},)")
        array.flags.writeable = False
        return array

    if (number := getattr(series, "run", None)) is not None:
        object.__setattr__(series, "run", frozen("run", number, np.int64))
    for label in ("time", "offset", "lane_width", "half_width"):
        if (values := getattr(series, label, None)) is not None:
            object.__setattr__(series, label, frozen(label, values))
            if not np.isfinite(values).all():
                raise ValueError(f"drive {name}: {label} is not finite")
    context = {key: frozen(key, values) for key, values in series.context.items()}
    object.__setattr__(series, "context", MappingProxyType(context))
