"""Events that the offsets move are told of."""

from __future__ import annotations

from pathlib import Path

from tests.kit.stage import Stage, after, event, lane_change, maneuvers, speed, state_of, to_lane, when
from xosc_lateral.workflows.conversion.meaning import shifts


def test_an_event_that_comes_later_or_not_at_all_is_named(tmp_path: Path) -> None:
    def run(moment: float, *, last: float) -> object:
        first = event(lane_change(to_lane(-2), over=2.0), name="change", trigger=after(moment))
        then = event(speed(25.0), name="then", trigger=when(state_of("change", "completeState")))
        return Stage(tmp_path).play(maneuvers(first, then), last=last).motion

    assert shifts(run(1.0, last=8.0), run(1.04, last=8.0)) == []
    said = list(map(str, shifts(run(1.0, last=8.0), run(1.5, last=3.0))))
    assert said[0] == "event 'change' of 'Ego' at 1.00 s happens 0.50 s later with the offsets"
    sooner = list(map(str, shifts(run(1.5, last=8.0), run(1.0, last=8.0))))
    assert sooner[0] == "event 'change' of 'Ego' at 1.50 s happens 0.50 s earlier with the offsets"
    assert said[1] == "event 'then' of 'Ego' at 3.00 s no longer happens with the offsets"
