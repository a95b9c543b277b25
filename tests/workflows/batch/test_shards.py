"""Parts of a batch that know nothing of each other leave what one run leaves."""

from __future__ import annotations

import random
import subprocess
import sys
import time
from pathlib import Path

import pytest

import xosc_lateral as xl
from tests.kit.fake_converter import convert, convert_and_log
from tests.workflows.batch.test_batch import ROOT, make_inputs, run, states, tree
from xosc_lateral.workflows.batch.batch import STATE_FOLDER, JobState, convert_many
from xosc_lateral.workflows.batch.call import read_shard
from xosc_lateral.workflows.batch.jobs import plan_batch
from xosc_lateral.workflows.batch.journal import FolderInUseError, folder_lock

pytestmark = pytest.mark.pages


def run_part(inputs: Path, folder: Path, number: int, count: int, converter=convert, variants: int = 1):
    batch = plan_batch([inputs], folder, variants=variants).part(number, count)
    return list(convert_many(batch, workers=0, converter=converter))


PART = """
import sys
from pathlib import Path
from tests.workflows.batch.test_shards import run_part
from tests.kit.fake_converter import convert_and_log
inputs, folder, number, count, variants = sys.argv[1:]
run_part(Path(inputs), Path(folder), int(number), int(count), convert_and_log, int(variants))
"""


def started(inputs: Path, folder: Path, number: int, count: int, variants: int) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-c", PART, *map(str, (inputs, folder, number, count, variants))]
    return subprocess.Popen(command, cwd=ROOT)


def test_parts_one_after_another_are_one_run_and_make_nothing_twice(tmp_path):
    inputs, out = make_inputs(tmp_path / "in", 10, broken="bad"), tmp_path / "out"
    run(inputs, tmp_path / "whole", variants=3)
    for number in (3, 1, 4, 2):
        run_part(inputs, out, number, 4, convert_and_log, variants=3)
    assert tree(out) == tree(tmp_path / "whole")
    made = (inputs / "log.txt").read_text().splitlines()
    assert len(made) == len(set(made)) == 33
    again = run(inputs, out, variants=3)
    assert {state for name, state in states(again).items() if "broken" not in name} == {JobState.UP_TO_DATE}


def test_variants_of_a_scenario_stay_in_one_part_where_that_is_even(tmp_path):
    batch = plan_batch([make_inputs(tmp_path / "in", 4)], tmp_path / "out", variants=2)
    parts = [batch.part(number, 4) for number in range(1, 5)]
    assert [len({job.source for job in part.jobs}) for part in parts] == [1, 1, 1, 1]
    assert [job.name for part in parts for job in part.jobs] == [job.name for job in batch.jobs]
    assert sorted(len(batch.part(number, 13)) for number in range(1, 14)) == [0] * 5 + [1] * 8


def test_parts_at_once_killed_now_and_then_leave_the_bytes_of_one_run(tmp_path):
    special = {f"slow{index}": "slow" for index in range(6)}
    inputs, out, count = make_inputs(tmp_path / "in", 20, **special), tmp_path / "out", 3
    rng = random.Random(1)
    for _ in range(2):  # a kill somewhere, also while modules are imported or the manifest is written
        parts = [started(inputs, out, number, count, 4) for number in range(1, count + 1)]
        time.sleep(rng.uniform(1.0, 2.5))
        parts[rng.randrange(count)].kill()
        for part in parts:
            part.wait()
    for part in [started(inputs, out, number, count, 4) for number in range(1, count + 1)]:
        assert part.wait() == 0
    run(inputs, tmp_path / "calm", variants=4)
    assert tree(out) == tree(tmp_path / "calm")
    assert not (out / STATE_FOLDER).exists()


def test_the_whole_goes_on_where_a_part_was_stopped(tmp_path):
    inputs, out = make_inputs(tmp_path / "in", 6), tmp_path / "out"
    stopped = convert_many(plan_batch([inputs], out).part(2, 2), workers=0, converter=convert)
    next(stopped)
    stopped.close()
    assert list((out / STATE_FOLDER).iterdir())
    became = states(run(inputs, out))
    assert [name for name, state in became.items() if state is JobState.UP_TO_DATE] == ["003.xosc"]
    run(inputs, tmp_path / "calm")
    assert tree(out) == tree(tmp_path / "calm") and not (out / STATE_FOLDER).exists()


def test_whole_and_part_refuse_each_other_and_name_the_folder(tmp_path, monkeypatch):
    inputs, out = make_inputs(tmp_path / "in", 2), tmp_path / "out"
    monkeypatch.setattr("xosc_lateral.workflows.batch.batch.MERGE_TIME", 0.1)
    with folder_lock(out / STATE_FOLDER / "lock"), pytest.raises(FolderInUseError, match=f"^{out}: another run"):
        run_part(inputs, out, 1, 2)
    with folder_lock(out / STATE_FOLDER / "1-of-2" / "lock"):
        with pytest.raises(FolderInUseError, match=f"^{out}: another run"):
            run(inputs, out)
        assert len(run_part(inputs, out, 2, 2)) == 1  # another part may


@pytest.mark.parametrize("text", ["0/3", "4/3", "3", "a/b", "1/0", "-1/3", "1/2/3", ""])
def test_a_part_that_can_not_be_is_refused(text):
    with pytest.raises(ValueError, match="expected K/N"):
        read_shard(text)


def test_from_the_call_with_pages_and_verification(tmp_path):
    xl.write_template("braking-leader", tmp_path / "in")
    options = {"variants": 3, "seed": 2}
    whole = xl.convert_many(tmp_path / "in", tmp_path / "one" / "out", report=tmp_path / "one" / "out", **options)
    assert whole.failed == 0
    for number in (2, 1):
        out = tmp_path / "parts" / "out"  # the index names the folder
        xl.convert_many(tmp_path / "in", out, report=out, shard=f"{number}/2", **options)
    assert tree(out) == tree(tmp_path / "one" / "out")
    assert xl.verify(out).failing == () and len(xl.verify(out).checked) == 3
