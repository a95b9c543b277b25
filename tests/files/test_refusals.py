"""Words of refusals: what is wrong with a file, where, and nothing of the libraries that found out."""

from __future__ import annotations

import unicodedata
from pathlib import Path

import pandas as pd
import pytest

import xosc_lateral as xl
from tests.kit.jam import ROAD, jam
from xosc_lateral.base.errors import FormatError, XoscLateralError
from xosc_lateral.cli import main
from xosc_lateral.files.tables import foreign_errors, read_table
from xosc_lateral.workflows.profiles.profiles import add_profile

HEAD = "time,offset,lane_width,speed\n"
FCD = '<fcd-export><timestep time="0"><vehicle id="a" x="1" y="1" angle="90" speed="1"/></timestep></fcd-export>'


@pytest.mark.parametrize(
    ("words", "name", "text", "said"),
    [
        ("fit", "a.csv", HEAD + "0,0.1,3.5,30\n0.1,0.1,3.5,30,9,9\n", "line 3 has 6 cells, the head has 4"),
        ("fit", "a.csv", HEAD + '0,0.1,3.5,30\n0.1,"0.1,3.5,30\n', "a quotation mark in line 3 is not closed"),
        ("fit", "a.csv", HEAD + "32.13.2026 10:00:00,0.1,3.5,30\n" * 9, "is neither a number nor a time"),
        ("import commonroad", "a.xml", FCD, "not a CommonRoad scenario: its root element is 'fcd-export'"),
        ("import commonroad", "a.xml", "", "not a CommonRoad scenario: it is no XML"),
        ("import fcd", "a.xml", "<net/>", "no FCD output of SUMO: its root element is 'net'"),
        ("reconstruct", "a.xml", FCD, "--road FILE.net.xml"),
        ("reconstruct", "a.xml", "<net/>", "its root element is 'net'"),
    ],
)
def test_a_refusal_names_the_file_and_the_cause(tmp_path, capsys, words, name, text, said):
    (tmp_path / name).write_text(text)
    output = tmp_path / ("out.csv" if words.startswith("import") else "out.json")
    assert main([*words.split(), str(tmp_path / name), "-o", str(output)]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and f"{tmp_path / name}:" in error and said in error
    assert not any(word in error for word in ("tokeniz", "C error", "pandas", "commonroad-io"))
    assert not output.exists()


@pytest.mark.parametrize("error", [IndexError("index -1"), KeyError("x"), ZeroDivisionError("by zero")])
def test_an_error_of_the_program_is_told_as_one_of_the_file(tmp_path, error):
    what = "can't be read: it is empty, damaged, or laid out otherwise"
    with pytest.raises(FormatError, match=what), foreign_errors(tmp_path / "a.bin", "can't be read"):
        raise error


def test_levelx_tables_without_rows_are_refused(tmp_path):
    for name, head in (("tracks", "frame,id,x,y"), ("tracksMeta", "id,class"), ("recordingMeta", "frameRate")):
        (tmp_path / f"01_{name}.csv").write_text(f"{head}\n")
    for call in (lambda path: xl.import_drives("levelx", path), xl.reconstruct):
        with pytest.raises(XoscLateralError, match=r"01_tracks\.csv: has no rows"):
            call(tmp_path / "01_tracks.csv")


@pytest.mark.parametrize(("one", "other"), [("NFC", "NFD"), ("NFD", "NFC")])
def test_accents_count_alike_however_they_are_written(tmp_path, one, other):
    """A Mac writes an umlaut as two characters, most keyboards as one."""
    here, there = (unicodedata.normalize(form, "Größe") for form in (one, other))
    pd.DataFrame({"time": [0.0, 0.1], here: [1.0, 2.0]}).to_csv(tmp_path / "a.csv", index=False)
    pd.DataFrame({"time": [0.0, 0.1], here: [1.0, 2.0]}).to_parquet(tmp_path / "a.parquet")
    composed = unicodedata.normalize("NFC", "Größe")
    assert [list(read_table(tmp_path / f"a.{kind}").columns) for kind in ("csv", "parquet")] == [["time", composed]] * 2
    (tmp_path / "road.xodr").write_text(ROAD)
    table, _ = jam(1, 0.0, vehicles=2, lasting=20.0)
    table = table.replace({"id": {"j0": here}}).rename(columns={"x": f"{here} x"})
    table.to_csv(tmp_path / "jam.csv", index=False)
    (tmp_path / "map.toml").write_text(f'[columns]\nx = "{there} x"\n', encoding="utf-8")
    for columns in (Path(tmp_path / "map.toml"), {"x": f"{there} x"}):
        made = xl.reconstruct(tmp_path / "jam.csv", road=tmp_path / "road.xodr", columns=columns, host=there)
        assert made.to_frame()["recorded_as"].tolist() == [composed, "j1"]
        assert made.to_dict()["host"] == made.to_frame()["entity"][0]
    add_profile("motorway-vehicle-1", tmp_path / "lib", name=here)
    assert xl.read_profile(there, tmp_path / "lib").name == here
