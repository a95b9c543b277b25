"""Mistakes that people make lead to the cure in what is said of them."""

from __future__ import annotations

import gzip
import math
import re
import shutil
from pathlib import Path

import pytest

from xosc_lateral.cli import VERBS, main
from xosc_lateral.cli.cures import SIBLINGS


def table(unit: float = 1.0, speed: float = 30.0) -> str:
    """Forty seconds of a swing of 0.2 m in a lane of 3.5 m; `unit`: how many of its distances are a metre."""
    swing = [0.1 * math.sin(0.1 * k) for k in range(200)]
    rows = [f"{0.2 * k:.1f},{unit * (1.75 + x):.4f},{unit * (1.75 - x):.4f},{speed:g}\n" for k, x in enumerate(swing)]
    return "time,distance_left,distance_right,speed\n" + "".join(rows)


# What was typed -> what is said of it that leads to the cure.
MISTAKES = {
    # another kind of file than the verb takes
    "convert cut_in.xodr -o a.xosc": "name the scenario that drives on it",
    "convert road.xosc -o a.xosc": "name the scenario that drives on it",
    "view cut_in.xodr": "name the scenario that drives on it",
    "segments cut_in.xodr": "name the scenario that drives on it",
    "convert cut-in.xosc -o a.xosc -p drives.csv": "fit TABLE -o PROFILE.json",
    "sample -p drives.csv.gz --duration 9 -o s.csv": "fit TABLE -o PROFILE.json",
    "vary cut-in.xosc -o v/ --like drives.csv --count 3": "fit TABLE -o PROFILE.json",
    "view drives.csv": "fit TABLE -o PROFILE.json",
    "convert drives.csv -o o/": "fit TABLE -o PROFILE.json",
    "convert cut-in.xosc drives.csv -o o/": "fit TABLE -o PROFILE.json",
    "evaluate mine.json -p drives.csv": "drives.csv is a table",
    "fit cut-in.xosc -o p.json": "a scenario, for convert",
    "check cut-in.xosc": "a scenario, for convert",
    "evaluate cut-in.xosc -p motorway": "a scenario, for convert",
    "sample -p motorway --like cut-in.xosc -o s.csv": "a scenario, for convert",
    "reconstruct cut-in.xosc -o r.xosc": "a scenario, for convert",
    "dossier cut-in.xosc -o d.html": "a scenario, for convert",
    "convert cut-in.xosc -o a.xosc --road cut-in.xosc": "a scenario, for convert",
    "check mine.json": "-p FILE",
    "view mine.json": "as driver profiles are",
    "segments mine.json": "as driver profiles are",
    "fit drives.xlsx -o p.json": "save its sheet as CSV",
    "fit drives.txt -o p.json": "call it NAME.csv",
    "fit log.mf4 -o p.json": "import FORMAT",
    "fit report.html -o p.json": "open it in a browser",
    "reconstruct drives.csv -o r.xosc": "--map vehicle=COLUMN",
    # what is not there, or is a folder
    "convert nowhere.xosc -o a.xosc": "nowhere.xosc: no such file or folder",
    "convert cut_in.xosc -o a.xosc": "did you mean 'cut-in.xosc'?",
    "view cut_in.xosc": "did you mean 'cut-in.xosc'?",
    "check drive.csv": "did you mean 'drives.csv'?",
    "detect cut_in.xosc": "did you mean 'cut-in.xosc'?",
    "convert no_road.xosc -o a.xosc": "did you mean 'cut-in.xodr'?",
    "convert cut-in.xosc -o a.xosc --road cut-im.xodr": "did you mean 'cut-in.xodr'?",
    "convert cut-in.xosc -o a.xosc --library nowhere": "--library: nowhere: no such folder",
    "profiles show motorway.json": "did you mean 'motorway'?",
    "profiles show mine": "did you mean 'mine.json'?",
    "convert cut-in.xosc -o a.xosc -p motorwy": "did you mean 'motorway'?",
    "close-loop drives.csv -p motorwy -o r.json --report l": "did you mean 'motorway'?",
    "sample -p . --duration 9 -o s.csv": "--library FOLDER",
    "dossier . -o d.html": "convert SCENARIOS -o FOLDER/",
    "verify empty": "name its files",
    "fit empty -o p.json": "holds no table (.csv",
    "segments folder": "it holds one.xosc",
    "view folder": "it holds one.xosc",
    "reproduce cut-in.xosc -o b.xosc": "as outputs of convert have",
    "verify cut-in.xosc": "not ours",
    # outputs
    "convert cut-in.xosc -o a.xodr": "a name ending in .xosc",
    "convert cut-in.xosc -o cut-in.xosc --force": "choose another output",
    "fit drives.csv -o p.csv": "a name ending in .json",
    "states cut-in.xosc -o s.xosc": ".csv or .csv.gz or .parquet",
    "sample -p motorway --duration 9 -o s.txt": ".csv or .csv.gz or .parquet",
    "convert cut-in.xosc -o a.xosc --report out": ".html or .htm",
    "evaluate drives.csv -p motorway --report out": ".html or .htm",
    "convert cut-in.xosc lifelike.xosc": "-o names the output",
    "fit drives.csv mine.json": "fit drives.csv.gz -o mine.json",
    "fit drives.csv": "Profile to write",
    "export fmu": "--output",
    "close-loop drives.csv -o r.json": "both are needed",
    # what an option takes
    "convert cut-in.xosc -o a.xosc --seed -1": "x>=0",
    "convert cut-in.xosc -o a.xosc --seed abc": "not a valid int",
    "convert cut-in.xosc -o a.xosc --variants 0": "x>=1",
    "convert cut-in.xosc -o a.xosc --jobs 0": "-1 for one per core",
    "convert cut-in.xosc -o a.xosc --player gazebo": "esmini, carla",
    "convert cut-in.xosc -o a.xosc --version 2.0": "1.0, 1.1, 1.2, 1.3, 1.4 can",
    "convert cut-in.xosc -o a.xosc --entity Truck:motorway": "Truck:motorway",
    "convert cut-in.xosc -o a.xosc --enrich cutin": "did you mean 'CutIn'?",
    "convert cut-in.xosc -o a.xosc --ego Egoo": "did you mean 'Ego'?",
    "convert cut-in.xosc -o a.xosc --set speed=28": "declared: deceleration, ego_speed",
    "convert cut-in.xosc -o a.xosc --report": "requires an argument",
    "convert bad_lane.xosc -o a.xosc": "(lanes: 1, -1, -2, -3, -4)",
    "convert cut-in.xosc -o a.xosc --time-limit 20s": "Cut runs off here [s]",
    "sample -p motorway --duration 1min -o s.csv": "length. [s]",
    "sample -p motorway --duration -5 -o s.csv": "length. [s]",
    "sample -p motorway --duration 9 --speed 100km/h -o s.csv": "[m/s]",
    "sample -p motorway --duration 9 --speed 360 -o s.csv": "[m/s]",
    "sample -p motorway -o s.csv": "one of --like, --context, --duration",
    "template write cut-in -o t --set ego_speed=100km/h": "15 to 45 m/s",
    "template write cut-in -o t --set ego_speed=130": "15 to 45 m/s",
    "template write cut-in -o t --set egospeed=28": "did you mean 'ego_speed'?",
    "template write cutin -o t": "did you mean 'cut-in'?",
    "template write -o t": "`template list` names them",
    "detect cut-in.xosc --detector lateralspeed": "did you mean 'lateral-speed'?",
    "detect cut-in.xosc --detector lateral-speed:thresh=0.1": "threshold=VALUE, hold=VALUE",
    "detect cut-in.xosc --sensor noise=5cm": "its unit left out",
    "vary cut-in.xosc -o v.xosc --count 3": "Profile with maneuvers",
    "profiles compare motorway": "at least two profiles",
    "profiles show": "profiles show",
    "fit drives.csv -o p.json --model neural": "known are two-level, autoregressive",
    "fit drives.csv -o p.json --map speed": "expected NAME=VALUE",
    "fit drives.csv -o p.json --map v_kmh=speed": "speed=v_kmh",
    "fit drives.csv -o p.json --map speed=v_kmhh:km/h": "no column 'v_kmhh'",
    "fit drives.csv -o p.json --map speed=speed:kmp": "unknown unit 'kmp'",
    "convert cut-in.xosc -o a.xosc --profiles motorway": "--profile",
    "convert cut-in.xosc --out a.xosc": "--output",
    "convert cut-in.xosc -o a.xosc --time_limit 20": "--time-limit",
    # where words stand, and what verbs are called
    "evaluate mine.json drives.csv": "evaluate drives.csv.gz -p",
    "sample motorway --duration 9 -o s.csv": "sample -p motorway",
    "--seed 1 convert cut-in.xosc -o a.xosc": "convert ... --seed",
    "enrich cut-in.xosc -o a.xosc": "'convert' does that",
    "list": "'profiles list' does that",
    "help": "'-h' does that",
    "version": "'--version' does that",
    "conver cut-in.xosc -o a.xosc": "Did you mean 'convert'?",
    "profiles motorway": "has list, show, compare",
    "template cut-in -o t": "has list, write",
    "import drives.csv -o o": "dlr-ht",
    "live cut-in.xosc": "esmini, sumo, stdio",
    "export motorway": "fmu",
    "cut-in.xosc": "a scenario, for convert",
    "drives.csv": "fit TABLE -o PROFILE.json",
    # Python's words
    "close_loop drives.csv": "'close-loop'",
    "convert_many .": "'convert SCENARIO... or FOLDER' does that",
    "read_drives drives.csv": "'import' does that",
    "convert cut-in.xosc -o a.xosc seed=1": "--seed 1",
    "convert cut-in.xosc output=a.xosc": "--output a.xosc",
    "convert cut-in.xosc -o a.xosc --set a=1 b=2": "'b=2' stands alone",
    "convert cut-in.xosc -o a.xosc --ego None": "leave an option out",
    "convert cut-in.xosc -o a.xosc --seed=None": "leave an option out",
    "convert cut-in.xosc -o a.xosc --strict=True": "a switch has no value",
    # units and signs of tables
    "fit backwards.csv -o p.json": "speed=COLUMN:-m/s",
    "fit kmh.csv -o p.json": "speed=COLUMN:km/h",
    "fit cm.csv -o p.json": "distance_left=COLUMN:cm distance_right=COLUMN:cm",
    "fit ft.csv -o p.json": "distance_left=COLUMN:ft distance_right=COLUMN:ft",
    "fit right.csv -o p.json": "distance_right=COLUMN:-m",
    "fit ms.csv -o p.json": "time=COLUMN:ms",
    "fit short.csv -o p.json": "no run of 10 s",
    "fit head.csv -o p.json": "10 s of driving are needed",
    "fit nowhere_in_a_lane.csv -o p.json": "needs distance_left and distance_right",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scenario, its road, a profile, drives, and what is wrong with each that is called after it."""
    folder = tmp_path_factory.mktemp("mistakes")
    assert main(["template", "write", "cut-in", "-o", str(folder), "-q"]) == 0
    scenario = (folder / "cut-in.xosc").read_text()
    for name in ("cut_in.xodr", "road.xosc"):
        shutil.copy(folder / "cut-in.xodr", folder / name)
    rows, header = table().splitlines(keepends=True), "time,distance_left,distance_right,speed\n"
    files = {
        "mine.json": "{}", "folder/one.xosc": scenario, "empty/x": "",
        "no_road.xosc": scenario.replace("cut-in.xodr", "cut-im.xodr"),
        "bad_lane.xosc": re.sub(r'laneId="[^"]*"', 'laneId="-7"', scenario, count=1),
        "drives.csv": table(), "drives.txt": table(), "drives.xlsx": "PK", "log.mf4": "MDF", "report.html": "<p>",
        "backwards.csv": table(speed=-30.0), "kmh.csv": table(speed=108.0),
        "cm.csv": table(unit=100.0), "ft.csv": table(unit=1.0 / 0.3048),
        "right.csv": header + "".join(f"{0.2 * k:.1f},1.7,-1.8,30\n" for k in range(200)),
        "ms.csv": header + "".join(f"{200 * k},{1.7 + 1e-3 * k},1.8,30\n" for k in range(200)),
        "short.csv": "".join(rows[:20]), "head.csv": header,
        "nowhere_in_a_lane.csv": "time,speed\n0,30\n0.2,30\n",
    }  # fmt: skip
    for name, text in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    (folder / "drives.csv.gz").write_bytes(gzip.compress(table().encode()))
    return folder


@pytest.mark.parametrize("words", MISTAKES)
def test_a_mistake_leads_to_the_cure(words, folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    monkeypatch.setattr("sys.argv", ["xosc-lateral"])
    before = set(folder.iterdir())
    capsys.readouterr()
    assert main(words.split()) in (1, 2)
    said = capsys.readouterr()
    assert MISTAKES[words] in " ".join((said.err + said.out).split())
    assert set(folder.iterdir()) == before, "nothing is half-written"


def test_what_others_call_a_verb_is_none_and_leads_to_one():
    others = [name for names in SIBLINGS.values() for name in names]
    assert len(set(others)) == len(others) and not set(others) & VERBS.keys()
    assert {words.split()[0] for words in SIBLINGS if words[0] != "-"} <= VERBS.keys()
