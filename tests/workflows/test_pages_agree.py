"""Pages of `evaluate`, `detect` and batches say what their text and JSON say; conversions and loops have own tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lxml import html

import xosc_lateral as xl
from examples.driver_simulator import simulate_population

TEMPLATES = Path(__file__).resolve().parents[2] / "templates"


def read(page: Path) -> tuple[str, dict[str, str], dict[str, list[list[str]]]]:
    """What the header says, tiles by their label, tables by their caption."""
    tree = html.fromstring(page.read_bytes())
    lead = " ".join(one.text_content() for one in tree.xpath("//header/p"))
    boxes = [[part.text_content() for part in box] for box in tree.xpath("//dl[@class='figures']/div")]
    tables = {
        table.xpath("string(caption)"): [
            [cell.text_content() for cell in line.xpath("td")] for line in table.xpath(".//tbody/tr")
        ]
        for table in tree.xpath("//table")
    }
    return lead, {label: value for label, value, *_ in boxes}, tables


def test_evaluate(tmp_path: Path) -> None:
    drives = simulate_population(3, duration=150.0, seed=2)
    result = xl.evaluate("motorway", drives, classify=False)
    lead, _, tables = read(result.write_report(tmp_path / "page.html"))
    values, text = result.to_dict(), str(result)
    words = values["verdict"]["words"]
    page = html.fromstring((tmp_path / "page.html").read_bytes()).text_content()
    assert words in text and words[1:] in page
    assert any(line.replace("`", "") in lead for line in text.splitlines() if line.startswith("motorway")), (
        "the finding"
    )
    shown: dict[str, float] = {}
    for title, rows in tables.items():
        kind = next((one for one in ("free", "same start") if title.startswith(one)), "")
        for name, *cells in rows if kind else ():
            assert [f"  {title}" in text, *(cell in text for cell in cells)] == [True] * (1 + len(cells))
            for seconds, cell in zip((10.0, 30.0), cells, strict=False):
                shown[f"{title}: {name}, {seconds:g} s"] = float(cell)
                start = "same" if kind == "same start" else "free"
                band = title.partition(", ")[2].partition(" (")[0]
                families = next(
                    one["families"]
                    for one in values["realism"]
                    if (one["seconds"], one["start"], one["band"]) == (seconds, start, band)
                )
                key = {"ten metrics": "metrics", "autocorrelation": "memory"}.get(name, name.replace(" ", "_"))
                assert float(cell) == pytest.approx(families[key]["ratio"], abs=0.0051)
    assert f"{max(shown.values()):.2f} times as far" in lead
    assert max(shown.values()) == pytest.approx(values["worst"]["ratio"], abs=0.0051)
    far = [one for each in values["realism"] for one in each["families"].values() if (one["interval"] or [0])[0] > 1.5]
    assert ("not like them" in words) == bool(far)
    powers = [one for one in values["verdict"]["ratios"] if one["of"] == "recording" and one["high_hz"]]
    other = [one["low_hz"] for one in powers if one["judged"] != "alike"]
    assert not other or values["verdict"]["like_up_to_hz"] <= min(other)


def test_detect(tmp_path: Path) -> None:
    result = xl.detect(TEMPLATES / "cut-in.xosc", ego="none", variants=2, time_limit=25.0)
    lead, _, tables = read(result.write_report(tmp_path / "page.html"))
    shown = next(rows for caption, rows in tables.items() if caption.startswith("At the thresholds"))
    cases = next((rows for caption, rows in tables.items() if caption.startswith("Cut-ins that were")), [])
    rows, text = result.rows(), str(result)
    assert [(line[0], line[1]) for line in shown] == [(one["source"], one["detector"]) for one in rows]
    for line, one in zip(shown, rows, strict=True):
        count = one["false_alarms"] if " in " in line[2] else one["false_alarms_per_hour"]  # in minutes: no rate
        assert float(line[2].split()[0]) == pytest.approx(count, abs=0.051)
        assert one["false_alarms_per_hour"] == pytest.approx(one["false_alarms"] / one["hours"], rel=1e-3)
        assert line[3] == f"{100.0 * one['seen']:.0f} %" and line[4] == f"{100.0 * one['seen_before_marking']:.0f} %"
        assert all(cell in text for cell in line)
    hours = sum({one["source"]: one["hours"] for one in rows}.values())
    assert f"{60.0 * hours:.1f} min of lane keeping" in lead and f"{len({line[1] for line in shown})} detectors" in lead
    late = sum(round(one["cut_ins"] * (1.0 - one["seen_before_marking"])) for one in rows)
    assert len([case for case in cases if case[1] in ("late", "missed")]) <= late
    assert len([case for case in cases if case[1] == "false alarm"]) <= sum(one["false_alarms"] for one in rows)


def test_a_batch(tmp_path: Path) -> None:
    folder = tmp_path / "db"
    for name in ("jam-end", "cut-in"):
        xl.write_template(name, folder)
    (folder / "broken.xosc").write_text((folder / "cut-in.xosc").read_text().replace("cut-in.xodr", "gone.xodr"))
    result = xl.convert_many(
        folder, tmp_path / "out", workers=0, variants=2, mode="trajectory", time_limit=15.0, report=tmp_path / "pages"
    )
    lead, tiles, tables = read(tmp_path / "pages" / "index.html")
    totals, frame = result.totals(), result.to_frame()
    (rows,) = (lines for lines in tables.values() if any(line[0].endswith(".xosc") for line in lines))
    assert len(rows) == len(frame) == 6 and result.failed == (frame["error"] != "").sum() == totals["failed"] == 2
    assert lead.startswith("2 of 6 outputs could not be made, for 1 cause.") and "2 failed" in result.headline()
    assert int(tiles["outputs"]) == (frame["error"] == "").sum() and int(tiles["failed"]) == 2
    warned = sum(bool(len(one)) for one, error in zip(frame["warnings"], frame["error"], strict=True) if not error)
    assert int(tiles["with warnings"]) == warned == totals["with_warnings"]
    for _, one in frame[frame["error"] == ""].iterrows():
        page = (tmp_path / "pages" / one["output"]).with_suffix(".html")
        said, figures, _ = read(page)
        assert f"{len(one['enriched'])} of {one['entities']} entities" in said
        assert float(figures["standard deviation of the offsets"].split()[0]) == pytest.approx(
            one["offset_spread"], abs=0.0051
        )
        if np.isfinite(one["gap_after"] or np.nan):
            assert float(figures["smallest gap"].split()[0]) == pytest.approx(one["gap_after"], abs=0.0051)
