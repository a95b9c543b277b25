"""Mistakes that people make lead to the cure in what is said of them."""

from __future__ import annotations

import gzip
import math
import shutil
from pathlib import Path

import pytest

from xosc_lateral.cli import SIBLINGS, VERBS, main


def table(unit: float = 1.0, speed: float = 30.0) -> str:
    """Forty seconds of a swing of 0.2 m in a lane of 3.5 m; `unit`: how many of its distances are a metre."""
    swing = [0.1 * math.sin(0.1 * k) for k in range(200)]
    rows = [f"{0.2 * k:.1f},{unit * (1.75 + x):.4f},{unit * (1.75 - x):.4f},{speed:g}\n" for k, x in enumerate(swing)]
    return "time,distance_left,distance_right,speed\n" + "".join(rows)


MISTAKES = {
    "a road for a scenario": ("convert cut_in.xodr -o a.xosc", "name the scenario that drives on it"),
    "a road to look at": ("view cut_in.xodr", "name the scenario that drives on it"),
    "a table for a profile": ("convert cut-in.xosc -o a.xosc -p drives.csv", "fit TABLE -o PROFILE.json"),
    "a packed table for a profile": ("sample -p drives.csv.gz --duration 9 -o s.csv", "fit TABLE -o PROFILE.json"),
    "a folder for a profile": ("sample -p . --duration 9 -o s.csv", "--library FOLDER"),
    "drives to convert": ("convert drives.csv -o o/", "fit TABLE -o PROFILE.json"),
    "a scenario for a table": ("fit cut-in.xosc -o p.json", "a scenario, for convert"),
    "a profile for a table": ("check mine.json", "-p FILE"),
    "profile and table in each other's place": ("evaluate mine.json -p drives.csv", "drives.csv is a table"),
    "a profile without its option": ("evaluate mine.json drives.csv", "-p PROFILE.json"),
    "a name without its option": ("sample motorway --duration 9 -o s.csv", "named by -p"),
    "a shipped profile as a file": ("profiles show motorway.json", "did you mean 'motorway'?"),
    "a profile to look at": ("view mine.json", "as driver profiles are"),
    "a unit behind a number": ("sample -p motorway --duration 1min -o s.csv", "without its unit"),
    "a detector's name": ("detect cut-in.xosc --detector lateralspeed", "did you mean 'lateral-speed'?"),
    "a scenario's dossier": ("dossier cut-in.xosc -o d.html", "a scenario, for convert"),
    "a dossier of any folder": ("dossier . -o d.html", "convert SCENARIOS -o FOLDER/"),
    "an option before the verb": ("--seed 1 convert cut-in.xosc -o a.xosc", "convert ... --seed"),
    "another tool's verb": ("enrich cut-in.xosc -o a.xosc", "'convert' does that"),
    "Python's name of a verb": ("close_loop drives.csv", "'close-loop'"),
    "Python's name of a batch": ("convert_many .", "'convert SCENARIO... or FOLDER' does that"),
    "a verb of a group": ("list", "'profiles list' does that"),
    "speed that counts backwards": ("fit backwards.csv -o p.json", "speed=COLUMN:-m/s"),
    "speed in km/h": ("fit kmh.csv -o p.json", "speed=COLUMN:km/h"),
    "distances in centimetres": ("fit cm.csv -o p.json", "distance_left=COLUMN:cm distance_right=COLUMN:cm"),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scenario, its road, a profile, drives, and drives in other units."""
    folder = tmp_path_factory.mktemp("mistakes")
    assert main(["template", "write", "cut-in", "-o", str(folder), "-q"]) == 0
    shutil.copy(next(folder.glob("*.xodr")), folder / "cut_in.xodr")
    (folder / "mine.json").write_text("{}")
    (folder / "drives.csv").write_text(table())
    (folder / "drives.csv.gz").write_bytes(gzip.compress(table().encode()))
    (folder / "backwards.csv").write_text(table(speed=-30.0))
    (folder / "kmh.csv").write_text(table(speed=108.0))
    (folder / "cm.csv").write_text(table(unit=100.0))
    return folder


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_leads_to_the_cure(mistake, folder, monkeypatch, capsys):
    words, cure = MISTAKES[mistake]
    monkeypatch.chdir(folder)
    before = set(folder.iterdir())
    capsys.readouterr()
    assert main(words.split()) in (1, 2)
    assert cure in capsys.readouterr().err
    assert set(folder.iterdir()) == before, "nothing is half-written"


def test_what_others_call_a_verb_is_none_and_leads_to_one():
    others = [name for names in SIBLINGS.values() for name in names]
    assert len(set(others)) == len(others) and not set(others) & VERBS.keys()
    assert {words.split()[0] for words in SIBLINGS} <= VERBS.keys()
