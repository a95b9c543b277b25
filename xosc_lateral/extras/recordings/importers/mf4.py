"""ASAM MDF bus logs (.mf4, .mdf, .dat) into the standard drive table, through asammdf (extra `mdf`).

No two cars name their signals alike, so the reader asks for a channel map: ``NAME=CHANNEL[:UNIT]``, such as
``offset=Lane_LatOffset``, ``distance_left=LnMrkLeft_Dist``, ``speed=VehSpd:km/h``. Needed are `offset` and
`lane_width`, or `distance_left` and `distance_right`; every other name becomes a context column. A unit in the map
counts; else the one that the file gives with the channel does.

What is not continuous is found on a channel's own samples: the jump of a lane change, gaps, and where a channel begins
and ends. Between these, quantities are interpolated to an even step, through a low-pass where they have more samples
than that; whole numbers and booleans without a physical unit (lane indices, flags) and words (``WET``, ``DRY``) take
the nearest sample; words become categories.
"""

from __future__ import annotations

import gc
import io
import re
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.limits import CLOCK_ROWS, TIME
from xosc_lateral.base.segment import CONTEXT_UNITS
from xosc_lateral.drivers.drives.drive import LANE_JUMP_SHARE, MAX_GAP, average, resample
from xosc_lateral.extras.recordings.cuts import KEPT_ROWS
from xosc_lateral.extras.recordings.formula import FormulaError, evaluate
from xosc_lateral.extras.recordings.importers import ImportedDrives, imported, importer, paths_of
from xosc_lateral.files.apart import apart
from xosc_lateral.files.columns import refuse_marker
from xosc_lateral.files.drives import file_labels, from_middle
from xosc_lateral.files.mapping import ColumnSource, MappingLike, as_mapping, factor, is_measured, spelled
from xosc_lateral.files.source import Source, open_source
from xosc_lateral.files.tables import LONGEST_MESSAGE, foreign_errors
from xosc_lateral.workflows.options import flag

POSITIONS = (("offset", "lane_width"), ("distance_left", "distance_right"))
LICENCE = "your own recording"

_NO_MDF = "not an MDF file that asammdf can read"
LISTED_CHANNELS = 40  # channel names in a message, at most
MAX_CHANNEL_DISTANCE = 0.2  # median distance of two channels of one name that is not one of rates, by the spread [-]
SPARSE_STEPS = 2.5  # a channel of few samples has a gap where more than two in a row lack: of its median steps [-]


@dataclass(frozen=True, eq=False)
class Channel:
    """A mapped channel."""

    time: FloatArray  # stamps, shape (n,) [s]
    values: NDArray[Any]  # numbers in the unit of the standard table, or words, shape (n,)
    unit: str  # that they were read in; empty where neither map nor file names one
    is_stepwise: bool  # whether the nearest sample counts
    notes: tuple[str, ...] = ()  # what a user has to know

    def breaks(self, jump: float = np.inf) -> NDArray[np.bool_]:
        """Gaps between samples, and jumps by more than so much, across which nothing is known, shape (n - 1,)."""
        step = np.diff(self.time)
        broken = step > max(MAX_GAP, SPARSE_STEPS * float(np.median(step))) + 1e-9
        if not self.is_stepwise:
            broken |= np.abs(np.diff(self.values)) > jump
        return np.asarray(broken)

    def at(self, time: FloatArray, broken: NDArray[np.bool_], *, is_position: bool) -> NDArray[Any]:
        """Values at these times, evenly spaced [s]; NaN (None of words) before the first and past the last sample, and
        within steps that are broken. A sample stands for its step, so that the last one is not the end."""
        after = np.clip(np.searchsorted(self.time, time), 1, len(self.time) - 1)
        held = min(float(np.median(np.diff(self.time))), MAX_GAP) + 1e-9
        known = (time >= self.time[0] - held) & (time <= self.time[-1] + held)
        if self.is_stepwise:  # these are sent where they change: no gap ends them
            nearest = np.where(time - self.time[after - 1] <= self.time[after] - time, after - 1, after)
            values = self.values[nearest].astype(object if self.values.dtype == object else np.float64)
            values[~known] = None if values.dtype == object else np.nan
            return values
        values, low_pass = np.full(len(time), np.nan), resample if is_position else average
        edges = [0, *(np.flatnonzero(broken) + 1).tolist(), len(self.time)]
        for first, end in pairwise(edges):
            before, past = (1e-9 if edge in edges[1:-1] else held for edge in (first, end))
            rows = np.flatnonzero((time >= self.time[first] - before) & (time <= self.time[end - 1] + past))
            if len(rows) and end - first > 1:
                values[rows] = low_pass(self.time[first:end], self.values[first:end], time[rows])
            elif len(rows):
                values[rows] = self.values[first]
        return values


@importer
def import_mf4(
    sources: Path | Sequence[Path],
    columns: MappingLike | None = None, *,
    step: Annotated[float, flag(help="Time step of the table, to which channels are interpolated [s].", min=0.001,
        max=1)] = 0.04,
) -> ImportedDrives:  # fmt: skip
    """ASAM MDF bus logs (extra `mdf`). They need a channel map, since signal names differ from car to car.

    Mapped channels are read at an even step, over the time that all position channels of a log cover. Each log is a
    drive called after its file. Messages that stay away for longer than `fit` bridges leave a gap.
    """
    files, saved = paths_of(sources), as_mapping(columns)
    wanted = saved.columns
    if not any(set(pair) <= wanted.keys() for pair in POSITIONS):
        raise FormatError(f"{channels_wanted(files[0])}; mapped: {', '.join(wanted) or 'nothing'}", path=files[0])
    tables, notes = list[pd.DataFrame](), list[str]()
    units: dict[str, set[str]] = {name: set() for name in wanted}  # that columns were read in; logs may differ
    for file, label in zip(files, file_labels(files), strict=True):
        signals = read_channels(file, wanted, saved.missing)
        for name, channel in signals.items():
            units[name].add(channel.unit)
            notes += channel.notes
        tables.append(from_middle(_table(signals, file, label, step), saved, file))
    for table in tables:
        for name in wanted:
            share = table[name].notna().mean() if name in table else 1.0
            if share < 1.0 and name not in POSITIONS[0] + POSITIONS[1]:
                notes.append(f"{table['drive'].iloc[0]}: {name} is known in {100 * share:.0f} % of the time")
    every_unit = {name: " | ".join(sorted(words)) for name, words in units.items()}
    settings = {"step": step, "channels": [f"{name}={one.column}" for name, one in wanted.items()], "units": every_unit}
    about = {"format": "mf4", "licence": LICENCE, "settings": settings, "notes": tuple(dict.fromkeys(notes))}
    return imported(pd.concat(tables, ignore_index=True), sources=files, step=step, **about)


def channels_wanted(source: Path) -> str:
    """What the channel map has to name, and the channels that there are to choose from: for who has no map yet."""
    names = channel_names(source)
    listed = ", ".join(names[:LISTED_CHANNELS]) + (", ..." if len(names) > LISTED_CHANNELS else "")
    return (
        "the channel map needs --map offset=CHANNEL[:UNIT] and --map lane_width=CHANNEL[:UNIT], or "
        "--map distance_left=CHANNEL[:UNIT] and --map distance_right=CHANNEL[:UNIT]; "
        f"{source.name} has {len(names)} channels: {listed}"
    )


@apart
def channel_names(source: Path) -> list[str]:
    """Of all channels of a log. Raises `FormatError`."""
    with _opened(source) as log:
        return _names(log)


@apart
def read_channels(
    source: Path, wanted: Mapping[str, ColumnSource], missing: Sequence[float | str] | None
) -> dict[str, Channel]:
    """Channels of a log, by the columns that they become. Raises `FormatError`."""
    with _opened(source) as log:
        return {name: _read_channel(log, name, channel, source, missing) for name, channel in wanted.items()}


def _names(log: Any) -> list[str]:
    """Of channels, without the time bases of groups; names such as CAN1.Speed repeat others with their bus."""
    masters = {log.groups[group].channels[index].name for group, index in log.masters_db.items()}
    return sorted(set(log.channels_db) - masters)


@contextmanager
def _opened(source: Path) -> Iterator[Any]:
    try:
        from asammdf import MDF
    except ImportError as error:
        raise FormatError("reading MDF needs asammdf: pip install 'xosc-lateral[mdf]'", path=source) from error
    _compute_formulas()
    with open_source(source) as opened, foreign_errors(source, _NO_MDF):
        _refuse_unpacking(opened)
        try:
            log = MDF(opened.file if isinstance(opened.file, io.BytesIO) else source)
        except Exception as error:
            raise FormatError(f"{_NO_MDF}: {_reason(error)}", path=source) from None
        with log:
            yield log


_PACKED = re.compile(rb"##DZ.{4}(.{8})\0{8}.{8}(.{8})(.{8})", re.DOTALL)
"""Header of a packed block: its size, no links, kind, unpacked and packed size (ASAM MDF 4.2, ##DZ)."""
_PACKED_HEAD = 48
_SCANNED = 1 << 24


def _refuse_unpacking(opened: Source) -> None:
    """Refuse a log whose packed blocks say that they are too large, before anything is unpacked."""
    size, rest = 0, b""
    while chunk := opened.file.read(_SCANNED):
        text = rest + chunk
        for match in _PACKED.finditer(text):
            block, unpacked, packed = (int.from_bytes(part, "little") for part in match.groups())
            if packed <= block <= opened.size:  # else these are values that look like a header
                size += unpacked
        rest = text[-_PACKED_HEAD + 1 :]
    opened.unpacked(size)
    opened.file.seek(0)


def _compute_formulas() -> None:
    """Let our own parser compute what a log states as formulas; asammdf would leave or run what it does not know."""
    from asammdf.blocks import v2_v3_blocks, v2_v3_constants, v4_blocks, v4_constants

    for blocks, kind in (
        (v4_blocks, v4_constants.CONVERSION_TYPE_ALG),
        (v2_v3_blocks, v2_v3_constants.CONVERSION_TYPE_FORMULA),
    ):
        conversion: Any = blocks.ChannelConversion
        if getattr(conversion.convert, "kind", None) is not None:
            continue

        def convert(
            self: Any, values: Any, *more: Any, kind: int = kind, its: Any = conversion.convert, **keywords: Any
        ) -> Any:
            computed = self.conversion_type == kind
            return evaluate(str(self.formula), values) if computed else its(self, values, *more, **keywords)

        convert.kind = kind  # type: ignore[attr-defined]
        conversion.convert = convert


def _reason(error: Exception) -> str:
    """Words of an error, whose half-made objects, which complain on standard error, are disposed of here, unheard."""
    reason = " ".join(str(error).split())[:LONGEST_MESSAGE] or type(error).__name__
    hook, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        traceback.clear_frames(error.__traceback__)
        error.__traceback__ = error.__context__ = error.__cause__ = None
        gc.collect()
    finally:
        sys.unraisablehook = hook
    return reason


def _read_channel(
    log: Any, name: str, wanted: ColumnSource, source: Path, missing: Sequence[float | str] | None
) -> Channel:
    def wrong(what: str) -> FormatError:
        return FormatError(f"channel {wanted.column}{what}", path=source, element=name)

    channel, at, number = wanted.column.rpartition("@")
    named, only = (channel, number) if at and number.isdigit() else (wanted.column, "")
    places = [place for place in log.channels_db.get(named, ()) if only in ("", str(place[0]))]
    if not places:
        raise FormatError(f"no channel {wanted.column}{_alike(log, named)}", path=source, element=name)
    try:
        signals = [log.get(group=group, index=index) for group, index in places]
    except FormulaError as error:
        raise wrong(f" is computed by a formula: {error}") from error
    notes = _of_one_name(signals, [group for group, _ in places], name, named, wrong)
    signal = max(signals, key=lambda signal: len(signal.samples))
    samples, stamps = signal.samples, np.asarray(signal.timestamps, dtype=np.float64)
    kind, stated, is_quantity = samples.dtype.kind, str(signal.unit or ""), _is_quantity(name)
    if kind in "SU":
        if is_quantity:
            raise wrong(" holds words, not numbers")
        words = [word.decode("utf-8", "replace") if isinstance(word, bytes) else str(word) for word in samples.tolist()]
        read = Channel(stamps, np.array([word.strip("\x00 ") for word in words], dtype=object), "", True)
    elif kind not in "fiub" or samples.ndim != 1:
        raise wrong(f" holds {samples.dtype}, neither numbers nor words")
    else:
        unit, by = stated, 1.0
        if wanted.unit:
            unit, by = wanted.unit, wanted.factor
        elif (known := spelled(stated)) != "" and (known is not None or is_quantity):
            try:
                by = factor(name, stated if known is None else known)
            except ValueError as error:
                more = f"name the unit with --map {name}={wanted.column}:UNIT"
                raise wrong(f" is in {stated!r}: {error}; {more}") from error
        raw = np.asarray(samples, dtype=np.float64)
        if missing is None:
            refuse_marker(raw, name, source)
        markers = [marker for marker in missing or () if not isinstance(marker, str)]
        values = np.where(np.isin(raw, markers), np.nan, raw) * by
        if len(stamps) != len(values) or np.abs(stamps).max(initial=0.0) > TIME.value or (np.diff(stamps) < 0).any():
            raise wrong(f": times that do not increase, or are beyond {TIME}")
        finite = np.isfinite(values) & np.isfinite(stamps) & np.r_[True, np.diff(stamps) > 0.0]
        if not unit and is_quantity:
            notes = [*notes, f"{name}: channel {wanted.column} has no unit, {CONTEXT_UNITS.get(name, 'm')} is taken"]
        is_stepwise = kind in "iub" and not _is_quantity(name, unit)
        read = Channel(stamps[finite], values[finite], unit, is_stepwise, tuple(notes))
    if len(read.values) < 2:
        raise wrong(f" has {len(read.values)} values; two are needed")
    return read


def _of_one_name(
    signals: Sequence[Any], groups: Sequence[int], name: str, channel: str, wrong: Callable[[str], FormatError]
) -> list[str]:
    """What to say of channels of one name in several groups; refuse those that contradict each other."""
    known = [signal for signal in signals if len(signal.samples)]
    if len(known) < 2:
        return []
    there = ", ".join(f"{channel}@{group}" for group in groups)
    if all(signal.samples.dtype.kind in "fiub" and signal.samples.ndim == 1 for signal in known):
        first = max(known, key=lambda signal: len(signal.samples))
        spread = max(float(np.std(first.samples.astype(np.float64))), 1e-9)
        for signal in known:
            both = (signal.timestamps >= first.timestamps[0]) & (signal.timestamps <= first.timestamps[-1])
            other = np.interp(signal.timestamps[both], first.timestamps, first.samples.astype(np.float64))
            apart = np.abs(signal.samples[both].astype(np.float64) - other)
            if both.any() and float(np.median(apart)) > MAX_CHANNEL_DISTANCE * spread:
                raise wrong(f" is in several groups, which differ: name one of {there}")
    return [f"{name}: channel {channel} is in several groups ({there}): the one with most samples is taken"]


def _alike(log: Any, wanted: str) -> str:
    names = _names(log)
    by_lower = {name.lower(): name for name in reversed(names)}
    close = [by_lower[lower] for lower in get_close_matches(wanted.lower(), by_lower, n=5, cutoff=0.6)]
    close += [name for name in names if wanted.lower() in name.lower() and name not in close]
    return f"; like it are {', '.join(close[:8])}" if close else f"; the log has {len(names)} others, none alike"


def _is_quantity(name: str, unit: str = "") -> bool:
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
    sides = ("lane_width",) if "lane_width" in signals else POSITIONS[1]
    width = sum(float(np.median(signals[name].values)) for name in sides)
    columns: dict[str, NDArray[Any]] = {}
    for name, channel in signals.items():
        broken = channel.breaks(LANE_JUMP_SHARE * width if name in position and name != "lane_width" else np.inf)
        columns[name] = channel.at(time, broken, is_position=name in position)
    unknown = np.any([np.isnan(columns[name]) for name in position], axis=0)
    if "distance_left" in position:  # one side has jumped, the other not yet
        unknown |= np.abs(columns["distance_left"] + columns["distance_right"] - width) > LANE_JUMP_SHARE * width
    state = np.where(unknown, "gap", KEPT_ROWS)
    if "speed" in columns:
        state = np.where((state == KEPT_ROWS) & np.isnan(columns["speed"]), "no speed", state)
    return pd.DataFrame({"drive": drive, "time": np.round(time - start, 6), **columns, "state": state})
