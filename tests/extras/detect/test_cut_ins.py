"""Tables of cut-ins: a scenario varied by a maneuver law, a drive for each set, and what detectors make of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import xosc_lateral as xl
from xosc_lateral.cli import main
from xosc_lateral.extras.detect.cut_ins import FACTS, CutIns

COUNT = 4


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return xl.write_template("cut-in", tmp_path_factory.mktemp("cut-ins"))[0]


@pytest.fixture(scope="module")
def found(scenario: Path) -> CutIns:
    return xl.detect(scenario, like="motorway", count=COUNT, replace=True, detectors=["lateral-speed"], seed=3)


def test_each_set_is_a_cut_in_of_its_own(found: CutIns) -> None:
    frame = found.to_frame()
    assert list(frame["set"]) == list(range(COUNT)) and (frame["vehicle"] == "CutIn").all()
    assert frame["end"].nunique() == COUNT and frame["end"].abs().max() < 1.2  # each is driven anew
    drawn = found.variations.durations["lane_change_time"]
    assert np.corrcoef(drawn, frame["duration"])[0, 1] > 0.5  # begin and end are where movement is 0.1 m/s
    assert frame["gap"].between(5.0, 60.0).all() and frame["entry"].between(0.1, 2.0).all()
    assert not frame["seen"].isna().any() and (frame["lead"].isna() == ~frame["seen"]).all()


def test_the_page_begins_with_who_sees_most_and_has_a_row_for_each_cut_in(found: CutIns, tmp_path: Path) -> None:
    """Two detectors of one name have columns of their own; what is seen too late is not seen before the marking."""
    leads = {"lazy (threshold 1)": (-0.3, np.nan), "lazy (threshold 2)": (0.5, -0.2), "keen": (0.8, 0.4)}
    facts = {"vehicle": "CutIn", "duration": 4.0, "gap": 20.0, "entry": 1.0, "end": 0.1, "lane_keeping": 9.0}
    rows = [
        {"set": number, **facts, "detector": name, "seen": lead == lead, "seen_before_marking": lead > 0.0,
         "lead": lead, "false_alarms": int(name == "keen")}
        for number in (0, 1) for name, both in leads.items() for lead in both[number : number + 1]
    ]  # fmt: skip
    page = replace(found, rows=rows).write_report(tmp_path / "page.html").read_text(encoding="utf-8")
    finding = "keen sees 2 of 2 cut-ins before the marking, 0.60 s before it in the median, with 2 false alarms"
    assert f"{finding}; lazy (threshold 1) sees 0." in page
    table = page[page.index("set by set") :]
    assert all(f">{heading}</th>" in table for heading in leads) and table.count("<tr>") == 1 + 2


@pytest.mark.pages
def test_the_same_seed_gives_the_same_table_and_parts_make_the_whole(found: CutIns, scenario: Path) -> None:
    options = {"like": "motorway", "count": COUNT, "replace": True, "detectors": ["lateral-speed"], "seed": 3}
    rows = [row for part in ("1/2", "2/2") for row in xl.detect(scenario, shard=part, **options).rows]
    assert sorted(map(str, rows)) == sorted(map(str, found.rows))


@pytest.mark.pages
def test_files_are_kept_and_are_what_was_counted(scenario: Path, tmp_path: Path, capsys) -> None:
    table, page, kept = tmp_path / "table.csv", tmp_path / "page.html", tmp_path / "kept"
    words = ["--like", "motorway", "--count", "2", "--detector", "lateral-speed", "--keep", str(kept)]
    assert main(["detect", str(scenario), *words, "-o", str(table), "--report", str(page)]) == 0
    printed = capsys.readouterr().out
    assert "2 cut-ins like motorway" in printed and "varied about itself" in printed
    assert len(table.read_text().splitlines()) == 3
    assert all(name in page.read_text() for name in FACTS)
    for number in range(2):
        path = kept / f"cut-in_p{number:05d}_lifelike.xosc"
        assert "xosc-lateral provenance" in path.read_text() and xl.play(path).to_frame()["name"].nunique() > 1


@pytest.mark.pages
def test_a_distribution_has_a_drive_for_each_set(scenario: Path, tmp_path: Path) -> None:
    made = xl.vary(scenario, f"{tmp_path}/varied/", like="motorway", count=2, seed=1)
    xl.convert_many([made.distribution], tmp_path / "out", allow=[tmp_path, scenario.parent])
    starts = [
        xl.play(path).to_frame().query("name == 'CutIn'")["offset_t"].iloc[0]
        for path in sorted((tmp_path / "out").rglob("*_p*.xosc"))
    ]
    assert len(starts) == 2 and abs(starts[0] - starts[1]) > 1e-3


def test_what_cannot_be_varied_is_refused(scenario: Path, tmp_path: Path, capsys) -> None:
    assert main(["detect", str(scenario), "--like", "rural"]) == 1
    assert "holds no maneuvers" in capsys.readouterr().err
    assert main(["detect", str(scenario), str(scenario), "--like", "motorway"]) != 0
    assert "--like varies one scenario" in capsys.readouterr().err
