"""ASAM MDF bus logs (.mf4, .mdf, .dat) into the standard drive table, through asammdf (extra `mdf`).

No two cars name their signals alike, so the reader asks for a channel map: ``NAME=CHANNEL[:UNIT]``, such as
``offset=Lane_LatOffset``, ``distance_left=LnMrkLeft_Dist``, ``speed=VehSpd:km/h``. Needed are `offset` and
`lane_width`, or `distance_left` and `distance_right`; every other name becomes a context column. A unit in the map
counts; else the one that the file gives with the channel does.

Quantities are interpolated linearly between a channel's own stamps. Whole numbers and booleans without a physical unit
(lane indices, flags) and words (``WET``, ``DRY``) take the nearest sample; words become categories.
"""

from __future__ import annotations

import gc
import io
import sys
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.limits import CLOCK_ROWS, TIME
from xosc_lateral.base.segment import CONTEXT_UNITS
from xosc_lateral.files.mapping import ColumnSource, MappingLike, as_mapping, factor, is_measured, parse_map, spelled
from xosc_lateral.files.source import open_source
from xosc_lateral.files.tables import LONGEST_MESSAGE, foreign_errors
from xosc_lateral.workflows.recordings.cuts import KEPT_ROWS
from xosc_lateral.workflows.recordings.importers.table import Imported, finished, guarded

POSITIONS = (("offset", "lane_width"), ("distance_left", "distance_right"))
LICENCE = "your own recording"

_NO_MDF = "not an MDF file that asammdf can read"

LISTED = 40
"""Channel names in a message, at most."""

STAYS_AWAY = 1.0
"""Messages of the position that are further apart leave a gap. [s]"""


@dataclass(frozen=True, eq=False)
class Channel:
    """A mapped channel."""

    time: FloatArray  # stamps, shape (n,) [s]
    values: NDArray[Any]  # numbers in the unit of the standard table, or words, shape (n,)
    unit: str  # that they were read in; empty where neither map nor file names one
    is_stepwise: bool  # whether the nearest sample counts

    def at(self, time: FloatArray) -> NDArray[Any]:
        """Values at these times. [s]"""
        if not self.is_stepwise:
            return np.asarray(np.interp(time, self.time, self.values))
        after = np.clip(np.searchsorted(self.time, time), 1, len(self.time) - 1)
        before = after - 1
        return np.asarray(self.values[np.where(time - self.time[before] <= self.time[after] - time, before, after)])


@guarded
def import_mf4(
    sources: Path | Sequence[Path],
    channels: Sequence[str] = (),
    *,
    step: float = 0.04,
    mapping: MappingLike | None = None,
) -> Imported:
    """Read mapped channels of bus logs at an even step, over the time that all position channels of a log cover.

    Raises `FormatError` if the map lacks the position, asammdf is not installed, a log can't be read, a channel is not
    in it, or the unit in the file measures something else.

    `sources`: each log is a drive of its own, called after its file. `channels`: words ``NAME=CHANNEL[:UNIT]``.
    `mapping`: more of them, saved. `step`: of the table [s]. Messages that stay away for longer than a second leave
    a gap.
    """
    files = [sources] if isinstance(sources, Path) else list(sources)
    sources_of = {**as_mapping(mapping).columns, **parse_map(channels)}
    if not any(set(pair) <= sources_of.keys() for pair in POSITIONS):
        raise FormatError(f"{channels_wanted(files[0])}; mapped: {', '.join(sources_of) or 'nothing'}", path=files[0])
    read = {}
    for file in files:
        with _opened(file) as log:
            read[file] = {name: _read_channel(log, name, wanted, file) for name, wanted in sources_of.items()}
    named = zip(read.items(), _drive_names(files), strict=True)
    table = pd.concat([_table(signals, file, name, step) for (file, signals), name in named], ignore_index=True)
    # column -> unit that it was read in; several where logs differ
    every = {name: {signals[name].unit for signals in read.values()} for name in sources_of}
    units = {name: " | ".join(sorted(found)) for name, found in every.items()}
    settings = {"step": step, "channels": list(channels), "units": units}
    about = {"format": "mf4", "licence": LICENCE, "settings": settings, "step": step}
    return finished(table, keep_cut=False, sources=files, **about)


def channels_wanted(source: Path) -> str:
    """What the channel map has to name, and the channels that there are to choose from: for who has no map yet.

    Raises `FormatError` when it can't be read as MDF.
    """
    with _opened(source) as log:
        names = _names(log)
    listed = ", ".join(names[:LISTED]) + (", ..." if len(names) > LISTED else "")
    return (
        "the channel map needs --map offset=CHANNEL[:UNIT] and --map lane_width=CHANNEL[:UNIT], or "
        "--map distance_left=CHANNEL[:UNIT] and --map distance_right=CHANNEL[:UNIT]; "
        f"{source.name} has {len(names)} channels: {listed}"
    )


def _names(log: Any) -> list[str]:
    # Every group's time base is a channel as well; names such as CAN1.Speed repeat others with their bus.
    masters = {log.groups[group].channels[index].name for group, index in log.masters_db.items()}
    return sorted(set(log.channels_db) - masters)


def _drive_names(files: Sequence[Path]) -> list[str]:
    """Stems, with the folder's name before those that occur twice."""
    stems = [file.stem for file in files]
    if twice := [file for file in files if files.count(file) > 1]:
        raise FormatError("the log is named twice", path=twice[0])
    return [file.stem if stems.count(file.stem) == 1 else str(file.with_suffix("")) for file in files]


@contextmanager
def _opened(source: Path) -> Iterator[Any]:
    """The log; `FormatError` when asammdf is not there or can't read it."""
    try:
        from asammdf import MDF
    except ImportError as error:
        raise FormatError("reading MDF needs asammdf: pip install 'xosc-lateral[mdf]'", path=source) from error
    with open_source(source) as opened, foreign_errors(source, _NO_MDF):
        try:
            log = MDF(opened.file if isinstance(opened.file, io.BytesIO) else source)
        except Exception as error:
            raise FormatError(f"{_NO_MDF}: {_stated_unit(error)}", path=source) from None
        with log:
            yield log


def _stated_unit(error: Exception) -> str:
    """Words of an error, after which nothing is left of what it broke off.

    asammdf's half-made objects complain on standard error when they are disposed of: here, and unheard.
    """
    reason = " ".join(str(error).split())[:LONGEST_MESSAGE] or type(error).__name__
    hook, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        traceback.clear_frames(error.__traceback__)
        error.__traceback__ = error.__context__ = error.__cause__ = None
        gc.collect()
    finally:
        sys.unraisablehook = hook
    return reason


def _read_channel(log: Any, name: str, wanted: ColumnSource, source: Path) -> Channel:
    def wrong(what: str) -> FormatError:
        return FormatError(f"channel {wanted.column}{what}", path=source, element=name)

    places = log.channels_db.get(wanted.column)
    if not places:
        raise FormatError(f"no channel {wanted.column}{_alike(log, wanted.column)}", path=source, element=name)
    # The same channel may lie in several groups (one per bus): the one with the most samples counts.
    signals = [log.get(group=group, index=index) for group, index in places]
    signal = max(signals, key=lambda one: len(one.samples))
    samples, stamps = signal.samples, np.asarray(signal.timestamps, dtype=np.float64)
    kind = samples.dtype.kind
    if kind in "SU":
        if _is_quantity(name, ""):
            raise wrong(" holds words, not numbers")
        words = [word.decode("utf-8", "replace") if isinstance(word, bytes) else str(word) for word in samples.tolist()]
        found = Channel(stamps, np.array([word.strip("\x00 ") for word in words], dtype=object), "", True)
    elif kind not in "fiub" or samples.ndim != 1:
        raise wrong(f" holds {samples.dtype}, neither numbers nor words")
    else:
        try:
            unit, by = _unit(str(signal.unit or ""), name, wanted)
        except ValueError as error:
            more = f"name the unit with --map {name}={wanted.column}:UNIT"
            raise wrong(f" is in {str(signal.unit or '')!r}: {error}; {more}") from error
        values = np.asarray(samples, dtype=np.float64) * by
        if len(stamps) != len(values) or np.abs(stamps).max(initial=0.0) > TIME.value or (np.diff(stamps) < 0).any():
            raise wrong(f": times that do not increase, or are beyond {TIME}")
        finite = np.isfinite(values) & np.isfinite(stamps)
        stepwise = kind in "iub" and not _is_quantity(name, unit)
        found = Channel(stamps[finite], values[finite], unit, stepwise)
    if len(found.values) < 2:
        raise wrong(f" has {len(found.values)} values; two are needed")
    return found


def _alike(log: Any, wanted: str) -> str:
    """What it may have been meant for."""
    names = _names(log)
    by_lower = {name.lower(): name for name in reversed(names)}
    close = [by_lower[lower] for lower in get_close_matches(wanted.lower(), by_lower, n=5, cutoff=0.6)]
    close += [name for name in names if wanted.lower() in name.lower() and name not in close]
    return f"; like it are {', '.join(close[:8])}" if close else f"; the log has {len(names)} others, none alike"


def _unit(given: str, name: str, wanted: ColumnSource) -> tuple[str, float]:
    """Unit that counts, and the factor from it to the standard table's; `ValueError`: it measures something else."""
    if wanted.unit:
        return wanted.unit, wanted.factor
    unit = spelled(given)
    if unit == "" or (unit is None and not _is_quantity(name, "")):
        return given, 1.0
    return given, factor(name, given if unit is None else unit)


def _is_quantity(name: str, unit: str) -> bool:
    """Whether a column holds a physical quantity: by the standard table, or by its unit."""
    known = (*POSITIONS[0], *POSITIONS[1], "time")
    return name in known or CONTEXT_UNITS.get(name, "-") != "-" or is_measured(spelled(unit.lstrip("-")) or "")


def _table(signals: dict[str, Channel], source: Path, drive: str, step: float) -> pd.DataFrame:
    position = [name for pair in POSITIONS for name in pair if name in signals]
    start = max(float(signals[name].time[0]) for name in position)
    end = min(float(signals[name].time[-1]) for name in position)
    if not end > start:
        raise FormatError(f"channels {', '.join(position)} have no time in common", path=source)
    if (rows := (end - start) / step) > CLOCK_ROWS.value:
        raise FormatError(CLOCK_ROWS.refusal(rows), path=source)
    time = np.asarray(start + step * np.arange(int((end - start) / step) + 1), dtype=np.float64)
    columns = {name: channel.at(time) for name, channel in signals.items()}
    missing = np.zeros(len(time), dtype=np.bool_)  # instants between two messages that are too far apart
    for name in position:
        stamps = signals[name].time
        after = np.clip(np.searchsorted(stamps, time), 1, len(stamps) - 1)
        missing |= stamps[after] - stamps[after - 1] > STAYS_AWAY
    state = np.where(missing, "gap", KEPT_ROWS)
    return pd.DataFrame({"drive": drive, "time": np.round(time - start, 6), **columns, "state": state})
