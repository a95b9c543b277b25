"""The page of `check`: what tables of drives hold, finding first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.files.pages.chart import MEASURED
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.files.pages.page import KeyFigure, Page
from xosc_lateral.files.source import parsed_hashes

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
