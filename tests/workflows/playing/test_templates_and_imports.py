"""Templates as a notebook writes them, and drives from other formats: files, names and refusals."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest
from lxml import etree

import xosc_lateral as xl
from xosc_lateral.base.errors import FormatError, XoscLateralError
from xosc_lateral.extras.recordings.importers import import_drives
from xosc_lateral.workflows.playing.templates import list_templates, write_template


# ---- templates -------------------------------------------------------------------------------------------------------
def test_every_template_is_listed_with_settings_that_it_takes(tmp_path: Path) -> None:
    every = list_templates()
    table = every.to_frame()
    assert every.names == tuple(dict.fromkeys(table["template"]))
    for name in every.names:
        written = write_template(name, tmp_path / name)
        assert [path.suffix for path in written] == [".xosc", ".xodr"]
        for path in written:
            assert etree.parse(path).getroot().tag in ("OpenSCENARIO", "OpenDRIVE")


def test_text_table_and_json_tell_the_same_settings() -> None:
    one = list_templates("cut-in")
    table, record = one.to_frame(), json.loads(json.dumps(one.to_dict(), allow_nan=False))["templates"]
    assert [setting["name"] for setting in record[0]["settings"]] == table["name"].tolist()
    for name in table["name"]:
        assert f"  {name} " in str(one)
        assert f"  {name} " not in str(list_templates())
    assert "cut-in" in repr(one)


def test_a_default_that_is_set_changes_nothing_and_another_value_does(tmp_path: Path) -> None:
    table = list_templates("cut-in").to_frame()
    numbers = table[table["unit"] != ""].iloc[0]
    plain, said, other = (
        write_template("cut-in", tmp_path / folder, **settings)[0].read_bytes()
        for folder, settings in (
            ("plain", {}),
            ("said", {numbers["name"]: numbers["default"]}),
            ("other", {numbers["name"]: float(numbers["default"]) * 1.01}),
        )
    )
    assert plain == said != other


def test_a_template_that_was_edited_is_replaced_by_force_only(tmp_path: Path) -> None:
    scenario, _ = write_template("cut-in", tmp_path)
    write_template("cut-in", tmp_path)  # our own, as it was
    scenario.write_text(scenario.read_text().replace("<FileHeader", "<!-- mine --><FileHeader", 1))
    with pytest.raises(FormatError, match="--force"):
        write_template("cut-in", tmp_path)
    write_template("cut-in", tmp_path, force=True)
    assert "mine" not in scenario.read_text()


@pytest.mark.parametrize(
    ("name", "settings", "message"),
    [("cut-out-and-in", {}, "cut-out-and-in"), ("cut-in", {"sped": 3}, "sped"), ("cut-in", {"speed": -1e9}, "speed")],
)
def test_what_is_not_there_or_out_of_range_is_refused_by_name(
    tmp_path: Path, name: str, settings: dict[str, float], message: str
) -> None:
    with pytest.raises(XoscLateralError, match=message):
        write_template(name, tmp_path, **settings)
    assert not list(tmp_path.iterdir())


# ---- other formats ---------------------------------------------------------------------------------------------------
def test_a_format_that_nobody_knows_and_a_source_of_nothing_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="dlr-ht"):
        import_drives("dlr", tmp_path)
    with pytest.raises(ValueError, match="no source"):
        import_drives("dlr-ht", ())


def test_an_import_is_a_frame_a_record_and_a_file_of_the_same_drives(tmp_path: Path) -> None:
    """A plug-in's importer is any function of a path: here the table itself, moved 0.15 m to the left."""
    from xosc_lateral.extras.recordings.importers import as_imported

    source = tmp_path / "rows.csv"
    rows = pd.DataFrame({"time": [0.05 * k for k in range(400)], "offset": 0.15, "lane_width": 3.5, "speed": 30.0})
    rows = rows.assign(drive="a")
    rows.to_csv(source, index=False)
    made = as_imported(rows, "rows", (source,), {})
    path = made.write(tmp_path / "drives.csv")
    read, (drive,) = pd.read_csv(path), xl.read_drives(path)
    assert read["offset"].tolist() == pytest.approx(made.to_frame()["offset"].tolist())
    assert drive.offset.mean() == pytest.approx(0.15)
    assert json.loads(json.dumps(made.to_dict(), default=str))["vehicles"] == 1
    assert "1 vehicles" in repr(made) or "1 vehicle" in repr(made)
    with pytest.raises(FormatError, match="input"):
        made.write(source, force=True)
