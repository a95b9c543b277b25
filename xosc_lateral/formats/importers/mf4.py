"""ASAM MDF bus logs (.mf4, .mdf, .dat) into the standard drive table, through asammdf (extra `mdf`).

No two cars name their signals alike, so the reader asks for a channel map: ``NAME=CHANNEL[:UNIT]``, such as
``offset=Lane_LatOffset``, ``distance_left=LnMrkLeft_Dist``, ``speed=VehSpd:km/h``. Needed are `offset` and
`lane_width`, or `distance_left` and `distance_right`; every other name becomes a context column.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.errors import FormatError
from xosc_lateral.formats.drives import ColumnSource, parse_map
from xosc_lateral.formats.importers.cuts import KEPT
from xosc_lateral.formats.importers.table import Imported, drop_cut, make_provenance

if TYPE_CHECKING:
    import pandas as pd

FloatArray = NDArray[np.float64]

POSITIONS = (("offset", "lane_width"), ("distance_left", "distance_right"))
LICENCE = "your own recording"

LISTED = 40
"""Channel names in a message, at most."""


def import_mf4(source: Path, channels: Sequence[str], *, step: float = 0.04) -> Imported:
    """Read mapped channels of a bus log at an even step, over the time that all position channels cover.

    Parameters
    ----------
    channels : sequence of str
        Words ``NAME=CHANNEL[:UNIT]``.
    step : float
        Of the table; each channel is interpolated linearly between its own stamps. Messages that stay away for longer
        than a second leave a gap. [s]

    Raises
    ------
    FormatError
        If the map lacks the position, asammdf is not installed, the log can't be read, or a channel is not in it.
    """
    mapping = parse_map(channels)
    if not any(set(pair) <= mapping.keys() for pair in POSITIONS):
        raise FormatError(f"{channels_wanted(source)}; mapped: {', '.join(mapping) or 'nothing'}", path=source)
    table = _table(_read_channels(source, mapping), mapping, source, step)
    record = make_provenance(
        table,
        format="mf4",
        sources=[source],
        version="unknown",
        licence=LICENCE,
        settings={"step": step, "channels": list(channels)},
        step=step,
    )
    return Imported(drop_cut(table, keep_cut=False), record)


def channels_wanted(source: Path) -> str:
    """What the channel map has to name, and the channels that there are to choose from: for who has no map yet.

    Raises
    ------
    FormatError
        When it can't be read as MDF.
    """
    with _opened(source) as log:
        # Every group's time base is a channel as well; names such as CAN1.Speed repeat others with their bus.
        masters = {log.groups[group].channels[index].name for group, index in log.masters_db.items()}
        names = sorted(set(log.channels_db) - masters)
    listed = ", ".join(names[:LISTED]) + (", ..." if len(names) > LISTED else "")
    return (
        "the channel map needs --map offset=CHANNEL[:UNIT] and --map lane_width=CHANNEL[:UNIT], or "
        "--map distance_left=CHANNEL[:UNIT] and --map distance_right=CHANNEL[:UNIT]; "
        f"{source.name} has {len(names)} channels: {listed}"
    )


def _read_channels(source: Path, mapping: dict[str, ColumnSource]) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Stamps and values of every mapped channel, unit applied."""
    with _opened(source) as log:
        return {name: _read_channel(log, name, wanted, source) for name, wanted in mapping.items()}


@contextmanager
def _opened(source: Path) -> Iterator[Any]:
    """The log; `FormatError` when asammdf is not there or can't read it."""
    try:
        from asammdf import MDF
        from asammdf.blocks.utils import MdfException
    except ImportError as error:
        raise FormatError("reading MDF needs asammdf: pip install 'xosc-lateral[mdf]'", path=source) from error
    if not source.is_file():
        raise FileNotFoundError(f"{source}: no such file")
    try:
        with MDF(source) as log:
            yield log
    except MdfException as error:
        raise FormatError(f"not an MDF file that asammdf can read: {error}", path=source) from error


def _read_channel(log: Any, name: str, wanted: ColumnSource, source: Path) -> tuple[FloatArray, FloatArray]:
    places = log.channels_db.get(wanted.column)
    if not places:
        raise FormatError(f"no channel {wanted.column}", path=source, element=name)
    # The same channel may lie in several groups (one per bus): the one with the most samples counts.
    signals = [log.get(group=group, index=index) for group, index in places]
    signal = max(signals, key=lambda one: len(one.samples))
    if signal.samples.dtype.kind not in "fiub":
        raise FormatError(
            f"channel {wanted.column} holds {signal.samples.dtype}, not numbers", path=source, element=name
        )
    values = np.asarray(signal.samples, dtype=np.float64) * wanted.factor
    finite = np.isfinite(values)
    if finite.sum() < 2:
        raise FormatError(
            f"channel {wanted.column} has {int(finite.sum())} values; two are needed", path=source, element=name
        )
    return np.asarray(signal.timestamps, dtype=np.float64)[finite], values[finite]


def _table(
    signals: dict[str, tuple[FloatArray, FloatArray]], mapping: dict[str, ColumnSource], source: Path, step: float
) -> pd.DataFrame:
    import pandas as pd

    position = [name for pair in POSITIONS for name in pair if name in mapping]
    start = max(float(signals[name][0][0]) for name in position)
    end = min(float(signals[name][0][-1]) for name in position)
    if not end > start:
        raise FormatError(f"channels {', '.join(position)} have no time in common", path=source)
    time = np.asarray(start + step * np.arange(int((end - start) / step) + 1), dtype=np.float64)
    columns = {name: np.interp(time, *signals[name]) for name in mapping}
    missing = np.any([_stays_away(time, signals[name][0]) for name in position], axis=0)
    state = np.where(missing, "gap", KEPT)
    return pd.DataFrame({"drive": source.stem, "time": np.round(time - start, 6), **columns, "state": state})


def _stays_away(time: FloatArray, stamps: FloatArray, longest: float = 1.0) -> NDArray[np.bool_]:
    """Instants between two messages that are more than `longest` apart. [s]"""
    after = np.clip(np.searchsorted(stamps, time), 1, len(stamps) - 1)
    return np.asarray(stamps[after] - stamps[after - 1] > longest)
