"""One channel: what there is to say is the same in Python, in words, in JSON, and for `--strict`, whatever the verb."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import xosc_lateral as xl
from examples.driver_simulator import simulate_drive
from xosc_lateral.base.note import Note
from xosc_lateral.cli import main


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scenario whose road has a lane without a width, and a table with rows that are in no drive."""
    folder = tmp_path_factory.mktemp("messages")
    assert main(["template", "write", "cut-in", "-o", str(folder), "-q"]) == 0
    (road,) = folder.glob("*.xodr")
    text = road.read_text()
    first = text.index("<geometry ")
    road.write_text(text[:first] + '<geometry s="0" x="0" y="0" hdg="0" length="0"><line/></geometry>' + text[first:])
    table = simulate_drive(300.0, seed=3).table
    table.loc[table.index[50:70], "speed"] = float("nan")
    table.loc[table.index[100:104], "time"] = float("nan")
    table.to_csv(folder / "drive.csv", index=False)
    return folder


def said(capsys: pytest.CaptureFixture[str], words: list[str], code: int = 0) -> tuple[dict[str, object], str]:
    """JSON of a command, and its text on both streams."""
    capsys.readouterr()
    assert main([*words, "--json"]) == code
    values = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert main(words) == code
    return values, "".join(capsys.readouterr())


def test_a_note_names_file_line_element_and_run():
    note = Note("is late", "a.xosc", 3, "Event 'brake'", True, "Car1", "ego at 1.2 times its speed")
    assert str(note) == "a.xosc:3: Event 'brake': is late (run: ego at 1.2 times its speed)"
    assert note.to_dict() == {
        "severity": "warning", "what": "is late", "path": "a.xosc", "line": 3, "element": "Event 'brake'",
        "entity": "Car1", "run": "ego at 1.2 times its speed",
    }  # fmt: skip


def test_a_copy_of_what_lies_elsewhere_is_named_as_its_owner_knows_it():
    copy = Note("is late", "/tmp/xosc-lateral-a1b2c3d4/elsewhere/s3/bucket/a.xosc", 3)
    assert str(copy) == "s3://bucket/a.xosc:3: is late"
    assert copy.to_dict()["path"] == "s3://bucket/a.xosc"


@pytest.mark.pages
def test_a_repair_of_the_road_is_told_by_every_verb_that_plays(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    repaired = "geometry of length 0 m left out"
    for words in (
        ["states", "cut-in.xosc", "-o", "states.csv"],
        ["segments", "cut-in.xosc"],
        ["convert", "cut-in.xosc", "-o", "out.xosc", "--force"],
    ):
        values, text = said(capsys, words)
        (one,) = (one for one in values["messages"] if one["what"] == repaired)
        assert (one["severity"], Path(one["path"]).suffix, one["line"] > 0) == ("note", ".xodr", True)
        assert repaired in text
    result = xl.convert("cut-in.xosc", None)
    assert any(repaired in line for line in result.notes)
    assert "geometry of length 0 m left out" in xl.play("cut-in.xosc").page()


@pytest.mark.pages
def test_strict_refuses_exactly_what_is_a_warning(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    verbs = {
        "states": ["states", "cut-in.xosc", "-o", "states.csv"],
        "segments": ["segments", "cut-in.xosc"],
        "view": ["view", "cut-in.xosc", "-o", "view.html", "--no-open"],
        "convert": ["convert", "cut-in.xosc", "-o", "out.xosc", "--force"],
    }
    for limit in ([], ["--time-limit", "3"]):  # the second cuts the run off
        for verb, words in verbs.items():
            warned = bool(xl.play("cut-in.xosc", time_limit=float(limit[1]) if limit else None).warnings)
            assert main([*words, *limit, "--strict", "-q"]) == int(warned), verb
            assert ("time limit" in capsys.readouterr().err) == warned, verb


def test_rows_that_are_left_out_are_told_where_a_table_is_used(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    values, text = said(capsys, ["sample", "-p", "motorway", "--like", "drive.csv", "-o", "offsets.csv"])
    drives = [one["what"] for one in values["messages"] if "rows left out" in one["what"]]
    assert drives and all(line in str(xl.sample("motorway", like="drive.csv")) for line in drives), text
    assert [str(one) for one in xl.evaluate("motorway", "drive.csv", classify=False).messages] == drives


BENT = {
    "the road after its own repair": (".xodr", '<width a="', '<width a="x', "geometry of length 0 m left out"),
    "the scenario after a version": (".xosc", 'entityRef="Ego"', 'entityRef="Nobody"', "version 1.9 is read as 1.3"),
    "the player after a version": (".xosc", 'laneId="-', 'laneId="-9', "version 1.9 is read as 1.3"),
    "the player after a repair of the road": (".xosc", 'laneId="-', 'laneId="-9', "geometry of length 0 m left out"),
    "a setting after a repair of the road": (".xosc", "", "", "geometry of length 0 m left out"),
}
"""Who refuses after what was remarked -> what is bent in which file, and the remark."""


@pytest.mark.parametrize("case", BENT)
def test_a_refusal_carries_what_was_remarked_before_it(case, folder, tmp_path, monkeypatch, capsys):
    ending, whole, broken, remark = BENT[case]
    for path in folder.glob("*.xo*"):
        text = path.read_text().replace('revMajor="1" revMinor="2"', 'revMajor="1" revMinor="9"')
        (tmp_path / path.name).write_text(text.replace(whole, broken, 1) if whole and path.suffix == ending else text)
    monkeypatch.chdir(tmp_path)
    words = [
        "convert",
        "cut-in.xosc",
        "-o",
        "out.xosc",
        "--ego",
        "none",
        *(["--enrich", "Nobody"] if not whole else []),
    ]
    values, text = said(capsys, words, code=1)
    (told,) = (one for one in values["error"]["messages"] if remark in one["what"])
    assert told["severity"] == "note"
    (line,) = text.splitlines()
    refusal, _, remarked = line.partition("; remarked before: ")
    assert values["error"]["message"] in refusal
    count = len(values["error"]["messages"])
    assert values["error"]["messages"][0]["what"] in remarked
    assert (f"and {count - 1} more" in remarked) is (count > 1)
