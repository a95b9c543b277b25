"""What somebody else put into the folders: modules and links that nothing of ours may run or follow, and signals."""

from __future__ import annotations

import errno
import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

import xosc_lateral as xl
from tests.kit.fake_converter import convert
from tests.workflows.batch.test_batch import ROOT, make_inputs, run
from xosc_lateral.base.signals import Interrupted
from xosc_lateral.files.atomic import files_of_run, replace_atomically, write_atomically
from xosc_lateral.files.source import hash_of
from xosc_lateral.workflows.batch import jobs
from xosc_lateral.workflows.batch.batch import STATE_FOLDER, BatchStoppedError, JobState, convert_many
from xosc_lateral.workflows.batch.jobs import plan_batch
from xosc_lateral.workflows.conversion import convert as convert_module

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="POSIX links and signals")

NOT_YET = sorted({*packages_distributions(), "pickle", "numpy", "typer"} - {"xosc_lateral"})
"""Names of modules that are imported after our own first line."""


@pytest.mark.pages
@pytest.mark.parametrize("how", ["script", "module"])
def test_modules_in_the_folder_of_scenarios_never_run(tmp_path: Path, how: str) -> None:
    database, mark, script = tmp_path / "db", tmp_path / "ran", tmp_path / "bin" / "run.py"
    xl.write_template("cut-in", database)
    (database / "second.xosc").write_bytes((database / "cut-in.xosc").read_bytes())
    names = {*NOT_YET, "sitecustomize", *(sys.stdlib_module_names if how == "script" else ())}
    for name in names:
        (database / f"{name}.py").write_text(f"open({str(mark)!r}, 'a').write({name!r} + ' ')\n", encoding="utf-8")
    (database / ".numba_config.yaml").write_text(f"cache_dir: {database}\n")
    script.parent.mkdir()
    script.write_text("from xosc_lateral.cli import main\nmain()\n")
    words = [str(script)] if how == "script" else ["-m", "xosc_lateral"]
    words += ["convert", ".", "-o", "../out", "--jobs", "2", "--time-limit", "2", "-q"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, *words], cwd=database, env=environment, capture_output=True, text=True)
    assert not mark.exists(), mark.read_text()
    assert done.returncode == 0, done.stderr
    assert len(list((tmp_path / "out").glob("*.xosc"))) == 2


@pytest.mark.parametrize("name", [f"{STATE_FOLDER}/lock", f"{STATE_FOLDER}/journal.jsonl", STATE_FOLDER])
@pytest.mark.parametrize("kind", ["link", "hard link", "fifo"])
def test_state_files_that_lead_elsewhere_are_refused(tmp_path: Path, name: str, kind: str) -> None:
    inputs, out, victim = make_inputs(tmp_path / "in", 1), tmp_path / "out", tmp_path / "folder" / "lock"
    place = out / name
    place.parent.mkdir(parents=True)
    victim.parent.mkdir()
    victim.write_text("precious")
    if kind == "fifo":
        os.mkfifo(place)
    elif kind == "link":
        place.symlink_to(victim.parent if name == STATE_FOLDER else victim)
    else:
        os.link(victim, place)
    with pytest.raises(xl.XoscLateralError, match=re.escape(str(place))) as error:
        run(inputs, out)
    assert "\n" not in str(error.value)
    assert victim.read_text() == "precious"
    place.unlink()
    assert [outcome.state for outcome in run(inputs, out)] == [JobState.WRITTEN]


@pytest.mark.parametrize("inner", ["sub", "sub/deep"])
@pytest.mark.parametrize("root", ["out", "pages"])
def test_a_link_in_place_of_a_folder_of_outputs_or_pages_is_not_followed(
    tmp_path: Path, root: str, inner: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is converted does not matter here: a text, and its page another one."""
    text, page = "<!-- xosc-lateral provenance: none -->", '<meta name="generator" content="xosc-lateral 0">'
    monkeypatch.setattr(convert_module, "convert_scenario", lambda _, path, *__, **___: write_atomically(path, text))
    monkeypatch.setattr(jobs, "_described", lambda job, _: replace(job.row(), output_sha256=hash_of(text.encode())))
    monkeypatch.setattr("xosc_lateral.workflows.conversion.page.conversion_page", lambda _: page)
    monkeypatch.setattr("xosc_lateral.workflows.playing.figures.thumbnail", lambda _: "")
    monkeypatch.setattr(Path, "movement", None, raising=False)
    victim, place = tmp_path / "victim", tmp_path / root / inner
    for folder in ("in/sub/deep", "in/other"):
        xl.write_template("cut-in", tmp_path / folder)
    victim.mkdir()
    place.parent.mkdir(parents=True)
    place.symlink_to(victim)
    made = xl.convert_many(tmp_path / "in", tmp_path / "out", report=tmp_path / "pages", workers=0)
    failed, done = made.to_dict()["outputs"][::-1]
    assert (failed["output"], done["error"]) == ("sub/deep/cut-in.xosc", "")
    assert failed["error"] == f"{place}: is a link, which is not followed here: remove it"
    assert not list(victim.iterdir())
    place.unlink()
    assert not xl.convert_many(tmp_path / "in", tmp_path / "out", report=tmp_path / "pages", workers=0).failed


def test_a_run_leaves_the_temporary_files_of_others_alone_and_removes_those_of_killed_ones(tmp_path: Path) -> None:
    inputs, out = make_inputs(tmp_path / "in", 2), tmp_path / "out"
    (out / STATE_FOLDER).mkdir(parents=True)
    others, killed = "0123456789ab", "ba9876543210"
    (out / STATE_FOLDER / "lock").write_text(json.dumps({"pid": 1, "host": "x", "runs": [killed, "../..", 5]}))
    left: list[Path] = []
    for name in (others, killed):
        with files_of_run(name), pytest.raises(OSError, match=r"a\.xosc"):

            def stopped(path: Path) -> None:
                path.rename(path.with_name(f"{path.name}.kept"))
                left.append(path)
                raise InterruptedError

            replace_atomically(out / "sub" / "a.xosc", stopped)
    for path in left:
        path.with_name(f"{path.name}.kept").rename(path)
    run(inputs, out)
    assert [path.exists() for path in left] == [True, False]


def test_a_folder_that_is_up_to_date_need_not_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(path: Path) -> None:
        raise OSError(errno.EROFS, "Read-only file system", str(path))

    inputs, out = make_inputs(tmp_path / "in", 2), tmp_path / "out"
    run(inputs, out)
    monkeypatch.setattr("xosc_lateral.workflows.batch.journal.open_own", refused)
    assert [outcome.state for outcome in run(inputs, out)] == [JobState.UP_TO_DATE] * 2
    (inputs / "000.xosc").write_text("<OpenSCENARIO><Storyboard/></OpenSCENARIO>")
    with pytest.raises(BatchStoppedError, match="lock: Read-only file system"):
        run(inputs, out)


STOPPED_RUN = """
import sys
from tests.kit.fake_converter import convert
from xosc_lateral.workflows.batch import batch
batch.convert_job = convert
from xosc_lateral.cli import main
main(None)
"""


def _answer_interrupts() -> None:
    """In a process that is about to begin: shells and CI start what runs in the background with SIGINT ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.pages
@pytest.mark.parametrize(("number", "workers"), [(signal.SIGINT, 2), (signal.SIGTERM, 1), (signal.SIGHUP, 1)])
def test_a_signal_is_one_line_with_the_number_of_finished_outputs(
    tmp_path: Path, number: signal.Signals, workers: int
) -> None:
    inputs = make_inputs(tmp_path / "in", 8, **{f"slow{index}": "slow" for index in range(80)})
    out = tmp_path / "out"
    words = ["convert", str(inputs), "-o", str(out), "--jobs", str(workers), "-q"]
    command = [sys.executable, "-c", STOPPED_RUN, *words]
    with subprocess.Popen(
        command,
        cwd=ROOT,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=_answer_interrupts,
    ) as process:
        while len(list(out.glob("*.xosc"))) < 10:
            assert process.poll() is None
            time.sleep(0.02)
        os.killpg(process.pid, number)  # as a terminal does: workers get it, too
        _, said = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    there = len(list(out.glob("*.xosc")))
    assert 10 <= there < 88
    assert said == f"xosc-lateral: interrupted; {there} outputs in {out} are finished, and the same command continues\n"
    assert not list(out.glob(".*.tmp*"))
    states = [outcome.state for outcome in convert_many(plan_batch([inputs], out), workers=0, converter=convert)]
    assert states.count(JobState.UP_TO_DATE) == there and len(states) == 88


def test_a_run_that_is_stopped_at_once_counts_what_was_there(tmp_path: Path) -> None:
    inputs, out = make_inputs(tmp_path / "in", 5), tmp_path / "out"
    run(inputs, out)

    def stop(row: object) -> None:
        raise Interrupted(signal.SIGTERM)

    with pytest.raises(Interrupted) as stopped:
        xl.convert_many(inputs, out, on_outcome=stop, workers=0, force=True)
    assert stopped.value.finished == 5


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_any_other_verb_in_one_line(number: signal.Signals) -> None:
    script = "import sys, xosc_lateral.extras.live.stdio as s\nfrom xosc_lateral.cli import main\n"
    script += "s.Pipe.answers = lambda self, lines: iter([print('ready', flush=True), *lines])\nmain(None)\n"
    words = [sys.executable, "-c", script, "live", "stdio"]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(words, cwd=ROOT, text=True, preexec_fn=_answer_interrupts, **pipes) as process:
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
        process.send_signal(number)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert said.count("\n") == 1 and said.startswith("xosc-lateral: interrupted;")
