"""A team's library: forty profiles, three broken files, every verb."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import xosc_lateral as xl
from xosc_lateral.base.plugins import shipped_folder
from xosc_lateral.cli import main
from xosc_lateral.workflows.profiles.profiles import add_profile

BASES = ("motorway", "motorway-vehicle-1", "rural")


@pytest.fixture(scope="module")
def team(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("team")
    for number in range(40):
        base = BASES[number % len(BASES)]
        country = "FR" if number % 10 == 0 else "DE"
        metadata = {"driver": f"d{number:02d}", "country": country, "version": "3"}
        add_profile(base, folder, name=f"driver-{number:02d}", tags=["night"] if number < 5 else [], metadata=metadata)
    (folder / "half.json").write_text((folder / "driver-00.json").read_text()[:200])
    (folder / "settings.json").write_text('{"editor": "not ours"}')
    newer = json.loads((folder / "driver-01.json").read_text()) | {"version": 99}
    (folder / "newer.json").write_text(json.dumps(newer))
    return folder


def run(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    code = main([str(word) for word in words])
    said = capsys.readouterr()
    return code, said.out, said.err


def test_a_listing_survives_broken_files(team, capsys):
    code, out, _ = run(capsys, "profiles", "list", "--library", team)
    assert code == 0
    broken = [line for line in out.splitlines() if line.startswith("!")]
    assert len(broken) == 3
    assert [next(name for name in ("half", "newer", "settings") if name in line) for line in broken] == [
        "half",
        "newer",
        "settings",
    ]
    assert "update the package" in broken[1]
    assert len(out.splitlines()) == 40 + 3 + len(xl.list_profiles())


@pytest.mark.parametrize(
    ("options", "count"),
    [
        (["--where", "country=fr"], 4),
        (["--tag", "night"], 5),
        (["--tag", "night", "--where", "country=FR"], 1),
        (["--where", "driver=d07"], 1),
        (["--where", "driver=nobody"], 0),
    ],
    ids=["country", "tag", "both", "driver", "nobody"],
)
def test_profiles_are_found_by_tag_and_metadata(team, capsys, options, count):
    code, out, _ = run(capsys, "profiles", "list", "--library", team, "--json", *options)
    assert code == 0
    assert len(json.loads(out)["profiles"]) == count


def test_an_unknown_field_is_refused_by_name(team, capsys):
    code, _, err = run(capsys, "profiles", "list", "--library", team, "--where", "colour=red")
    assert code == 1 and "colour" in err and "country" in err
    code, _, err = run(capsys, "profiles", "tag", "driver-02", "--library", team, "--set", "colour=red")
    assert code == 1 and "colour" in err


def test_check_names_what_is_broken(team, capsys):
    code, out, _ = run(capsys, "profiles", "check", "--library", team, "--json")
    assert code == 1
    assert {Path(one["path"]).stem for one in json.loads(out)["problems"]} == {"half", "settings", "newer"}
    assert run(capsys, "profiles", "check")[0] == 0


def test_a_profile_goes_by_its_id_everywhere(team, capsys):
    shown = json.loads(run(capsys, "profiles", "show", "driver-07", "--library", team, "--json")[1])
    listed = json.loads(run(capsys, "profiles", "list", "--library", team, "--where", "id=driver-07", "--json")[1])
    (entry,) = listed["profiles"]
    stored = json.loads((team / "driver-07.json").read_text())
    assert shown["id"] == entry["id"] == stored["id"] == Path(entry["path"]).stem == "driver-07"
    assert shown["metadata"]["driver"] == entry["metadata"]["driver"] == stored["metadata"]["driver"] == "d07"


def test_tags_and_metadata_change_in_the_file(team, capsys):
    words = ["--tag", "rain", "--remove", "population", "--set", "vehicle=bus"]
    assert run(capsys, "profiles", "tag", "driver-20", "--library", team, *words)[0] == 0
    metadata = xl.read_profile("driver-20", team).metadata
    assert "rain" in metadata.tags and "population" not in metadata.tags
    assert (metadata.vehicle, metadata.driver) == ("bus", "d20")
    code, _, err = run(capsys, "profiles", "tag", "motorway", "--tag", "mine")
    assert code == 1 and "comes with the package" in err


def test_a_name_that_hides_a_shipped_one_is_said(tmp_path, capsys):
    add_profile("motorway-vehicle-1", tmp_path, name="motorway")
    code, out, _ = run(capsys, "profiles", "list", "--library", tmp_path)
    assert code == 0
    assert "motorway.json hides the shipped profile 'motorway'" in out


def test_a_folder_that_is_named_twice_counts_once(team, capsys, monkeypatch):
    monkeypatch.setenv("XOSC_LATERAL_LIBRARY", str(team))
    monkeypatch.chdir(team.parent)
    once, twice = (
        run(capsys, "profiles", "list", "--json", *words)[1] for words in ([], ["--library", f"./{team.name}/"])
    )
    assert [entry["id"] for entry in json.loads(once)["profiles"]] == [
        entry["id"] for entry in json.loads(twice)["profiles"]
    ]
    assert not [entry for entry in json.loads(twice)["profiles"] if entry["hidden_by"]]


def test_adding_does_not_replace_and_export_writes_what_was_there(team, tmp_path, capsys):
    code, _, err = run(capsys, "profiles", "add", "motorway", "--library", team, "--name", "driver-03")
    assert code == 1 and "there is a profile of this id" in err
    code, _, _ = run(capsys, "profiles", "export", "driver-03", "driver-04", "--library", team, "-o", f"{tmp_path}/")
    assert code == 0
    assert (tmp_path / "driver-03.json").read_bytes() == (team / "driver-03.json").read_bytes()


@pytest.mark.pages
def test_comparing_shows_which_are_alike(team, tmp_path, capsys):
    for name, figure in (("left", ["--mean", 0.6]), ("wide", ["--sdlp", 0.45])):
        assert run(capsys, "profiles", "derive", "motorway", "-o", tmp_path / f"{name}.json", *figure)[0] == 0
    # the first two are the same driver under two names
    names = ["driver-00", "driver-03", tmp_path / "left.json", tmp_path / "wide.json"]
    page = tmp_path / "compared.html"
    code, out, _ = run(capsys, "profiles", "compare", *names, "--library", team, "--json", "--report", page)
    assert code == 0
    compared = json.loads(out)
    (alike,) = [group for group in compared["alike"] if len(group) > 1]
    assert set(alike) == {"driver-00", "driver-03"}
    distance, floor = np.array(compared["distance"]), np.array(compared["floors"])
    assert np.diag(floor) == pytest.approx(np.diag(distance), abs=1e-4)
    assert floor[0, 2] == pytest.approx(np.sqrt(0.5 * (floor[0, 0] ** 2 + floor[2, 2] ** 2)), abs=2e-4)
    different = distance > floor
    assert different[2:, :2].all() and not different[0, 1], "each profile by its own floor, not by the shakiest one's"
    assert "driver-03" in page.read_text(encoding="utf-8")


def test_folders_come_from_the_environment_and_a_configuration_file(team, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XOSC_LATERAL_LIBRARY", str(team))
    assert xl.read_profile("driver-11").metadata.driver == "d11"
    monkeypatch.delenv("XOSC_LATERAL_LIBRARY")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    settings = tmp_path / "xosc-lateral" / "config.toml"
    settings.parent.mkdir()
    settings.write_text(f'library = ["{team.as_posix()}"]\n')
    assert xl.read_profile("driver-11").metadata.driver == "d11"
    settings.write_text('libary = ["x"]\n')
    code, _, err = run(capsys, "profiles", "list")
    assert code == 1 and "unknown key 'libary'" in err


def test_an_unknown_field_in_a_profile_is_refused_by_its_name(team, tmp_path):
    values = json.loads((team / "driver-00.json").read_text())
    (tmp_path / "odd.json").write_text(json.dumps(values | {"colour": "red"}))
    with pytest.raises(xl.FormatError, match="colour"):
        xl.read_profile(tmp_path / "odd.json")


@pytest.fixture
def own(team: Path, tmp_path: Path) -> Path:
    """A copy that may be changed."""
    return Path(shutil.copytree(team, tmp_path / "own"))


def test_a_profile_gets_another_id_in_its_file_and_as_its_name(own, capsys):
    assert run(capsys, "profiles", "rename", "driver-09", "calm", "--library", own)[0] == 0
    assert not (own / "driver-09.json").exists()
    assert xl.read_profile("calm", own).name == "calm"
    assert xl.read_profile("calm", own).metadata.driver == "d09"
    code, _, err = run(capsys, "profiles", "rename", "calm", "driver-10", "--library", own)
    assert code == 1 and "there is a profile of this id" in err and (own / "calm.json").exists()
    assert run(capsys, "profiles", "rename", "calm", "driver-10", "--library", own, "--force")[0] == 0
    assert xl.read_profile("driver-10", own).metadata.driver == "d09"
    for wrong in ("../out", "a/b", ""):
        code, _, err = run(capsys, "profiles", "rename", "driver-10", wrong, "--library", own)
        assert code == 1 and err.count("\n") == 1 and (own / "driver-10.json").exists(), wrong


def test_a_file_that_is_not_called_like_its_id_is_put_right(tmp_path, capsys):
    path = add_profile("motorway-vehicle-1", tmp_path)
    path.rename(tmp_path / "other.json")
    assert run(capsys, "profiles", "check", "--library", tmp_path)[0] == 1
    assert run(capsys, "profiles", "rename", "other", "other", "--library", tmp_path)[0] == 0
    assert run(capsys, "profiles", "check", "--library", tmp_path)[0] == 0


def test_profiles_are_removed_all_or_none_and_those_shipped_never(own, tmp_path, capsys):
    code, _, err = run(capsys, "profiles", "remove", "driver-11", "nobody", "--library", own)
    assert code == 1 and "nobody" in err and (own / "driver-11.json").exists()
    for shipped in ("motorway", str(shipped_folder("driver_profiles") / "motorway.json")):
        code, _, err = run(capsys, "profiles", "remove", shipped, "--library", own)
        assert code == 1 and "comes with the package" in err
    foreign = tmp_path / "settings.json"
    foreign.write_text("{}")
    code, _, err = run(capsys, "profiles", "remove", foreign)
    assert code == 1 and foreign.exists()  # a path has to be a profile's
    assert run(capsys, "profiles", "remove", "driver-11", "half", "--library", own)[0] == 0  # a broken one by its id
    assert not (own / "driver-11.json").exists() and not (own / "half.json").exists()


def test_outputs_say_which_profile_they_used(tmp_path, capsys):
    """Two scenarios, one of them with a profile of our own for one vehicle, which changes afterwards."""
    add_profile("motorway-vehicle-1", tmp_path / "lib", name="mine")
    scenario, _ = xl.write_template("cut-in", tmp_path / "in")
    for name in ("one", "two"):
        shutil.copy(scenario, tmp_path / f"in/{name}.xosc")
    table = tmp_path / "jobs.csv"
    table.write_text("scenario,profile:Truck,ego\nin/one.xosc,mine,none\nin/two.xosc,,none\n")
    xl.convert_many([table], tmp_path / "out", library=[tmp_path / "lib"], time_limit=5.0)

    def uses(name, *words):
        found = run(capsys, "profiles", "uses", name, tmp_path / "out", "--library", tmp_path / "lib", "--json", *words)
        assert found[0] == 0
        return [(Path(o["output"]).name, o["entities"], o["is_current"]) for o in json.loads(found[1])["outputs"]]

    assert [(name, entities, True) for name, entities, _ in uses("mine")] == uses("mine")
    assert [entities for _, entities, _ in uses("mine")] == [["Truck"]]
    assert len(uses("motorway")) == 2 and uses("rural") == []
    assert run(capsys, "profiles", "tag", "mine", "--library", tmp_path / "lib", "--tag", "new")[0] == 0
    assert [is_current for _, _, is_current in uses("mine")] == [False]
    assert run(capsys, "profiles", "remove", "mine", "--library", tmp_path / "lib")[0] == 0
    assert [is_current for _, _, is_current in uses("mine")] == [None]
    code, _, err = run(capsys, "profiles", "uses", "mine", tmp_path / "in")
    assert code == 1 and "manifest.parquet" in err
