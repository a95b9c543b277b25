"""`check`: what tables of drives hold, what of it is read and what is guessed, and what can be fitted to it."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import DriverProfileError, FormatError, NotEnoughDataError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.note import Note, rows_left_out, warnings
from xosc_lateral.base.texts import counted
from xosc_lateral.drivers.drives.cleaning import summary_of
from xosc_lateral.drivers.drives.drive import MAX_GAP, Drive, cut_runs
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.files.atomic import write_atomically
from xosc_lateral.files.mapping import MappingLike, as_mapping, mapping_of
from xosc_lateral.files.output_paths import claim, output_file
from xosc_lateral.files.pages.chart import MEASURED
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.files.pages.page import KeyFigure, Page
from xosc_lateral.files.profiles import describe_profile
from xosc_lateral.files.recognised import mapping_text, recognised
from xosc_lateral.files.source import parsed_hashes
from xosc_lateral.files.tables import read_table, tables_at
from xosc_lateral.workflows.opened import opened
from xosc_lateral.workflows.options import Paths, declare_options
from xosc_lateral.workflows.profiles.fit import fit, fit_warnings
from xosc_lateral.workflows.result import GivenDrives, PathLike, Result, given_drives, write_page

BESIDE = ("left_distance", "right_distance")


@declare_options
def check(drives: Paths, *, columns: MappingLike | None = None) -> Health:
    """What tables of drives hold: columns, units, signs, gaps, sensor noise; what can be fitted, and what not.

    Parameters
    ----------
    drives : path or paths
        Tables, as `fit` reads them.
    columns : mapping of str to str, TableMapping, or path, optional
        See `read_drives`. Where the tables can't be read with it, what their headers and values suggest is tried.

    Raises
    ------
    FormatError
        Only where there is no table at all: what is wrong with one is part of the result.
    """
    files = tuple(each for one in opened(drives, "DataFrame") for each in tables_at(one))
    stated = as_mapping(columns)
    seen, left = recognised([read_table(path, stated) for path in files], files[-1])
    proposal = mapping_text(files, stated, seen, left)
    guess = mapping_of(tomllib.loads(proposal), Path("the proposed mapping"))
    mappings = [stated, replace(guess, columns={**guess.columns, **stated.columns}, roles=stated.roles)]
    wrong, read = list[str](), None
    for mapping in mappings if mappings[0] != mappings[1] else mappings[:1]:
        try:
            read = given_drives(list(files), mapping)
            break
        except (FormatError, NotEnoughDataError) as error:
            what = str(error.__cause__ or error)  # which does not advise to look here
            wrong += [what] if what not in wrong else []
    rows = [
        {
            "column": one.name, "in the table": one.header, "unit": stated.columns[one.name].unit or "as it is"
            if one.name in stated.columns else one.unit or "as it is",
            "seen": "by the mapping" if one.name in stated.columns else one.why, **_range(one.numbers),
            "empty [%]": round(100.0 * float(one.values.isna().mean()), 1),
        }
        for one in seen
    ]  # fmt: skip
    profile, why = (None, "") if read is None else _fitted(read)
    return Health(files, tuple(rows), tuple(left), read, bool(wrong) and read is not None, tuple(wrong),
                  proposal, profile, why)  # fmt: skip


def _range(numbers: FloatArray) -> dict[str, float | None]:
    if not len(numbers):
        return {"5 %": None, "median": None, "95 %": None}
    low, middle, high = np.quantile(numbers, (0.05, 0.5, 0.95)).tolist()
    return {"5 %": low, "median": middle, "95 %": high}


def _fitted(read: GivenDrives) -> tuple[DriverProfile | None, str]:
    """A profile of the drives, as far as there is enough of them; else why there is none."""
    try:
        with catch_warnings():
            simplefilter("ignore", UserWarning)
            return fit(read.drives), ""
    except (NotEnoughDataError, DriverProfileError) as error:
        return None, str(error)


@dataclass(frozen=True, eq=False, repr=False)
class Health(Result):
    """What tables of drives hold."""

    files: tuple[Path, ...]
    columns: tuple[Mapping[str, Any], ...]  # those recognised, with unit, where that was seen, and quantiles
    others: tuple[str, ...]  # headers that keep their names
    read: GivenDrives | None  # None: they can't be read as drives
    is_guessed: bool  # whether what is proposed was needed to read them
    wrong: tuple[str, ...]  # why they can't be read as they are
    mapping: str  # TOML that is proposed
    profile: DriverProfile | None  # None: none can be fitted, see `why`
    why: str

    @cached_property
    def drives(self) -> list[dict[str, Any]]:
        """A row for each drive."""
        return [_facts(drive) for drive in (self.read.drives if self.read else [])]

    @property
    def figures(self) -> dict[str, Any]:
        """Numbers of all drives together; empty where they can't be read."""
        if self.read is None:
            return {}
        rows, all_of = self.drives, summary_of(self.read.drives, {})
        return {
            "drives": len(rows), "hours": sum(row["minutes"] for row in rows) / 60.0,
            "road_following_h": sum(row["road-following [min]"] for row in rows) / 60.0,
            "rows": sum(row["rows"] for row in rows), "left_out": dict(self.read.left_out),
            "rate_hz": float(np.median([row["rate [Hz]"] for row in rows])),
            **{name: all_of[name] for name in ("offset_mean_m", "offset_sd_m", "lane_width_m")},
        }  # fmt: skip

    def headline(self) -> str:
        """One line."""
        if self.read is None:
            return f"can't be read as drives: {self.wrong[0]}"
        known = self.figures
        return (
            f"{counted(known['drives'], 'drive')}, {known['road_following_h']:.2f} of {known['hours']:.2f} h "
            f"road-following, {known['rate_hz']:.3g} Hz; {abs(known['offset_mean_m']):.2f} m "
            f"{'left' if known['offset_mean_m'] > 0.0 else 'right'} of the lane's "
            f"centre on average, "
            f"spread {known['offset_sd_m']:.2f} m, lanes {known['lane_width_m']:.2f} m wide"
            + ("; as guessed: a mapping is needed" if self.is_guessed else "")
        )

    def can(self) -> list[str]:
        """What can be fitted to the drives, a line each."""
        if self.profile is None:
            return []
        lines = [f"a profile, {line}" for line in describe_profile(self.profile).splitlines()[1:2]]
        if self.profile.effects:
            lines.append(f"effects of {', '.join(self.profile.columns)}")
        return lines

    @property
    def sensor(self) -> str:
        """What of the offsets is the sensor's, in a line; empty: not known."""
        return "" if self.profile is None or self.profile.sensor is None else self.profile.sensor.in_words()

    def cannot(self) -> list[str]:
        """What can't, and why, a line each."""
        if self.profile is None:
            return [f"a profile: {self.why}"] if self.why else []
        assert self.read is not None
        known, lines = set[str]().union(*(drive.context for drive in self.read.drives)), list[str]()
        if "speed" not in known:
            lines.append("what speed does, and slow driving is not cut out: there is no column `speed`")
        if not set(BESIDE) & known:
            lines.append(f"what vehicles beside do: there is neither {' nor '.join(BESIDE)}")
        if len(self.read.drives) < 2:
            lines.append("how drivers differ: there is one drive")
        return lines

    @property
    def messages(self) -> tuple[Note, ...]:
        """Rows left out, what the drives say against themselves, and what `fit` would."""
        if self.read is None or self.profile is None:
            return () if self.read is None else self.read.messages
        return (*rows_left_out(self.read.left_out), *warnings(fit_warnings(self.profile)))

    def __str__(self) -> str:
        names = [
            f"  {row['column']} = {row['in the table'].removesuffix(in_unit).rstrip()}{in_unit}  {row['seen']}"
            + ("" if row["median"] is None else f"; {row['5 %']:.4g} to {row['95 %']:.4g}") for row in self.columns
            for in_unit in [f" [{row['unit']}]"]
        ]  # fmt: skip
        return "\n".join(
            [
                self.headline(), *(f"wrong: {what}" for what in self.wrong[self.read is None :]), "columns:", *names,
                *([f"  others: {', '.join(self.others)}"] if self.others else []),
                *([self.sensor] if self.sensor else []), *(f"can be fitted: {line}" for line in self.can()),
                *(f"can't be fitted: {line}" for line in self.cannot()), *self.message_lines(),
            ]
        )  # fmt: skip

    def to_frame(self) -> pd.DataFrame:
        """A row for each drive."""
        return pd.DataFrame(self.drives)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""
        return {
            "files": [str(path) for path in self.files], "can_be_read": self.read is not None,
            "guessed": self.is_guessed, "wrong": list(self.wrong), "columns": list(map(dict, self.columns)),
            "others": list(self.others),
            "summary": self.figures, "drives": self.drives, "sensor": self.sensor,
            "can": self.can(), "cannot": self.cannot(), "messages": self.message_records(), "mapping": self.mapping,
        }  # fmt: skip

    def plot(self) -> Figure | None:
        """Offsets of the first drives; None: nothing can be read."""
        return None if self.read is None else traces(self.read.drives)

    def write_report(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the page."""
        drives = self.read.drives if self.read else []
        page = lambda: page_of(self.headline(), self.to_dict(), drives)  # noqa: E731
        return write_page(path, "health.html", page, inputs=self.files, force=force)

    def write_mapping(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the proposed mapping (``.toml``), for a person to correct."""
        output = output_file(path, "mapping.toml", (".toml",))
        claim([output], self.files, force=force)
        return write_atomically(output, self.mapping)


def _facts(drive: Drive) -> dict[str, Any]:
    step = np.diff(drive.time)
    gaps, speed = step[step > MAX_GAP], drive.speed
    following = sum(float(run.time[-1] - run.time[0]) for run in cut_runs(drive))
    return {
        "drive": drive.name, "rows": len(drive), "minutes": float(drive.time[-1] - drive.time[0]) / 60.0,
        "road-following [min]": following / 60.0, "rate [Hz]": 1.0 / float(np.median(step)), "gaps": len(gaps),
        "longest gap [s]": float(gaps.max(initial=0.0)), "mean offset [m]": float(drive.offset.mean()),
        "spread [m]": float(drive.offset.std()), "lane width [m]": float(np.median(drive.lane_width)),
        "speed [km/h]": None if speed is None else 3.6 * float(np.nanmedian(speed)),
    }  # fmt: skip


# ---- the page, finding first ----
BINS = 80
SHOWN_DRIVES, SHOWN_TIME = 4, 300.0  # traces, and how much of each [s]
NAMED_DRIVES = 50  # so many drives have a row of their own


def page_of(headline: str, facts: Mapping[str, Any], drives: Sequence[Drive]) -> str:
    """HTML page, self-contained, of what `check` says and the drives that it read."""
    files = [Path(file) for file in facts["files"]]
    page = Page(f"What is in {files[0].name}" + (f" and {len(files) - 1} more" if len(files) > 1 else ""))
    known = facts["summary"]
    page.lead(f"{headline}.", f"Can be fitted: {'; '.join(facts['can']) or 'nothing yet'}.")
    if known:
        lost = sum(known["left_out"].values())
        page.key_figures(
            [
                KeyFigure(f"{known['road_following_h']:.2f} h", "can be used", f"of {known['hours']:.2f} h recorded"),
                KeyFigure(f"{known['offset_mean_m']:+.2f} m", "mean offset", "positive: left of the lane's centre"),
                KeyFigure(f"{known['offset_sd_m']:.2f} m", "spread of the offset"),
                KeyFigure(f"{100 * lost / (lost + known['rows']):.1f} %", "rows left out"),
            ]
        )
    for what in facts["wrong"]:
        page.warning(f"{what}." + (" With what is guessed below they can be read." if facts["guessed"] else ""))
    if facts["sensor"]:
        page.text(f"{facts['sensor']}.")
    if known:
        page.figure(histograms(drives), "All rows that are read.", "Histograms of offset, lane width and speed")
    cannot = [*facts["cannot"], *(one["what"] for one in facts["messages"] if one["severity"] == "warning")]
    if cannot:
        page.section("What can't be fitted, and what is in doubt")
        page.items(cannot)
    page.section("Columns", "What the headers and values were taken for; signs and units are yours to confirm.")
    page.table(facts["columns"], "Quantiles in the unit of the table.")
    if facts["others"]:
        page.text(f"Others, which are context under their own names: {', '.join(facts['others'])}.")
    if known:
        page.section("Traces")
        page.figure(traces(drives), f"Offsets of the first drives, at most {SHOWN_TIME:g} s of each.")
        page.section("Drives", folded=True)
        rows = (
            sorted(facts["drives"], key=lambda row: -row["minutes"]) if len(drives) > NAMED_DRIVES else facts["drives"]
        )
        shown = f" The longest {NAMED_DRIVES} of {len(rows)}." if len(rows) > NAMED_DRIVES else ""
        page.table(
            rows[:NAMED_DRIVES], f"Gaps are longer than 0.5 s.{shown}",
            formats={"minutes": ".1f", "road-following [min]": ".1f", "mean offset [m]": ".2f", "spread [m]": ".2f"},
        )  # fmt: skip
        if known["left_out"]:
            page.section("Rows left out", folded=True)
            page.table([{"why": why, "rows": count} for why, count in known["left_out"].items()])
    page.section(
        "Mapping",
        "Read every line, correct it, and give the file with `--mapping`; `check` writes it with `--write-mapping`.",
        folded=True,
    )
    page.code(facts["mapping"])
    return page.html({"inputs": parsed_hashes(files)})


def histograms(drives: Sequence[Drive]) -> Figure:
    """Offset, lane width and speed of all rows, as far as they are known."""
    speed = [drive.speed[np.isfinite(drive.speed)] for drive in drives if drive.speed is not None]
    columns = {"offset, positive left [m]": [drive.offset for drive in drives],
               "lane width [m]": [drive.lane_width for drive in drives], "speed [m/s]": speed}  # fmt: skip
    shown = {label: np.concatenate(parts) for label, parts in columns.items() if sum(map(len, parts))}
    figure = Figure(1, len(shown), height=130.0)
    for panel, (label, values) in zip(figure.panels, shown.items(), strict=True):
        panel.steps(*np.histogram(values, BINS, density=True)[::-1], MEASURED)
        panel.x.label = label
    figure.panels[0].y.label = "density"
    return figure


def traces(drives: Sequence[Drive]) -> Figure:
    """Offsets of the first drives as they begin."""
    figure = Figure(max(1, len(drives[:SHOWN_DRIVES])), height=75.0)
    for panel, drive in zip(figure.panels, drives, strict=False):
        rows = slice(int(np.searchsorted(drive.time, drive.time[0] + SHOWN_TIME)))
        panel.level()
        panel.line(drive.time[rows], drive.offset[rows], MEASURED)
        panel.title, panel.x.label, panel.y.label = drive.name, "time [s]", "offset [m]"
    return figure
