"""The batch engine, on a converter that costs nothing."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from tests.kit.fake_converter import convert, convert_and_log
from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.source import file_hash
from xosc_lateral.workflows.batch.batch import STATE_FOLDER, BatchStoppedError, JobOutcome, JobState, convert_many
from xosc_lateral.workflows.batch.jobs import Job, plan_batch
from xosc_lateral.workflows.batch.journal import FolderInUseError, folder_lock
from xosc_lateral.workflows.batch.manifest import MANIFEST, TIMINGS, ManifestRow, read_manifest
from xosc_lateral.workflows.batch.workers import JobLimits
from xosc_lateral.workflows.conversion.settings import ConvertSettings

ROOT = Path(__file__).resolve().parents[3]


def make_inputs(folder: Path, count: int = 12, **special: str) -> Path:
    folder.mkdir()
    (folder / "road.xodr").write_text("<OpenDRIVE/>")
    for index in range(count):
        (folder / f"{index:03d}.xosc").write_text(f"<OpenSCENARIO><Storyboard id='{index}'/></OpenSCENARIO>")
    for name, what in special.items():
        (folder / f"{name}.xosc").write_text(f"<OpenSCENARIO><Storyboard what='{what}'/></OpenSCENARIO>")
    return folder


def run(
    inputs: Path, folder: Path, converter=convert, workers: int = 0, variants: int = 1, **settings
) -> list[JobOutcome]:
    batch = plan_batch([inputs], folder, ConvertSettings(**settings), variants=variants)
    return list(convert_many(batch, workers=workers, converter=converter))


def tree(folder: Path) -> dict[str, bytes]:
    """Everything below a folder but the timings."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != TIMINGS
    }


def states(outcomes: list[JobOutcome]) -> dict[str, JobState]:
    return {outcome.row.output: outcome.state for outcome in outcomes}


def test_two_workers_leave_the_same_bytes_as_one(tmp_path: Path) -> None:
    inputs = make_inputs(tmp_path / "in", broken="bad")
    run(inputs, tmp_path / "one", variants=2)
    run(inputs, tmp_path / "two", variants=2, workers=2)
    one = tree(tmp_path / "one")
    assert len(one) == 2 * 12 + 1  # and the manifest; nothing for the broken one
    assert one == tree(tmp_path / "two")


def test_outputs_whose_state_is_known_are_not_read_and_every_edit_changes_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("xosc_lateral.workflows.batch.journal.CLOCK_TICK", -1)
    inputs, out = make_inputs(tmp_path / "in", 3), tmp_path / "out"
    run(inputs, out)
    edited = out / "001.xosc"
    before, kept = edited.stat(), edited.read_bytes()
    time.sleep(0.05)  # more than a tick of the file system's clock
    edited.write_bytes(kept[:-1] + b"!")
    os.utime(edited, ns=(before.st_atime_ns, before.st_mtime_ns))
    hashed: list[Path] = []

    def noting(path: Path) -> str:
        hashed.append(path)
        return file_hash(path)

    monkeypatch.setattr("xosc_lateral.workflows.batch.batch.file_hash", noting)
    found = {outcome.row.output: outcome.why for outcome in run(inputs, out)}
    assert found == {"000.xosc": "", "001.xosc": "changed or gone", "002.xosc": ""}
    assert edited.read_bytes() == kept
    assert {path.name for path in hashed if path.parent == out} == {"001.xosc"}


def test_a_second_run_converts_nothing_and_touches_nothing(tmp_path: Path) -> None:
    inputs = make_inputs(tmp_path / "in", 3)
    run(inputs, tmp_path / "out", convert_and_log)
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "out").iterdir()}
    outcomes = run(inputs, tmp_path / "out", convert_and_log)
    assert set(states(outcomes).values()) == {JobState.UP_TO_DATE}
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "out").iterdir()} == before
    assert len((inputs / "log.txt").read_text().splitlines()) == 3


def test_what_has_changed_is_converted_again(tmp_path: Path) -> None:
    inputs, out = make_inputs(tmp_path / "in", 3), tmp_path / "out"
    run(inputs, out)
    (inputs / "001.xosc").write_text("<OpenSCENARIO><Storyboard id='new'/></OpenSCENARIO>")
    (out / "002.xosc").write_text("damaged")
    again = states(run(inputs, out))
    assert again == {"000.xosc": JobState.UP_TO_DATE, "001.xosc": JobState.WRITTEN, "002.xosc": JobState.WRITTEN}
    (inputs / "road.xodr").write_text("<OpenDRIVE new='1'/>")
    assert set(states(run(inputs, out)).values()) == {JobState.WRITTEN}
    assert set(states(run(inputs, out, seed=1)).values()) == {JobState.WRITTEN}
    run(inputs, tmp_path / "fresh", seed=1)
    assert tree(out) == tree(tmp_path / "fresh")


def test_one_bad_scenario_costs_one_row(tmp_path: Path) -> None:
    outcomes = run(make_inputs(tmp_path / "in", 2, broken="bad", odd="bug"), tmp_path / "out")
    errors = {outcome.row.output: outcome.row.error for outcome in outcomes if outcome.state is JobState.FAILED}
    assert errors["broken.xosc"] == f"{tmp_path}/in/broken.xosc:1: nothing to play"
    assert "internal error: ZeroDivisionError: by nought (fake_converter.py:" in errors["odd.xosc"]
    rows = {row.output: row for row in read_manifest(tmp_path / "out" / MANIFEST)}
    assert {name for name, row in rows.items() if not row.error} == {"000.xosc", "001.xosc"}
    assert rows["broken.xosc"].error == errors["broken.xosc"]
    assert rows["broken.xosc"].scenario_sha256


def test_a_failed_scenario_keeps_its_old_output_which_is_said_to_be_stale(tmp_path: Path) -> None:
    inputs, out = make_inputs(tmp_path / "in", 2), tmp_path / "out"
    run(inputs, out)
    calm = tree(out)
    good = (inputs / "000.xosc").read_text()
    (inputs / "000.xosc").write_text(good + "<!-- bad -->")
    for _ in range(2):
        assert states(run(inputs, out)) == {"000.xosc": JobState.FAILED, "001.xosc": JobState.UP_TO_DATE}
        row = next(iter(read_manifest(out / MANIFEST)))
        assert row.stale and "nothing to play" in row.error
        assert row.output_sha256 == hashlib.sha256((out / "000.xosc").read_bytes()).hexdigest()
        assert row.scenario_sha256 == hashlib.sha256(good.encode()).hexdigest()  # of what the old output was made from
    (inputs / "000.xosc").write_text(good)
    assert states(run(inputs, out)) == {"000.xosc": JobState.UP_TO_DATE, "001.xosc": JobState.UP_TO_DATE}
    assert tree(out) == calm


def test_a_road_folder_that_is_not_mounted_costs_no_output(tmp_path: Path) -> None:
    inputs, out = make_inputs(tmp_path / "in", 3), tmp_path / "out"
    run(inputs, out)
    calm = tree(out)
    (inputs / "road.xodr").rename(tmp_path / "away")
    assert set(states(run(inputs, out)).values()) == {JobState.FAILED}
    assert {name for name in tree(out) if name != MANIFEST} == {name for name in calm if name != MANIFEST}
    (tmp_path / "away").rename(inputs / "road.xodr")
    run(inputs, out)
    assert tree(out) == calm


def test_what_somebody_else_put_in_an_outputs_place_is_no_output_of_ours(tmp_path: Path) -> None:
    inputs, out = make_inputs(tmp_path / "in", 1), tmp_path / "out"
    run(inputs, out)
    (inputs / "000.xosc").write_text("<OpenSCENARIO what='bad'/>")
    (out / "000.xosc").write_text("mine")
    run(inputs, out)
    row = next(iter(read_manifest(out / MANIFEST)))
    assert not row.stale and not row.output_sha256
    assert (out / "000.xosc").read_text() == "mine"


@pytest.mark.parametrize("name", [MANIFEST, TIMINGS])
@pytest.mark.parametrize("what", ["half", "text", "folder"])
def test_a_damaged_manifest_is_put_aside_and_the_run_goes_on(tmp_path: Path, name: str, what: str) -> None:
    inputs, out = make_inputs(tmp_path / "in", 2), tmp_path / "out"
    run(inputs, out)
    calm, whole = tree(out), (out / name).read_bytes()
    (out / name).unlink()
    if what == "folder":
        (out / name).mkdir()
    else:
        (out / name).write_bytes(whole[: len(whole) // 2] if what == "half" else b"no Parquet")
    said: list[str] = []
    list(convert_many(plan_batch([inputs], out), workers=0, converter=convert, notify=said.append))
    assert len(said) == 1
    assert name in said[0] and "put aside" in said[0]
    assert {key: value for key, value in tree(out).items() if "damaged" not in key} == calm


def test_two_files_that_break_planning_cost_a_row_each(tmp_path: Path) -> None:
    inputs = make_inputs(tmp_path / "in", 1)
    (inputs / os.fsdecode(b"caf\xe9.xosc")).write_text("<OpenSCENARIO><Storyboard/></OpenSCENARIO>")
    (inputs / "many.xosc").write_text(
        "<OpenSCENARIO><FileHeader revMajor='1' revMinor='1'/><ParameterValueDistribution>"
        "<ScenarioFile filepath='000.xosc'/><Stochastic numberOfTestRuns='1000000000000'/>"
        "</ParameterValueDistribution></OpenSCENARIO>"
    )
    (tmp_path / "out" / "000.xosc").mkdir(parents=True)
    errors = {outcome.row.output: outcome.row.error for outcome in run(inputs, tmp_path / "out")}
    assert "is not valid UTF-8; rename it" in errors["caf\\udce9.xosc"]
    assert "1000000000000, at most 100000" in errors["many.xosc"]
    assert "directory" in errors["000.xosc"].lower()
    assert len(list(read_manifest(tmp_path / "out" / MANIFEST))) == 3


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs /proc")
@pytest.mark.parametrize(("what", "message"), [("hang", "longer than 1 s"), ("memory", "more than 300 MB")])
@pytest.mark.parametrize("workers", [0, 1])
def test_a_job_beyond_its_limits_costs_one_row(tmp_path: Path, what: str, message: str, workers: int) -> None:
    batch = plan_batch([make_inputs(tmp_path / "in", 3, greedy=what)], tmp_path / "out")
    outcomes = list(convert_many(batch, workers=workers, converter=convert, limits=JobLimits(1.0, 300.0)))
    errors = {outcome.row.output: outcome.row.error for outcome in outcomes if outcome.row.error}
    assert list(errors) == ["greedy.xosc"]
    assert message in errors["greedy.xosc"]


def test_a_worker_of_another_version_stops_the_run_before_it_costs_rows(tmp_path: Path) -> None:
    inputs, out = make_inputs(tmp_path / "in", 3), tmp_path / "out"
    batch = plan_batch([inputs], out)
    old = replace(batch, jobs=tuple(replace(job, package_version="0.0.1") for job in batch.jobs))
    with pytest.raises(BatchStoppedError, match=r"planned by 0\.0\.1"):
        list(convert_many(old, workers=0, converter=convert))
    assert set(states(run(inputs, out)).values()) == {JobState.WRITTEN}


def test_a_scenario_that_kills_its_worker_costs_one_row(tmp_path: Path) -> None:
    outcomes = run(make_inputs(tmp_path / "in", 8, killer="crash"), tmp_path / "out", workers=2)
    failed = [outcome.row for outcome in outcomes if outcome.state is JobState.FAILED]
    assert [row.output for row in failed] == ["killer.xosc"]
    assert "worker process died" in failed[0].error
    assert len(outcomes) == 9


def test_a_worker_killed_from_outside_costs_nothing(tmp_path: Path) -> None:
    inputs = make_inputs(tmp_path / "in", 20)
    batch = plan_batch([inputs], tmp_path / "out")
    killed = 0
    outcomes = []
    for outcome in convert_many(batch, workers=2, converter=convert_and_log):
        outcomes.append(outcome)
        if len(outcomes) in (3, 9):
            os.kill(int((inputs / "log.txt").read_text().splitlines()[-1].split()[0]), signal.SIGKILL)
            killed += 1
    assert killed == 2
    assert {outcome.state for outcome in outcomes} == {JobState.WRITTEN}
    run(inputs, tmp_path / "calm")
    assert tree(tmp_path / "out") == tree(tmp_path / "calm")


KILLED_RUN = """
import sys
from tests.kit.fake_converter import convert
from xosc_lateral.workflows.batch.batch import convert_many
from xosc_lateral.workflows.batch.jobs import plan_batch
for outcome in convert_many(plan_batch([sys.argv[1]], sys.argv[2]), workers=int(sys.argv[3]), converter=convert):
    print(outcome.row.output, flush=True)
"""


@pytest.mark.parametrize(("workers", "kills"), [(0, 3), (2, 1)])  # workers take a second to begin
def test_killed_now_and_then_the_outputs_are_those_of_a_calm_run(tmp_path: Path, workers: int, kills: int) -> None:
    special = {f"slow{index}": "slow" for index in range(10)}
    inputs = make_inputs(tmp_path / "in", 40, **special, zz="hold")  # the last one waits: no run ends before its kill
    out = tmp_path / "out"
    rng = random.Random(workers)
    for _ in range(kills):
        command = [sys.executable, "-c", KILLED_RUN, str(inputs), str(out), str(workers)]
        with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            for _ in range(rng.randint(1, 12)):
                process.stdout.readline()
            process.kill()
    runs = json.loads((out / STATE_FOLDER / "lock").read_text())["runs"]
    assert len(runs) == kills
    for killed in runs:  # what a kill in the middle of writing leaves
        (out / f".000.{killed}-0123abcd.tmp.xosc").write_text("half")
    (inputs / "go").touch()
    outcomes = run(inputs, out)
    assert JobState.UP_TO_DATE in {outcome.state for outcome in outcomes}
    run(inputs, tmp_path / "calm")
    assert tree(out) == tree(tmp_path / "calm")


def test_a_journal_cut_anywhere_is_good_up_to_its_last_whole_line(tmp_path: Path) -> None:
    inputs, out = make_inputs(tmp_path / "in", 4), tmp_path / "out"
    outcomes = convert_many(plan_batch([inputs], out), workers=0, converter=convert)
    for _ in range(3):
        next(outcomes)
    outcomes.close()  # type: ignore[attr-defined]
    journal = out / STATE_FOLDER / "journal.jsonl"
    whole = journal.read_bytes()
    run(inputs, tmp_path / "calm")
    for cut in (0, 1, len(whole) // 2, len(whole) - 1, len(whole)):
        (out / STATE_FOLDER).mkdir(exist_ok=True)
        journal.write_bytes(whole[:cut])
        (out / MANIFEST).unlink(missing_ok=True)
        run(inputs, out)
        assert tree(out) == tree(tmp_path / "calm")


def test_a_run_stopped_by_its_user_goes_on_where_it_was(tmp_path: Path) -> None:
    inputs = make_inputs(tmp_path / "in", 5)
    outcomes = convert_many(plan_batch([inputs], tmp_path / "out"), workers=0, converter=convert)
    first = {next(outcomes).row.output for _ in range(2)}
    outcomes.close()  # type: ignore[attr-defined]
    again = states(run(inputs, tmp_path / "out"))
    assert {name for name, state in again.items() if state is JobState.UP_TO_DATE} == first


def test_a_full_disk_stops_the_run_and_loses_nothing(tmp_path: Path) -> None:
    inputs, out = make_inputs(tmp_path / "in", 3, zz="full"), tmp_path / "out"
    with pytest.raises(BatchStoppedError, match=r"zz\.xosc: No space left on device; what is finished is kept"):
        run(inputs, out)
    (inputs / "zz.xosc").write_text("<OpenSCENARIO/>")
    assert states(run(inputs, out)) == {
        "000.xosc": JobState.UP_TO_DATE,
        "001.xosc": JobState.UP_TO_DATE,
        "002.xosc": JobState.UP_TO_DATE,
        "zz.xosc": JobState.WRITTEN,
    }


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX limits")
def test_a_journal_that_can_not_grow_says_so_and_keeps_its_rows(tmp_path: Path) -> None:
    import resource

    inputs, out = make_inputs(tmp_path / "in", 30), tmp_path / "out"
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # then writing beyond the limit is an OSError
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, limits[1]))
        with pytest.raises(BatchStoppedError, match="out: File too large; what is finished is kept"):
            run(inputs, out)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)
    again = list(states(run(inputs, out)).values())
    assert 5 < again.count(JobState.UP_TO_DATE) < 30
    run(inputs, tmp_path / "calm")
    assert tree(out) == tree(tmp_path / "calm")


def test_a_second_run_into_a_busy_folder_is_refused(tmp_path: Path) -> None:
    inputs, out = make_inputs(tmp_path / "in", 2), tmp_path / "out"
    outcomes = convert_many(plan_batch([inputs], out), workers=0, converter=convert)
    next(outcomes)
    with pytest.raises(FolderInUseError, match=rf"out: another run \(process {os.getpid()} on "):
        run(inputs, out)
    assert len(list(outcomes)) == 1


def test_the_lock_of_a_dead_process_is_no_obstacle(tmp_path: Path) -> None:
    (tmp_path / STATE_FOLDER).mkdir()
    (tmp_path / STATE_FOLDER / "lock").write_text('{"pid": 1, "host": "elsewhere"}')
    with folder_lock(tmp_path / STATE_FOLDER / "lock"):
        assert str(os.getpid()) in (tmp_path / STATE_FOLDER / "lock").read_text()
    assert not (tmp_path / STATE_FOLDER / "lock").exists()


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write anywhere")
def test_a_folder_without_write_permission_is_said(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir(mode=0o500)
    with pytest.raises(BatchStoppedError, match=r"out/\.xosc-lateral: Permission denied"):
        run(make_inputs(tmp_path / "in", 1), out)


def test_rows_of_other_outputs_in_the_folder_are_kept(tmp_path: Path) -> None:
    inputs, out = make_inputs(tmp_path / "in", 3), tmp_path / "out"
    run(inputs, out)
    whole = tree(out)
    list(convert_many(plan_batch([inputs / "001.xosc"], out), workers=0, converter=convert))
    assert tree(out) == whole
    (inputs / "002.xosc").unlink()
    (out / "002.xosc").unlink()
    run(inputs, out)
    assert [row.output for row in read_manifest(out / MANIFEST)] == ["000.xosc", "001.xosc"]


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
def test_workers_end_with_a_killed_run(tmp_path: Path) -> None:
    inputs = make_inputs(tmp_path / "in", 3, **{f"slow{index}": "slow" for index in range(100)})
    script = KILLED_RUN.replace("import convert\n", "import convert_and_log as convert\n")
    command = [sys.executable, "-c", script, str(inputs), str(tmp_path / "out"), "2"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for _ in range(4):
            process.stdout.readline()
        process.kill()

    def alive(pid: int) -> bool:
        status = Path(f"/proc/{pid}/stat")  # a dead process that nobody has reaped counts as dead
        return status.exists() and status.read_text().rpartition(")")[2].split()[0] != "Z"

    workers = {int(line.split()[0]) for line in (inputs / "log.txt").read_text().splitlines()}
    deadline = time.monotonic() + 10.0
    while any(map(alive, workers)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not [pid for pid in workers if alive(pid)]


def test_a_run_that_makes_nothing_leaves_no_folder(tmp_path: Path) -> None:
    inputs = tmp_path / "in"
    for name in ("good/a.xosc", "bad/deep/b.xosc"):
        (inputs / name).parent.mkdir(parents=True)
        (inputs / name).write_text("broken" if "b." in name else "fine")
    batch = plan_batch([inputs], tmp_path / "new" / "out")

    def stopped(job: Job) -> ManifestRow:
        raise OSError(errno.ENOSPC, "No space left on device", str(job.output))

    with pytest.raises(BatchStoppedError):
        list(convert_many(batch, workers=0, converter=stopped))
    assert not (tmp_path / "new").exists()

    def half(job: Job) -> ManifestRow:
        job.output.parent.mkdir(parents=True, exist_ok=True)
        if "bad" in job.name:
            raise FormatError("broken", path=job.source)
        job.output.write_text("made")
        return replace(job.row(), output_sha256=file_hash(job.output))

    assert len(list(convert_many(batch, workers=0, converter=half))) == 2
    assert sorted(path.name for path in (tmp_path / "new" / "out").iterdir()) == ["good", MANIFEST, TIMINGS]
