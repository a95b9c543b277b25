"""Outputs that can't be meant, and numbers out of range: refused before anything is written."""

from __future__ import annotations

import json
import logging
import re
from pathlib import Path

import pytest

from xosc_lateral.base.plugins import shipped_folder
from xosc_lateral.cli import main
from xosc_lateral.cli.cures import GONE_OPTIONS, todays


@pytest.fixture
def scenario(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    assert main(["template", "write", "cut-in", "-o", str(tmp_path)]) == 0
    capsys.readouterr()
    return tmp_path / "cut-in.xosc"


def _files(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    ("verb", "options", "what"),
    [
        ("convert", ["-o", "cut-in.xosc"], "cut-in.xosc: is an input"),
        ("convert", ["-o", "cut-in.xodr"], "cut-in.xodr: can't write .xodr: expected a name ending in .xosc"),
        ("convert", ["-o", "out.xosc", "--report", "cut-in.xosc"], "cut-in.xosc: can't write .xosc"),
        ("convert", ["-o", "out.xosc", "--report", "cut-in.xodr"], "cut-in.xodr: can't write .xodr"),
        ("convert", ["-o", "theirs.xosc"], "theirs.xosc: exists and was not written by xosc-lateral"),
        ("convert", ["-o", "out.xosc", "--report", "theirs.html"], "theirs.html: exists and was not written by"),
        ("convert", ["-o", "v.xosc", "--variants", "2"], "v_02.xosc: exists and was not written by xosc-lateral"),
        ("convert", ["-o", "out.xosc", "--report", "cut-in.xodr/r.html"], "cut-in.xodr/r.html: can't be written: "),
        ("convert", ["-o", "cut-in.xodr/out.xosc"], "cut-in.xodr/out.xosc: can't be written: "),
        (
            "convert",
            ["-o", "v.xosc", "--report", "cut-in.xodr/r.html", "--variants", "2"],
            "r_01.html: can't be written",
        ),
        ("convert", ["-o", "out.xosc", "--allow", "nowhere"], "nowhere: no such folder to allow"),
        ("convert", ["-o", "out.xosc", "--profile", "none.json"], "none.json: no such file"),
        ("convert", ["-o", "out.xosc", "--context", "none.csv"], "none.csv: no such file or folder"),
        ("states", ["-o", "cut-in.xosc"], "cut-in.xosc: can't write .xosc"),
        ("states", ["-o", "out.xlsx"], "out.xlsx: can't write .xlsx: expected a name ending in .csv"),
        ("states", ["-o", "theirs.csv"], "theirs.csv: exists and was not written by xosc-lateral"),
    ],
)
def test_no_verb_writes_over_its_inputs(
    scenario: Path,
    verb: str,
    options: list[str],
    what: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(scenario.parent)
    for name in ("theirs.xosc", "theirs.html", "theirs.csv", "v_02.xosc"):
        Path(name).write_text("<work of weeks/>")
    before = _files(scenario.parent)
    assert main([verb, "cut-in.xosc", *options]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert what in line
    assert _files(scenario.parent) == before


@pytest.mark.parametrize(
    "words",
    [
        ["sample", "--profile", "motorway", "--like", "t.csv", "--seed", "1", "-o", "t.csv"],
        ["sample", "--profile", "motorway", "--context", "t.csv", "--force", "-o", "t.csv"],
    ],
)
def test_no_verb_writes_over_measured_drives(
    tmp_path: Path, words: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "t.csv").write_text("time,offset,lane_width\n")
    assert main(words) == 1
    assert "t.csv: is an input" in capsys.readouterr().err
    assert _files(tmp_path) == {tmp_path / "t.csv": b"time,offset,lane_width\n"}


@pytest.mark.parametrize("limit", ["nan", "-1", "inf"])
@pytest.mark.parametrize("verb", ["segments", "states", "convert"])
def test_a_time_limit_that_is_none_is_wrong_usage(
    scenario: Path, verb: str, limit: str, capsys: pytest.CaptureFixture[str]
) -> None:
    output = [] if verb == "segments" else ["-o", str(scenario.parent / "out")]
    assert main([verb, str(scenario), *output, "--time-limit", limit]) == 2
    assert "--time-limit" in capsys.readouterr().err
    assert not (scenario.parent / "out").exists()


def test_an_allowed_folder_that_is_not_there_stops_a_batch_at_once(
    scenario: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["convert", str(scenario.parent), "-o", str(scenario.parent / "out"), "--allow", "nowhere"]
    assert main(words) == 1
    assert capsys.readouterr().err == "xosc-lateral: --allow: nowhere: no such folder to allow\n"
    assert not (scenario.parent / "out").exists()


@pytest.mark.parametrize("jobs", ["0", "-2"])
def test_a_batch_needs_workers(scenario: Path, jobs: str) -> None:
    assert main(["convert", str(scenario.parent), "-o", str(scenario.parent / "out"), "--jobs", jobs]) == 2
    assert not (scenario.parent / "out").exists()


def test_a_lane_without_width_is_refused_by_name(scenario: Path, capsys: pytest.CaptureFixture[str]) -> None:
    road = scenario.with_suffix(".xodr")
    text = road.read_text(encoding="utf-8")
    assert ' a="3.' in text
    road.write_text(re.sub(r'(<width [^>]*)a="[^"]*"', r'\1a="0"', text), encoding="utf-8")
    before = _files(scenario.parent)
    assert main(["convert", str(scenario), "-o", str(scenario.parent / "out.xosc")]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    refusal, _, remarked = line.partition("; remarked before: ")
    assert refusal.endswith("cut-in.xodr: road '1': lane -1 has no width where 'CutIn' follows it")
    assert "is 0 m wide all along a section" in remarked
    assert _files(scenario.parent) == before


def test_what_this_package_wrote_is_written_again_and_what_was_edited_is_not(
    scenario: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(scenario.parent)
    words = ["states", "cut-in.xosc", "--time-limit", "1", "-q", "-o"]
    for name in ("states.csv", "states.csv.gz", "states.parquet"):
        assert main([*words, name]) == main([*words, name]) == 0
    assert main(["template", "write", "cut-in", "-o", "."]) == 0
    scenario.write_text(scenario.read_text().replace('value="30"', 'value="31"'))
    edited = scenario.read_bytes()
    assert main(["template", "write", "cut-in", "-o", "."]) == 1
    assert "--force replaces it" in capsys.readouterr().err
    assert scenario.read_bytes() == edited
    with Path("states.csv").open("a") as file:
        file.write("a note of mine\n")
    assert main([*words, "states.csv"]) == 1
    assert main([*words, "states.csv", "--force"]) == 0
    assert "a note" not in Path("states.csv").read_text()


def test_a_folder_is_meant_by_a_slash_and_by_being_there(
    scenario: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(scenario.parent)
    assert main(["convert", "cut-in.xosc", "-o", "new/", "--time-limit", "5", "--report", "new/"]) == 0
    assert sorted(path.name for path in Path("new").iterdir()) == ["cut-in.html", "cut-in.xosc"]
    assert main(["convert", "cut-in.xosc", "-o", ".", "--time-limit", "5"]) == 0
    assert Path("cut-in_lifelike.xosc").exists()
    assert main(["states", "cut-in.xosc", "-o", "new", "--time-limit", "1"]) == 0
    assert Path("new/cut-in.csv").exists()


def test_standard_output_gets_what_the_file_would_hold(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["template", "write", "cut-in", "-o", "."]) == 0
    assert main(["convert", "cut-in.xosc", "-o", "same.xosc", "--time-limit", "5", "-q"]) == 0
    assert main(["states", "cut-in.xosc", "-o", "same.csv", "--time-limit", "1", "-q"]) == 0
    capfdbinary.readouterr()
    assert main(["convert", "cut-in.xosc", "-o", "-", "--time-limit", "5"]) == 0
    out, err = capfdbinary.readouterr()
    assert out == Path("same.xosc").read_bytes()
    assert b"segment" in err
    assert main(["states", "cut-in.xosc", "-o", "-", "--time-limit", "1"]) == 0
    assert capfdbinary.readouterr().out == Path("same.csv").read_bytes()


def test_an_empty_folder_and_a_glob_without_a_match_are_errors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("empty").mkdir()
    assert main(["convert", "empty", "-o", "out"]) == 1
    assert "empty: no .xosc file in this folder" in capsys.readouterr().err
    assert main(["convert", "*.xosc", "-o", "out"]) == 1
    assert "*.xosc: nothing matches" in capsys.readouterr().err
    assert main(["convert", "not-mounted", "-o", "out"]) == 1
    assert "not-mounted: no such file or folder" in capsys.readouterr().err
    assert not Path("out").exists()
    Path("out").mkdir()
    assert main(["convert", "not-mounted", "-o", "out"]) == 1
    assert "not-mounted: no such file or folder" in capsys.readouterr().err


def test_errors_are_json_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    broken = tmp_path / "broken.xosc"
    broken.write_text("<OpenSCENARIO>\n<FileHeader></OpenSCENARIO>")
    assert main(["segments", str(broken), "--json"]) == 1
    said = capsys.readouterr()
    error = json.loads(said.out)["error"]
    assert (error["kind"], error["path"], error["line"]) == ("FormatError", str(broken), 2)
    assert f"xosc-lateral: {error['message']}\n" == said.err


def test_only_leaves_the_others_as_they_are(
    scenario: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(scenario.parent)
    assert main(["convert", "cut-in.xosc", "-o", "one.xosc", "--enrich", "Ego", "--ego", "none", "-q"]) == 0
    written = Path("one.xosc").read_text()
    assert written.count("<FollowTrajectoryAction>") == 1
    assert "<LaneChangeAction>" in written


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--version", "1.5"], "1.0, 1.1, 1.2, 1.3, 1.4"),
        (["--player", "carla", "--version", "1.2"], "1.0 alone"),
        (["--player", "carla", "--mode", "lane-offset"], "--mode trajectory"),
        (["--player", "sumo"], "standard"),
    ],
)
def test_what_can_not_be_written_is_wrong_usage(
    scenario: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert main(["convert", str(scenario), "-o", str(tmp_path / "x" / "out.xosc"), *words]) == 2
    assert said in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "x").exists()


def test_a_target_is_in_the_json_and_in_the_file(
    scenario: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "out.xosc"
    assert main(["convert", str(scenario), "-o", str(output), "--player", "carla", "--json", "--time-limit", "3"]) == 0
    provenance = json.loads(capsys.readouterr().out)["provenance"]
    assert (provenance["options"]["player"], provenance["version"]) == ("carla", "1.0")
    assert 'revMinor="0"' in output.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["../evil", "..", "a/b", "a\\b"])
def test_a_profiles_id_stays_inside_its_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["profiles", "add", "motorway", "--library", "inner/lib", "--name", name]) == 1
    assert "without a folder" in capsys.readouterr().err
    assert not list(tmp_path.rglob("*.json"))
    values = json.loads((shipped_folder("driver_profiles") / "motorway.json").read_text(encoding="utf-8"))
    (tmp_path / "hostile.json").write_text(json.dumps(values | {"id": name}))
    assert main(["profiles", "add", "hostile.json", "--library", "inner/lib"]) == 1
    assert "without a folder" in capsys.readouterr().err
    assert main(["profiles", "export", "hostile.json", "-o", "inner/"]) == (name != "..")  # a file "...json" is one
    assert {path.parent.name for path in tmp_path.rglob("*.json")} <= {tmp_path.name, "inner"}


def test_a_log_names_files_and_ends_with_its_command(tmp_path, capsys):
    target = tmp_path / "cut-in"
    assert main(["template", "write", "cut-in", "-o", str(target), "--verbose"]) == 0
    assert logging.getLogger("xosc_lateral").level == logging.NOTSET, "for one command alone"
    err = capsys.readouterr().err
    assert re.search(rf"^\d\d:\d\d:\d\d\.\d+ wrote {re.escape(str(target / 'cut-in.xosc'))}$", err, flags=re.MULTILINE)
    assert main(["segments", str(target / "cut-in.xosc"), "-v", "--quiet"]) == 0
    assert re.search(r"read \S+cut-in.xodr, sha256 [0-9a-f]{64}$", capsys.readouterr().err, flags=re.MULTILINE)
    assert main(["segments", str(target / "cut-in.xosc"), "--quiet"]) == 0
    assert capsys.readouterr().err == ""


def test_every_verb_names_a_page_that_exists():
    from xosc_lateral.base.plugins import offered
    from xosc_lateral.cli.words import DOCS_PAGES

    root = Path(__file__).resolve().parents[2]
    told = [*DOCS_PAGES.values(), *(pages for *_, pages in offered("VERBS").values())]
    assert {page for pages in told for page in pages.split(", ") if not (root / page).exists()} == set()
    assert set(DOCS_PAGES) | {"__init__", "cures", "words"} == {
        path.stem for path in (root / "xosc_lateral" / "cli").glob("*.py")
    }


def test_a_closed_loop_that_is_interrupted_says_what_it_was_at(capsys):
    from xosc_lateral.extras.loop.verb import shown_progress

    with pytest.raises(KeyboardInterrupt), shown_progress("closing the loop", False) as progress:
        progress(0.3, "looking at the mean")
        raise KeyboardInterrupt
    assert capsys.readouterr().err == "xosc-lateral: stopped at: looking at the mean; nothing is written yet\n"


@pytest.mark.parametrize("name", ["a.csv", "a.csv.gz", "a.parquet"])
@pytest.mark.parametrize("data", [b"", b"PAR1xxxxPAR1", b"\x1f\x8bgarbage"], ids=["empty", "no Parquet", "cut gzip"])
def test_a_damaged_table_is_refused_in_words_of_our_own(tmp_path, capsys, name, data):
    (tmp_path / name).write_bytes(data)
    assert main(["fit", str(tmp_path / name), "-o", str(tmp_path / "x.json")]) == 1
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and not re.search("footer|parse|end-of-stream|C error|codec", err), err


def test_what_went_says_what_takes_its_place(capsys: pytest.CaptureFixture[str]) -> None:
    for option, today in GONE_OPTIONS.items():
        assert main(["convert", "cut-in.xosc", option, "x"]) == 2
        assert f"{option} is gone: {today}" in capsys.readouterr().err


def test_former_words_are_known(
    scenario: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(scenario.parent)
    former = "--for esmini --only=Ego --resample 2 --entity Ego=rural --jam-corridor --summary s.md --job-timeout 60"
    today = "--player esmini --enrich=Ego --attempts 2 -p Ego=rural --with jam-corridor --report s.md --job-limit 60s"
    written = []
    for verb, words in (("play", former), ("states", today)):
        assert main([verb, "cut-in.xosc", "-o", "s.csv", "--time-limit", "1", "-q"]) == 0
        told = ["--ego", "none", "--time-limit", "1", "-q"]
        assert main(["convert", "cut-in.xosc", "-o", "c.xosc", "--force", *words.split(), *told]) == 0
        written.append([Path(name).read_bytes() for name in ("s.csv", "c.xosc", "s.md")])
        said = [line for line in capsys.readouterr().err.splitlines() if "now" in line]
        assert len(said) == (8 if verb == "play" else 0)
    assert written[0] == written[1]
    assert todays(["a", "--cluster", "tcp://x:1", "--log-json", "--", "--osi"], ["--jobs", "--json"]) == [
        "a", "--jobs", "tcp://x:1", "--json", "--verbose", "--", "--osi",
    ]  # fmt: skip
    assert todays(["a", "--osi", "t.mcap"], ["--osi", "--report"]) == ["a", "--osi", "t.mcap"]
