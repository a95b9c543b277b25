"""The same engine on a dask.distributed cluster."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.kit.fake_converter import convert, convert_and_log
from tests.workflows.batch.test_batch import make_inputs, run, states, tree
from xosc_lateral.workflows.batch import workers as dask_cluster
from xosc_lateral.workflows.batch.batch import JobState, convert_many
from xosc_lateral.workflows.batch.jobs import plan_batch
from xosc_lateral.workflows.batch.workers import ClusterError

dask = pytest.importorskip("dask")
distributed = pytest.importorskip("distributed")

pytestmark = pytest.mark.filterwarnings("default")  # what dask's own clean-up leaves unclosed is not for us to fix


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=logging.CRITICAL
        ) as cluster,
    ):
        yield cluster.scheduler_address


def test_a_cluster_leaves_the_same_bytes_although_a_worker_is_killed(tmp_path: Path, cluster: str) -> None:
    inputs = make_inputs(tmp_path / "in", 10, broken="bad", **{f"slow{index}": "slow" for index in range(20)})
    outcomes = []
    for outcome in convert_many(plan_batch([inputs], tmp_path / "out"), cluster=cluster, converter=convert_and_log):
        outcomes.append(outcome)
        if len(outcomes) == 8:
            os.kill(int((inputs / "log.txt").read_text().splitlines()[-1].split()[0]), signal.SIGKILL)
    assert len({line.split()[0] for line in (inputs / "log.txt").read_text().splitlines()}) >= 2
    assert [name for name, state in states(outcomes).items() if state is JobState.FAILED] == ["broken.xosc"]
    run(inputs, tmp_path / "calm", convert)
    assert tree(tmp_path / "out") == tree(tmp_path / "calm")


def test_a_scenario_that_kills_every_worker_costs_one_row(tmp_path: Path, cluster: str) -> None:
    inputs = make_inputs(tmp_path / "in", 4, killer="crash")
    outcomes = list(convert_many(plan_batch([inputs], tmp_path / "out"), cluster=cluster, converter=convert))
    assert [name for name, state in states(outcomes).items() if state is JobState.FAILED] == ["killer.xosc"]
    assert len(outcomes) == 5


@pytest.mark.pages
@pytest.mark.parametrize("is_lost", [True, False])
def test_a_result_that_comes_as_its_worker_dies_is_lost_and_not_a_bug(is_lost: bool) -> None:
    async def result_of(*, raiseit: bool) -> object:
        try:
            raise ValueError("a bug")
        except ValueError as error:
            return "a result" if is_lost else (type(error), error, error.__traceback__)

    future: Future[object] = Future()
    theirs = SimpleNamespace(_result=result_of, status="lost")

    async def cascade() -> None:
        await distributed.cfexecutor._cascade_future(theirs, future)

    asyncio.run(cascade())
    pool = object.__new__(dask_cluster._Cluster)
    pool._client = SimpleNamespace(status="running")
    error = future.exception()
    assert error is not None and pool.lost(error) is is_lost


@pytest.mark.pages
def test_no_scheduler_at_the_address_is_said_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_cluster, "CONNECT_TIMEOUT", 0.5)
    batch = plan_batch([make_inputs(tmp_path / "in", 1)], tmp_path / "out")
    with pytest.raises(ClusterError, match=r"no dask scheduler answers at tcp://127\.0\.0\.1:9"):
        list(convert_many(batch, cluster="tcp://127.0.0.1:9", converter=convert))
