"""`sample`: offsets alone, from a profile."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from xosc_lateral.base.grouping import grouped
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.note import Note, warnings
from xosc_lateral.drivers.drives.drive import STEP, Drive
from xosc_lateral.files.drives import file_label
from xosc_lateral.files.mapping import MappingLike, TableMapping, as_mapping, plain_header
from xosc_lateral.files.pages.chart import MEASURED, SAMPLED
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.files.tables import context_of_table, read_table
from xosc_lateral.workflows.opened import opened, several
from xosc_lateral.workflows.options import PROFILE, declare_options, flag
from xosc_lateral.workflows.result import (
    DrivesLike,
    GivenDrives,
    Paths,
    ProfileLike,
    Result,
    given_drives,
    given_profile,
    naming,
)

if TYPE_CHECKING:
    from xosc_lateral.drivers.model.profile import DriverProfile
    from xosc_lateral.drivers.model.sampled_offsets import SampledOffsets


@declare_options
def sample(
    profile: Annotated[ProfileLike, PROFILE], *,
    seed: int = 0,
    like: Annotated[DrivesLike | None, flag(kind=list[Path] | None, metavar="TABLE",
        help="For each measured snippet, one with the same start and context.")] = None,
    snippet: Annotated[float, flag(help="Length of a snippet with --like. [s]", min=0.2, max=1e6)] = 10.0,
    context: Annotated[DrivesLike | None, flag(kind=list[Path] | None, metavar="TABLE",
        help="One free run per drive of the table, under its context.")] = None,
    duration: Annotated[float | None, flag(help="One free run of this length. [s]", min=0.2, max=9e6)] = None,
    speed: Annotated[float, flag(help="Speed of the free run. [m/s]", min=0, max=150)] = 30.0,
    lane_width: Annotated[float | None, flag(help="Lane width of the free run [m]; default: the profile's.", min=1,
        max=10)] = None,
    with_sensor: bool = False,
    columns: MappingLike | None = None,
    library: Paths = (),
) -> Offsets:  # fmt: skip
    """Sample offsets; one of `like`, `context` and `duration` says for what.

    Parameters
    ----------
    profile : DriverProfile, path or name
    columns : mapping of str to str, TableMapping, or path, optional
        See `read_drives`.
    with_sensor : bool
        Add what the sensor added to the drives that the profile was fitted on, for tests of a perception chain.
    """
    from xosc_lateral.drivers.model.sampled_offsets import sample_context, sample_free, sample_like

    if sum(choice is not None for choice in (like, context, duration)) != 1:
        raise ValueError("one of like, context and duration is needed")
    driver = given_profile(profile, library)
    if duration is not None:
        made = list(sample_free(driver, duration, seed, speed=speed, lane_width=lane_width, with_sensor=with_sensor))
        settings: dict[str, Any] = {"duration_s": duration, "speed": speed}
        unknown = ", ".join(column for column in driver.columns if column not in {"speed", "lane_width"})
        messages = warnings([f"a free run: {unknown} {LEFT_OUT_NOTE}"] if unknown else [])
        return Offsets(driver, made, seed, None, settings, messages)
    tables = None if context is None else _context_alone(context, driver, lane_width, columns)
    if tables is None:
        tables = given_drives(like if like is not None else context, columns)
    drives = tables.drives
    if like is not None:
        with naming(tables):
            made = list(sample_like(driver, drives, snippet, seed, with_sensor=with_sensor))
    else:
        made = list(sample_context(driver, drives, seed, with_sensor=with_sensor))
    messages = (*tables.messages, *warnings(_unknown_columns(driver, drives)))
    return Offsets(driver, made, seed, tables, {} if like is None else {"snippet_s": snippet}, messages)


def _context_alone(
    context: DrivesLike, profile: DriverProfile, lane_width: float | None, columns: MappingLike | None
) -> GivenDrives | None:
    """Drives in the middle of a lane under tables that hold context over time and no place in a lane, as `convert
    --context` takes them; None: they hold such places.
    """
    if as_mapping(columns) != TableMapping():
        return None
    if any(isinstance(item, Drive) for item in several(context)):
        return None
    files, drives = opened(context, "DataFrame"), list[Drive]()
    for path in files:
        table = read_table(path)
        headers = {plain_header(str(header)) for header in table.columns}
        places = ("offset", "distance_left", "distance_right")
        if any(header.startswith(places) for header in headers) or "drive" in headers:
            return None
        known = context_of_table(table, path)
        first, last = (pick(at[edge] for at, _ in known.values()) for pick, edge in ((min, 0), (max, -1)))
        time = np.arange(first, last + 1e-9, STEP)
        values = {column: np.interp(time, *over_time) for column, over_time in known.items()}
        width = values.setdefault("lane_width", np.full(len(time), lane_width or profile.lane_width))
        drives.append(Drive(file_label(path), time, np.zeros(len(time)), width, values, source=str(path)))
    return GivenDrives.of(drives, files)


LEFT_OUT_NOTE = "not known, left without effect"


def _unknown_columns(profile: DriverProfile, drives: Sequence[Drive]) -> tuple[str, ...]:
    """Columns that the profile's effects read and tables lack, in one line for those that the same drives lack.

    A column that a table has and that is empty all through a drive is known: there is none (no lane to that side).
    """
    lacking = grouped(
        (tuple(d.name for d in drives if column not in {"lane_width", *d.context, *d.empty}), column)
        for column in profile.columns
    )
    return tuple(
        f"{f'drive {names[0]}' if len(names) == 1 else f'{len(names)} of {len(drives)} drives'}: "
        f"{', '.join(columns)} {LEFT_OUT_NOTE}"
        for names, columns in lacking.items()
        if names
    )


@dataclass(frozen=True, eq=False, repr=False)
class Offsets(Result):
    """Sampled offsets."""

    profile: DriverProfile
    _made: Sequence[SampledOffsets]
    seed: int
    _tables: GivenDrives | None
    _settings: dict[str, Any]
    messages: tuple[Note, ...] = ()
    """What a user has to know."""

    def __len__(self) -> int:
        return sum(len(each.time) for each in self._made)

    def headline(self) -> str:
        """One line."""
        runs = "snippets" if "snippet_s" in self._settings else "runs"
        return f"{len(self)} offsets of {self.profile.name}, {len(self._made)} {runs}, seed {self.seed}"

    def __str__(self) -> str:
        return "\n".join([self.headline(), *self.message_lines()])

    def to_frame(self) -> pd.DataFrame:
        """Columns `drive`, `time` [s], `offset`, `lane_width` [m], `speed` [m/s] where known; of snippets also
        `snippet` and `offset_real` [m]. `following_run` counts what is cut apart: the table can be fitted as it is.
        """
        from xosc_lateral.drivers.drives.cleaning import RUN

        lengths = [len(each.time) for each in self._made]
        numbers = np.repeat(np.arange(len(lengths)), lengths)
        columns: dict[str, Any] = {"drive": np.repeat([each.drive for each in self._made], lengths)}
        if "snippet_s" in self._settings:
            columns["snippet"] = np.repeat([each.snippet for each in self._made], lengths)
        for name in ("time", "offset", "offset_real", "lane_width", "speed"):
            values = [getattr(each, name) for each in self._made]
            if values and values[0] is not None:
                columns[name] = np.concatenate(values)
        if np.isnan(columns.get("speed", np.nan)).all():
            columns.pop("speed", None)
        return pd.DataFrame({**columns, RUN: numbers})

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them: what was sampled, without the offsets themselves."""
        return {
            "rows": len(self),
            "runs": len(self._made),
            "warnings": list(self.warnings),
            "messages": self.message_records(),
            "provenance": self._provenance(),
        }

    def plot(self, *, most: int = 6) -> Figure:
        """Offset over time of the first runs; measured ones beside them where there are any."""
        sampled = self._made[:most]
        figure = Figure(max(1, len(sampled)), height=75.0, legend=True)
        for panel, drive in zip(figure.panels, sampled, strict=False):
            if drive.offset_real is not None:
                panel.line(drive.time, drive.offset_real, MEASURED, label="measured")
            panel.line(drive.time, drive.offset, SAMPLED, label="sampled")
            panel.title, panel.x.label, panel.y.label = drive.drive, "time [s]", "offset [m]"
        return figure

    @property
    def usual_table(self) -> str:
        """Called after the profile."""
        return f"{self.profile.name}.csv"

    @property
    def files(self) -> tuple[Path, ...]:
        """Tables that were read."""
        return () if self._tables is None else self._tables.files

    def _provenance(self) -> dict[str, Any]:
        from xosc_lateral.files.profiles import profile_hash

        return {
            "seed": self.seed,
            "profile": self.profile.name,
            "profile_sha256": profile_hash(self.profile),
            "inputs": {} if self._tables is None else dict(self._tables.inputs),
            **self._settings,
        }
