"""What a running batch shows."""

from __future__ import annotations

import io
import json
from dataclasses import replace

import pytest

from tests.workflows.batch.test_manifest import FAILED, ROW
from xosc_lateral.workflows.batch.batch import JobOutcome, JobState
from xosc_lateral.workflows.batch.progress import Display, Summary, follow

OUTCOMES = [
    JobOutcome(JobState.UP_TO_DATE, ROW, 0.0),
    JobOutcome(JobState.WRITTEN, replace(ROW, output="c.xosc"), 0.25),
    JobOutcome(JobState.FAILED, FAILED, 0.1),
]


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("stream", [io.StringIO(), Terminal()], ids=["file", "terminal"])
@pytest.mark.parametrize("display", [Display.AUTO, Display.QUIET])
def test_every_failure_is_a_line(display: Display, stream: io.StringIO) -> None:
    summary = follow(OUTCOMES, 3, display, stream)
    assert "xosc-lateral: b.xosc:3: Event 'x': what\n" in stream.getvalue()
    assert (summary.written, summary.up_to_date, summary.failed) == (1, 1, 1)
    assert summary.failures == [("b.xosc", FAILED.error)]


def test_quiet_shows_nothing_else() -> None:
    stream = Terminal()
    follow(OUTCOMES[:2], 2, Display.QUIET, stream)
    assert stream.getvalue() == ""


def test_the_log_holds_one_object_per_output() -> None:
    stream = io.StringIO()
    follow(OUTCOMES, 3, Display.JSON, stream)
    events = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert [event["event"] for event in events] == ["start", "up to date", "written", "failed", "end"]
    assert events[2]["output"] == "c.xosc"
    assert events[2]["seconds"] == 0.25
    assert events[3]["error"] == FAILED.error
    assert (events[4]["written"], events[4]["failed"], events[4]["total"]) == (1, 1, 3)


def test_rate_and_time_left_leave_out_what_was_up_to_date() -> None:
    summary = Summary(total=100, written=18, failed=2, up_to_date=40, seconds=10.0)
    assert summary.rate == 2.0
    assert summary.time_left == 20.0
    assert summary.text() == "18 written, 40 up to date, 2 failed of 100 in 10.0 s (2.0 per second)"
    assert Summary(total=5).time_left is None
