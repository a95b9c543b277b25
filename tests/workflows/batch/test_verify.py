"""What `verify` names, and that `reproduce` makes the same again: by editing outputs, inputs and provenance by hand."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import xosc_lateral as xl
from xosc_lateral.base.plugins import shipped_folder
from xosc_lateral.base.version import BEHAVIOUR
from xosc_lateral.cli import main
from xosc_lateral.files.openscenario.provenance import content_hash
from xosc_lateral.workflows.batch.manifest import MANIFEST, ManifestRow
from xosc_lateral.workflows.conversion.settings import OPTIONS, RECORDED
from xosc_lateral.workflows.options import SHARED


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of inputs, each with a road of its own, and of outputs."""
    folder = tmp_path_factory.mktemp("verify")
    for number in range(4):
        xl.write_template("cut-in", folder / "in" / str(number))
    profile = folder / "mine.json"
    shutil.copy(shipped_folder("driver_profiles") / "motorway-vehicle-1.json", profile)
    options = {"seed": 3, "time_limit": 4.0, "ego": ["none"], "profile": profile}
    assert xl.convert_many(folder / "in", folder / "out", variants=2, **options).failed == 0
    return folder


@pytest.fixture
def copy(made: Path, tmp_path: Path) -> Path:
    shutil.copytree(made, tmp_path / "copy")
    return tmp_path / "copy"


def named(result: xl.Verification) -> dict[str, list[str]]:
    return {one.output.name: [kind.value for kind, _ in one.problems] for one in result.failing}


def change(path: Path, before: str, after: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert before in text
    path.write_text(text.replace(before, after), encoding="utf-8")


def test_exactly_what_was_changed_is_named_with_its_reason(copy: Path) -> None:
    out = copy / "out"
    assert not xl.verify(out).failing and len(xl.verify(out).checked) == 8
    outputs = sorted(out.rglob("*.xosc"))
    first = sorted((out / "0").glob("*.xosc"))
    change(first[0], "<FileHeader", "<FileHeader ")
    road = next((copy / "in" / "1").rglob("*.xodr"))
    change(road, "</OpenDRIVE>", "</OpenDRIVE> ")
    version = sorted((out / "2").glob("*.xosc"))[1]
    change(version, f'"behaviour": {BEHAVIOUR},', '"behaviour": 1,')
    outputs[-1].unlink()
    result = xl.verify(out)
    problems = {one.output: [kind.value for kind, _ in one.problems] for one in result.failing}
    expected = {first[0]: ["edited"], version: ["version"], outputs[-1]: ["missing"]}
    expected |= {path: ["input"] for path in (out / "1").glob("*.xosc")}
    assert problems == expected
    assert "made by behaviour 1 of version" in str(result) and "3 of 8 outputs are" in str(result)


def test_other_profiles_other_seeds_in_the_provenance_and_strangers_are_seen(copy: Path) -> None:
    output = sorted((copy / "out").rglob("*.xosc"))[0]
    change(output, '"seed": 3', '"seed": 4')
    assert not xl.verify(output, fast=True).failing, "by its own hashes alone it can't be known"
    assert "none was made again" in str(xl.verify(output, fast=True))
    assert named(xl.verify(output)) == {output.name: ["differs"]}
    assert named(xl.verify(copy / "out", fast=True)) == {output.name: ["edited"]}, "the manifest knows"
    profile = copy / "mine.json"
    values = json.loads(profile.read_text())
    profile.write_text(json.dumps(values | {"name": "another"}))
    assert {kind for kinds in named(xl.verify(copy / "out")).values() for kind in kinds} >= {"profile"}
    stranger = copy / "in" / "0" / "cut-in.xosc"
    assert named(xl.verify(stranger)) == {"cut-in.xosc": ["not ours"]}
    with pytest.raises(xl.FormatError, match="no manifest"):
        xl.verify(copy / "in")
    with pytest.raises(xl.FormatError, match=r"gone\.xosc"):
        xl.verify(copy / "gone.xosc")


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ('"options": {', '"options": 5, "old": {'),
        ('"scenario": "', '"scenario": "\\u0000'),
        ('"inputs": {', '"inputs": [], "old": {'),
        ('"profiles": {', '"profiles": {"Nobody": 3}, "old": {'),
        ('"variant": 1', '"variant": 1e400'),
        ('"seed": 3', '"seed": -3'),
        ('"mode": "auto"', '"mode": []'),
        ('"inputs"', '"outputs"'),
    ],
)
def test_a_provenance_that_was_written_by_hand_costs_a_line(copy: Path, before: str, after: str) -> None:
    output = sorted((copy / "out").rglob("*.xosc"))[0]
    change(output, before, after)
    assert len(xl.verify(output).failing) == 1
    assert main(["reproduce", str(output), "-o", str(copy / "again.xosc")]) in (0, 1)


def tampered(text: str, change: Callable[[dict[str, Any]], object]) -> str:
    """With the provenance that somebody who knows how wrote anew."""
    begin = text.index("<!-- xosc-lateral provenance: ") + len("<!-- xosc-lateral provenance: ")
    end = text.index(" -->", begin)
    facts = json.loads(text[begin:end])
    change(facts)
    return text[:begin] + json.dumps(facts, sort_keys=True, ensure_ascii=False) + text[end:]


TAMPERINGS: dict[str, Callable[[dict[str, Any]], object]] = {
    "seed": lambda facts: facts["options"].update(seed=4),
    "variant": lambda facts: facts.update(variant=2),
    "parameters": lambda facts: facts["options"].update(parameters={"EgoSpeed": "20"}),
    "time limit": lambda facts: facts["options"].update(time_limit=3.0),
    "mode": lambda facts: facts["options"].update(mode="lane-offset"),
    "player": lambda facts: facts["options"].update(player="carla"),
    "only": lambda facts: facts["options"].update(only=["Ego"]),
    "ego": lambda facts: facts["options"].update(ego=["Ego"]),
    "sensor": lambda facts: facts["options"].update(with_sensor=True),
    "neighbours": lambda facts: facts["options"].update(neighbours="none"),
    "step": lambda facts: facts["options"].update(step=0.05),
    "step 0": lambda facts: facts["options"].update(step=0),
    "step nan": lambda facts: facts["options"].update(step=float("nan")),
    "step -1": lambda facts: facts["options"].update(step=-1),
    "no inputs": lambda facts: facts.update(inputs={}),
    "an input less": lambda facts: facts["inputs"].pop(min(facts["inputs"])),
    "no profiles": lambda facts: facts.update(profiles={}),
    "a profile less": lambda facts: facts["profiles"].pop(min(facts["profiles"])),
    "a list of profiles": lambda facts: facts["options"].update(profile=["motorway"]),
    "another profile": lambda facts: facts["options"].update(profile="motorway"),
    "modes": lambda facts: facts.update(modes={}),
    "who is ego": lambda facts: facts.update(ego=["Ego"]),
    "version": lambda facts: facts.update(version="1.0"),
    "more facts": lambda facts: facts.update(approved=True),
    "content hash": lambda facts: facts.update(content_sha256="0" * 64),
    "behaviour": lambda facts: facts.update(behaviour=1),
    "another scenario": lambda facts: facts.update(scenario=facts["scenario"].replace("/0/", "/1/")),
}


@pytest.mark.parametrize("name", TAMPERINGS)
def test_who_edits_the_provenance_and_knows_how_is_named(copy: Path, name: str) -> None:
    output = sorted((copy / "out").rglob("*.xosc"))[0]
    output.write_text(tampered(output.read_text("utf-8"), TAMPERINGS[name]), encoding="utf-8")
    for checked in (xl.verify(output), xl.verify(copy / "out", fast=True)):
        assert list(named(checked)) == [output.name]
        assert "\n" not in checked.failing[0].problems[0][1]
    if name.startswith("step"):
        assert main(["reproduce", str(output), "-o", str(copy / "again.xosc")]) == 1


PATHS = (
    "/dev/zero",
    "/proc/kmsg",
    "/",
    "fifo",
    "sparse",
    "link",
    "gone",
    "\0",
    "a" * 120_000,
    "../" * 500,
    "http://x/y",
)
"""Of every kind, as a record may name them; some are made in the test."""


@pytest.fixture
def odd_paths(copy: Path) -> Path:
    """A folder with a pipe, a file of a terabyte without a byte on the disk, and a link to a device."""
    folder = copy / "in" / "0"
    os.mkfifo(folder / "fifo")
    with (folder / "sparse").open("wb") as file:
        file.truncate(10**12)
    (folder / "link").symlink_to("/dev/zero")
    return folder


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="POSIX files")
def test_paths_of_every_kind_in_a_provenance_cost_a_line(copy: Path, odd_paths: Path) -> None:
    output = sorted((copy / "out").rglob("*.xosc"))[0]
    text = output.read_text("utf-8")
    for path in PATHS:
        for change in (
            lambda facts, path=path: facts.update(scenario=path),
            lambda facts, path=path: facts.update(scenario=f"../../in/0/{path}"),
            lambda facts, path=path: facts["inputs"].update({path: "0" * 64}),
            lambda facts, path=path: facts["options"].update(profile=f"{path}/x.json"),
            lambda facts, path=path: facts["options"].update(profile=path, entity={"CutIn": path}),
            lambda facts, path=path: facts["options"].update(road=path),
            lambda facts, path=path: facts["options"].update(context=path),
        ):
            output.write_text(tampered(text, change), encoding="utf-8")
            for failing in xl.verify(output, fast=path != PATHS[0]).failing:
                assert all("\n" not in what and len(what) < 5000 for _, what in failing.problems)


@pytest.mark.parametrize("name", sorted({*OPTIONS, *SHARED, "names_may_lack", "__class__", "x" * 10_000} - {*RECORDED}))
def test_no_record_sets_an_option_that_its_writer_does_not_state(copy: Path, name: str) -> None:
    output = sorted((copy / "out").rglob("*.xosc"))[0]
    text = output.read_text("utf-8")
    for change in (lambda facts: facts["options"].update({name: "/lib/x.so"}), lambda facts: facts.update({name: "x"})):
        output.write_text(tampered(text, change), encoding="utf-8")
        (failing,) = xl.verify(output, fast=True).failing
        assert [kind for kind, _ in failing.problems] == ["not ours"] and repr(name[:60]) in failing.problems[0][1]
        assert main(["reproduce", str(output), "-o", str(copy / "again.xosc")]) == 1
    with pytest.raises(ValueError, match=re.escape(repr(name[:60]))):
        ManifestRow.from_dict(pd.read_parquet(copy / "out" / MANIFEST).iloc[0].to_dict() | {name: 1})


@pytest.mark.parametrize("name", ["inputs", "profiles"])
def test_a_provenance_names_so_many_files_and_no_more(copy: Path, name: str) -> None:
    output = sorted((copy / "out").rglob("*.xosc"))[0]
    text = output.read_text("utf-8")
    for count, kinds in ((10_000, {"input", "profile"}), (11_000, {"not ours"})):
        facts = dict.fromkeys(map(str, range(count)), "x")
        output.write_text(tampered(text, lambda stated, facts=facts: stated.update({name: facts})), encoding="utf-8")
        (failing,) = xl.verify(output, fast=True).failing
        assert {str(kind) for kind, _ in failing.problems} & kinds and len(failing.problems) in (count, 1)


def test_content_that_is_sealed_anew_and_files_that_no_manifest_names_are_named(copy: Path) -> None:
    output, other = sorted((copy / "out").rglob("*.xosc"))[:2]
    change(output, 'value="33', 'value="34') if 'value="33' in output.read_text() else change(output, 'x="', 'x="1')
    digest = content_hash(output.read_bytes())
    output.write_text(tampered(output.read_text("utf-8"), lambda facts: facts.update(content_sha256=digest)))
    assert named(xl.verify(output)) == {output.name: ["differs"]}
    assert not xl.verify(output, fast=True).failing
    extra = other.with_name("extra.xosc")
    shutil.copy(other, extra)
    assert named(xl.verify(copy / "out", workers=2)) == {output.name: ["edited"], "extra.xosc": ["not ours"]}
    assert not xl.verify(extra).failing


def test_an_output_and_a_folder_are_made_again_elsewhere(copy: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = sorted((copy / "out").rglob("*.xosc"))[1]
    (copy / "deep" / "er").mkdir(parents=True)
    assert main(["reproduce", str(output), "-o", str(copy / "deep" / "er" / "again.xosc")]) == 0
    assert not xl.reproduce(copy / "out", copy / "again").failing
    assert not xl.verify(copy / "again").failing
    again = pd.read_parquet(copy / "again" / MANIFEST)
    for column in ("output", "scenario", "inputs", "content_sha256", "settings"):
        assert list(again[column]) == list(pd.read_parquet(copy / "out" / MANIFEST)[column]), column
    road = next((copy / "in" / output.parent.name).rglob("*.xodr"))
    change(road, "</OpenDRIVE>", "</OpenDRIVE> ")
    assert not xl.reproduce(output, copy / "same.xosc").failing, "another file, the same content"
    change(output, "<FileHeader", "<FileHeader ")
    capsys.readouterr()
    assert main(["reproduce", str(output), "-o", str(copy / "other.xosc"), "--json"]) == 1
    (problem,) = json.loads(capsys.readouterr().out)["outputs"]
    assert [one["kind"] for one in problem["problems"]] == ["edited", "input"]
    assert main(["reproduce", str(output), "-o", str(output), "--force"]) == 1


@pytest.mark.pages
def test_outputs_whose_scenarios_can_not_be_played_any_more_are_named_with_the_error(copy: Path) -> None:
    for scenario in (copy / "in").rglob("*.xosc"):
        change(scenario, "</OpenSCENARIO>", "")
    result = xl.reproduce(copy / "out", copy / "again")
    assert [one.output for one in result.failing] == sorted((copy / "out").rglob("*.xosc"))
    for one in result.failing:
        ((kind, why),) = one.problems
        assert kind.value == "failed" and "cut-in.xosc" in why


def test_a_manifest_that_names_files_elsewhere_is_refused(copy: Path) -> None:
    rows = pd.read_parquet(copy / "out" / MANIFEST)
    rows.loc[0, "output"] = "../../evil.xosc"
    rows.to_parquet(copy / "out" / MANIFEST)
    with pytest.raises(xl.FormatError, match="expected the name of a file"):
        xl.verify(copy / "out")


def test_what_is_stale_is_made_anew_with_its_reason_and_kept_if_asked(copy: Path) -> None:
    options = {"variants": 2, "seed": 3, "time_limit": 4.0, "ego": ["none"], "profile": copy / "mine.json"}

    def totals(**more: object) -> tuple[int, dict[str, int], dict[str, int], int]:
        found = xl.convert_many(copy / "in", copy / "out", **options, **more).totals()  # type: ignore[arg-type]
        return found["written"], found["anew"], found["kept"], found["up_to_date"]

    assert totals() == (0, {}, {}, 8)
    road = next((copy / "in" / "1").rglob("*.xodr"))
    change(road, "</OpenDRIVE>", "</OpenDRIVE> ")
    rows = pd.read_parquet(copy / "out" / MANIFEST)
    rows.loc[rows.output.str.startswith("2/"), "behaviour"] = BEHAVIOUR - 1
    rows.to_parquet(copy / "out" / MANIFEST)
    changed = {"inputs changed": 2, "another version made it": 2}
    assert totals(keep_old=True) == (0, {}, changed, 4)
    assert pd.read_parquet(copy / "out" / MANIFEST).stale.sum() == 4
    assert totals() == (4, changed, {}, 4)
    assert totals(mode="trajectory") == (8, {"settings differ": 8}, {}, 0)
    next((copy / "out" / "3").glob("*.xosc")).unlink()
    assert totals(mode="trajectory", keep_old=True) == (1, {"changed or gone": 1}, {}, 7), "that is not old but lost"


def test_profiles_and_inputs_are_compared_by_their_hashes(copy: Path) -> None:
    """Of a profile the output's own statement, of inputs the manifest's."""
    output = sorted((copy / "out").rglob("*.xosc"))[0]
    text = output.read_text("utf-8")
    names = json.loads(re.findall("provenance: (.*?) -->", text)[0])["profiles"]
    for name in names:
        forged = tampered(text, lambda facts, name=name: facts["profiles"][name].__setitem__(1, "0" * 64))
        output.write_text(forged, encoding="utf-8")
        assert named(xl.verify(output, fast=True)) == {output.name: ["profile"]}
    output.write_text(text, encoding="utf-8")
    rows = pd.read_parquet(copy / "out" / MANIFEST)
    below = output.relative_to(copy / "out").as_posix()
    rows.loc[rows.output == below, "inputs"] = rows.inputs[rows.output == below].map(lambda one: one.replace("a", "b"))
    rows.to_parquet(copy / "out" / MANIFEST)
    (failing,) = xl.verify(copy / "out", fast=True).failing
    assert failing.output == output and failing.problems[0][1] == "the manifest states another inputs"
