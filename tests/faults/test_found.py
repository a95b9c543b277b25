"""What was found once: through the command line, as a user meets it."""

from __future__ import annotations

import errno
import gzip
import json
import os
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from examples.driver_simulator import simulate_drive
from tests.faults.readers import manifest_row
from tests.kit.profiles import simulated_profile
from tests.kit.scenario_files import scenario_text, write_scenario
from xosc_lateral import write_template
from xosc_lateral.base.plugins import shipped_folder
from xosc_lateral.cli import main
from xosc_lateral.drivers.model.stream import OffsetStream
from xosc_lateral.files.output_tables import csv_text
from xosc_lateral.files.profiles import profile_bytes
from xosc_lateral.workflows.batch.batch import STATE_FOLDER
from xosc_lateral.workflows.batch.journal import Journal, folder_lock
from xosc_lateral.workflows.batch.manifest import MANIFEST, read_manifest
from xosc_lateral.world.scenario.distribution import Deterministic, ValueSets
from xosc_lateral.world.scenario.place import Place


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    simulate_drive(60.0, 3).table.to_csv(tmp_path / "drive.csv", index=False)
    return tmp_path / "drive.csv"


@pytest.fixture
def profile(tmp_path: Path) -> Path:
    (tmp_path / "mine.json").write_bytes(profile_bytes(simulated_profile()))
    return tmp_path / "mine.json"


def refused(arguments: list[object], capsys: pytest.CaptureFixture[str]) -> str:
    """The one line that a command is refused with."""
    assert main([str(argument) for argument in arguments]) == 1
    line = capsys.readouterr().err
    assert line.startswith("xosc-lateral: ") and line.count("\n") == 1
    return line


def test_a_profile_that_leaves_the_lane_by_kilometres_is_refused(profile, tmp_path, capsys):
    values = json.loads(profile.read_text())
    text = json.dumps(values)
    damping = re.search(r'"damping": \[([^]]*)\]', text)
    assert damping is not None
    wild = ", ".join(str(1e6 * float(value)) for value in damping[1].split(","))
    profile.write_text(text.replace(damping[1], wild))
    line = refused(["sample", "-p", profile, "--duration", 60, "--seed", 1, "-o", tmp_path / "o.csv"], capsys)
    assert "mine.json" in line and "at most 1.5" in line
    assert not (tmp_path / "o.csv").exists()


@pytest.mark.parametrize("option", ["--profile", "--like", "--context"])
def test_a_device_is_no_input(option, profile, tmp_path, capsys):
    given = ["-p", profile, option, "/dev/zero"] if option != "--profile" else ["-p", "/dev/zero", "--duration", 10]
    line = refused(["sample", *given, "--seed", 1, "-o", tmp_path / "o.csv"], capsys)
    assert "/dev/zero" in line


def test_a_fifo_is_no_input(profile, tmp_path, capsys):
    os.mkfifo(tmp_path / "f.csv")
    line = refused(
        ["sample", "-p", profile, "--like", tmp_path / "f.csv", "--seed", 1, "-o", tmp_path / "o.csv"], capsys
    )
    assert "is a fifo, not a file" in line


def test_a_gzip_bomb_is_refused_before_it_fills_memory(tmp_path, capsys):
    bomb = tmp_path / "bomb.csv.gz"
    bomb.write_bytes(gzip.compress(b"time,offset,lane_width\n" + b"0" * 150_000_000))
    assert "bomb" in refused(["fit", bomb, "-o", tmp_path / "p.json"], capsys)


@pytest.mark.parametrize("link", [os.symlink, os.link], ids=["symbolic link", "hard link"])
def test_no_output_replaces_the_profile_that_it_was_made_with(link, profile, tmp_path, capsys):
    scenario = write_scenario(tmp_path / "s", scenario_text())
    output = tmp_path / "out.xosc"
    link(profile, output)
    before = profile.read_bytes()
    line = refused(["convert", scenario, "-o", output, "--profile", profile, "--force"], capsys)
    assert "is an input" in line
    assert profile.read_bytes() == output.read_bytes() == before


@pytest.mark.parametrize(("column", "value"), [("lane_width", -3), ("lane_width", 500), ("curvature", "inf")])
def test_a_context_that_no_road_has_is_refused(column, value, profile, tmp_path, capsys):
    scenario = write_scenario(tmp_path / "s", scenario_text())
    (tmp_path / "c.csv").write_text(f"time,{column}\n0,0.001\n1,{value}\n")
    line = refused(
        ["convert", scenario, "-o", tmp_path / "o.xosc", "--profile", profile, "--context", tmp_path / "c.csv"], capsys
    )
    assert "c.csv" in line and column in line


def test_a_stream_refuses_a_bad_sample_and_goes_on_as_if_it_had_not_come():
    streams = [OffsetStream(simulated_profile(), 3) for _ in range(2)]
    good = {"speed": 30.0, "lane_width": 3.5}
    for number in range(20):
        if number in (0, 7):
            for bad in ({"speed": 1e9, "lane_width": 3.5}, {"speed": 30.0, "lane_width": float("nan")}):
                with pytest.raises(ValueError, match="context: "):
                    streams[0].step(bad)
        assert streams[0].step(good) == streams[1].step(good)


def test_parameters_that_double_each_other_end_in_a_line(tmp_path, capsys):
    declared = "".join(
        f'<ParameterDeclaration name="p{k}" parameterType="string" value="${{$p{k - 1}+$p{k - 1}}}"/>'
        for k in range(1, 25)
    )
    first = '<ParameterDeclaration name="p0" parameterType="string" value="abcdefgh"/>'
    text = scenario_text(parameters=f"<ParameterDeclarations>{first}{declared}</ParameterDeclarations>")
    line = refused(["segments", write_scenario(tmp_path, text)], capsys)
    assert "characters of a parameter's value" in line


def test_a_maneuver_s_parameter_of_another_that_is_not_declared_is_one_line(tmp_path, capsys):
    declared = '<ParameterDeclaration name="own" parameterType="string" value="${$nobody+1}"/>'
    written = (Path(__file__).parents[1] / "data" / "xosc" / "valid" / "plain.xosc").read_text(encoding="utf-8")
    text, count = re.subn(
        r"(<Maneuver [^>]*>)", rf"\1<ParameterDeclarations>{declared}</ParameterDeclarations>", written
    )
    assert count
    line = refused(["segments", write_scenario(tmp_path, text)], capsys)
    assert "'nobody' is not declared" in line


def test_too_little_data_names_the_file(drive, tmp_path, capsys):
    lines = drive.read_text().splitlines()
    drive.write_text("\n".join(lines[:60]) + "\n")
    assert "drive.csv" in refused(["fit", drive, "-o", tmp_path / "p.json"], capsys)


@pytest.mark.parametrize("cell", [[1.0], {"a": 1.0}, b"\xff"], ids=["list", "record", "bytes"])
def test_a_parquet_column_that_holds_no_numbers_is_left_out_or_named(cell, drive, tmp_path, capsys):
    table = pd.read_csv(drive)
    table.assign(odd=[cell] * len(table)).to_parquet(tmp_path / "d.parquet")
    assert main(["fit", str(tmp_path / "d.parquet"), "-o", str(tmp_path / "p.json")]) == 0
    capsys.readouterr()
    table.assign(time=[cell] * len(table)).to_parquet(tmp_path / "d.parquet")
    assert "'time'" in refused(["fit", tmp_path / "d.parquet", "-o", tmp_path / "p.json"], capsys)


@pytest.mark.parametrize(
    "row", ["[]", '"x"', '{"output": 1}', '{"seed": 1e400}', f'{{"seed": 1{"0" * 30}}}', '{"error": "\\ud800"}']
)
def test_a_journal_with_a_damaged_row_ends_before_it(row, tmp_path):
    whole = json.dumps({"row": manifest_row(1).to_dict(), "seconds": 0.5})
    changed = json.loads(row)
    broken = manifest_row(2).to_dict() | changed if isinstance(changed, dict) else changed
    (tmp_path / "j.jsonl").write_text(f"{whole}\n{json.dumps({'row': broken, 'seconds': 0.5})}\n")
    with Journal(tmp_path, tmp_path / "j.jsonl", print) as journal:
        assert list(journal) == ["1.xosc"]
        journal.finish()
    assert [row.output for row in read_manifest(tmp_path / MANIFEST)] == ["1.xosc"]


def test_a_card_of_an_evaluation_in_other_words_says_so(tmp_path, capsys):
    values = json.loads(profile_bytes(simulated_profile()))
    values["provenance"]["evaluation"] = {"snippets": "good", "held_out": 3}
    (tmp_path / "mine.json").write_text(json.dumps(values))
    assert main(["profiles", "show", str(tmp_path / "mine.json")]) == 0
    assert "not as this package writes it" in capsys.readouterr().out
    text = (tmp_path / "mine.json").read_text().replace('"held_out": 3', '"held_out": 1e400')
    (tmp_path / "mine.json").write_text(text)
    line = refused(["profiles", "show", tmp_path / "mine.json"], capsys)
    assert "mine.json" in line and "1e400" in line


def test_an_effect_of_levels_needs_a_level(tmp_path, capsys):
    values = json.loads((shipped_folder("driver_profiles") / "motorway.json").read_text(encoding="utf-8"))
    number = next(k for k, effect in enumerate(values["effects"]) if effect.get("levels"))
    values["effects"][number]["levels"] = []
    (tmp_path / "mine.json").write_text(json.dumps(values))
    line = refused(["profiles", "show", tmp_path / "mine.json"], capsys)
    assert "mine.json" in line and "0 levels" in line


def test_a_private_in_a_trigger_belongs_to_nobody(tmp_path):
    scenario, _ = write_template("cut-in", tmp_path)
    text = scenario.read_text(encoding="utf-8")
    scenario.write_text(text.replace("<ConditionGroup>", '<ConditionGroup><Private entityRef="Ego"/>', 1))
    assert main(["convert", str(scenario), "-o", str(tmp_path / "out.xosc"), "-q", "--time-limit", "5"]) == 0


def test_a_product_of_many_parts_comes_one_by_one():
    place = Place("x.xosc", 1, "Deterministic")
    single = ValueSets(({"a": "1"},), place)
    many = Deterministic((*[single] * 2000, ValueSets(tuple({"b": str(k)} for k in range(50)), place), single))
    assert [values["b"] for values in many] == [str(k) for k in range(50)]
    both = Deterministic((ValueSets(({"a": "1"}, {"a": "2"}), place), ValueSets(({"b": "1"}, {"b": "2"}), place)))
    assert [(values["a"], values["b"]) for values in both] == [("1", "1"), ("1", "2"), ("2", "1"), ("2", "2")]
    assert list(Deterministic((single, ValueSets((), place)))) == []


def test_the_lock_is_an_event_where_the_log_is_json(tmp_path, capsys):
    write_template("cut-in", tmp_path / "in")
    with folder_lock(tmp_path / "out" / STATE_FOLDER / "lock"):
        assert main(["convert", str(tmp_path / "in"), "-o", str(tmp_path / "out"), "--json", "-v"]) == 1
    event = json.loads(capsys.readouterr().err.splitlines()[-1])
    assert event["event"] == "error" and "another run" in event["error"]["message"]


@pytest.mark.pages
def test_drives_that_are_all_the_same_show_no_difference_between_drivers(drive, tmp_path, capsys):
    twice = tmp_path / "again.csv"
    twice.write_bytes(drive.read_bytes())
    pd.concat([pd.read_csv(drive)] * 4).assign(drive=np.repeat(["a", "b", "c", "d"], len(pd.read_csv(drive)))).to_csv(
        twice
    )
    assert "is one there twice?" in refused(["evaluate", "-p", "motorway", twice], capsys)


@pytest.mark.parametrize(("step", "what"), [(0.1, "steps of 0.2 s"), (1e-9, "steps of 0.2 s"), ("0.2", "model")])
def test_a_profile_with_other_steps_is_refused_by_whoever_reads_it(step, what, profile, tmp_path, capsys):
    values = json.loads(profile.read_text())
    model = values["model"]
    model.get("settings", model)["step"] = step
    profile.write_text(json.dumps(values))
    out = ["--duration", 10, "--seed", 1, "-o", tmp_path / "o.csv"]
    for words in (
        ["sample", "-p", profile, *out],
        ["profiles", "show", profile],
        ["profiles", "add", profile, "--library", tmp_path],
    ):
        assert what in refused(words, capsys)


def test_numbers_that_are_texts_are_no_numbers(profile, tmp_path, capsys):
    text = profile.read_text()
    damping = re.search(r'"damping": \[([^],]*)', text)
    assert damping is not None
    profile.write_text(text.replace(damping[0], f'"damping": ["{damping[1].strip()}"'))
    assert "expected numbers" in refused(["profiles", "show", profile], capsys)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("a = " + "[" * 5000, "nested too deeply"),
        ("a." * 64 + "b = 1", "unknown"),
        ("a." * 65 + "b = 1", "nested too deeply"),
        ("a." * 400_000 + "b = 1", "nested too deeply"),
        ("#" * 999_900 + '\nseparator = ","\ndecimal = ","', "both"),
        ("#" * 1_100_000, "size of a file in TOML: 1.1 MB, at most 1 MB"),
        ("columns = 1" + "0" * 5000, "Exceeds the limit"),
        ('separator = ","\ndecimal = ","', "both"),
        ('[roles]\nspeed = "magic"', "'magic' is none of road"),
    ],
)
def test_a_mapping_that_no_table_is_read_by_is_refused(text, what, drive, tmp_path, capsys):
    (tmp_path / "m.toml").write_text(text)
    line = refused(["import", "table", drive, "--mapping", tmp_path / "m.toml", "-o", tmp_path / "o.csv"], capsys)
    assert what in line and "m.toml" in line


def test_a_name_in_a_file_steers_no_terminal(tmp_path, capsys):
    path = tmp_path / "x\x1b[2Jy\u202e.csv"
    path.write_text("time,offset\n")
    line = refused(["fit", path, "-o", tmp_path / "p.json"], capsys)
    assert line.isprintable() or line[:-1].isprintable()
    assert r"\x1b[2J" in line


def test_a_full_disk_names_the_output(tmp_path, capsys, monkeypatch):
    def full(self, target):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    write_template("cut-in", tmp_path)
    monkeypatch.setattr(Path, "replace", full)
    line = refused(["states", tmp_path / "cut-in.xosc", "-o", tmp_path / "states.csv"], capsys)
    assert line == f"xosc-lateral: {tmp_path}/states.csv: no space left on device\n"


@pytest.mark.parametrize(
    ("before", "after", "what"),
    [
        ('<Center x="', '<Center x="" x2="', "x='' is not a number"),
        ("</Entities>", '<EntitySelection name="Ego"><Members/></EntitySelection></Entities>', "called 'Ego'"),
        ('north="', 'north="inf" n2="', "north='inf' is not finite"),
    ],
)
def test_what_no_scenario_says_is_refused(before, after, what, tmp_path, capsys):
    write_template("cut-in", tmp_path)
    for path in (tmp_path / "cut-in.xosc", *tmp_path.rglob("*.xodr")):
        path.write_text(path.read_text().replace(before, after))
    assert what in refused(["states", tmp_path / "cut-in.xosc", "-o", tmp_path / "states.csv"], capsys)


def test_a_header_cell_is_no_formula():
    assert csv_text(pd.DataFrame({"=HYPERLINK(1)": ["=1"]})) == "'=HYPERLINK(1)\n'=1\n"
