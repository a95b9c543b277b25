"""Events of two runs: what is explained by a lateral action's way, what is another meaning."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from tests.kit.stage import (
    Stage,
    after,
    event,
    lane_change,
    maneuvers,
    on_lane,
    speed,
    state_of,
    teleport,
    to_lane,
    when,
)
from xosc_lateral.workflows.conversion.across import Way
from xosc_lateral.workflows.conversion.equivalent_paths import RUN_NAMES, Runs, Ways, largest_equivalent
from xosc_lateral.workflows.conversion.load import Played
from xosc_lateral.workflows.conversion.result import NOMINAL_RUN
from xosc_lateral.workflows.conversion.shifts import Change, Comparison, compare_runs
from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.motion.offset_path import OffsetPath, PathPiece, resized


def _compare(before: Played, after_: Played) -> Comparison:
    return compare_runs(before.scenario, before.network, before.motion, after_.motion)


def test_an_event_that_comes_later_or_not_at_all_is_named(tmp_path: Path) -> None:
    def run(moment: float, *, last: float) -> Played:
        first = event(lane_change(to_lane(-2), over=2.0), name="change", trigger=after(moment))
        then = event(speed(25.0), name="then", trigger=when(state_of("change", "completeState")))
        return Stage(tmp_path).play(maneuvers(first, then), last=last)

    assert _compare(run(1.0, last=8.0), run(1.04, last=8.0)).changes == ()
    found = list(map(str, _compare(run(1.0, last=8.0), run(1.5, last=8.0)).changes))
    # What waits for it comes later by as much, and is not named again.
    assert found == ["event 'change' of 'Ego' at 1.00 s happens 0.50 s later with the offsets"]
    sooner = list(map(str, _compare(run(1.5, last=8.0), run(1.0, last=8.0)).changes))
    assert sooner[0] == "event 'change' of 'Ego' at 1.50 s happens 0.50 s earlier with the offsets"
    shorter = list(map(str, _compare(run(1.0, last=8.0), run(1.0, last=2.5)).changes))
    assert not [line for line in shorter if "then" in line]  # due after that run's end


def test_an_event_that_is_missing_is_named(tmp_path: Path) -> None:
    def run(state: str) -> Played:
        first = event(lane_change(to_lane(-2), over=2.0), name="change", trigger=after(1.0))
        then = event(speed(25.0), name="then", trigger=when(state_of("change", state)))
        return Stage(tmp_path).play(maneuvers(first, then), last=8.0)

    (change,) = _compare(run("completeState"), run("skipTransition")).changes
    assert str(change.note) == "event 'then' of 'Ego' at 3.00 s no longer happens with the offsets"


AS_BEFORE = Comparison((), (), run=NOMINAL_RUN)


def _without_event(entity: str) -> Comparison:
    change = Change(f"event 'cut in' of '{entity}' at 8.00 s", entity, 8.0, "no longer happens")
    return Comparison((), (change,), run=NOMINAL_RUN)


def _path(entity: str, after: tuple[str, ...] | None) -> OffsetPath:
    piece = PathPiece(np.array([0.0, 50.0, 100.0]), np.array([0.0, 0.1, -0.1]))
    return OffsetPath(entity, after, (piece,))


def _nobody() -> NominalMotion:
    return NominalMotion(0.02, (), end_time=20.0, ended_by="stop trigger", notes=())


def _largest(path: OffsetPath) -> float:
    return max(float(np.abs(piece.offset).max()) for piece in path.pieces)


def test_the_smallest_change_that_helps_is_one_path_of_one_vehicle() -> None:
    """Planted: what A does before its maneuver changes an event if it is larger than a third of what was sampled."""
    change = Comparison(
        (), (Change("event 'cut in' of 'A' at 8.00 s", "A", 8.0, "no longer happens"),), run=NOMINAL_RUN
    )
    paths = [_path("A", None), _path("A", ("late",)), _path("B", None)]

    def attempt(some: Sequence[OffsetPath], _: object) -> tuple[None, Runs]:
        large = [one for one in some if one.entity == "A" and one.after is None and _largest(one) > 0.034]
        return None, iter([(change if large else AS_BEFORE, _nobody())])

    *_, kept = largest_equivalent(lambda _: paths, _nobody(), attempt)
    assert kept.changes == ()
    assert [_largest(path) for path in kept.paths] == [pytest.approx(0.025), 0.1, 0.1]
    assert kept.smaller == {"A": (0.25, False)}
    assert "offsets of 'A' are 0.25 times what was sampled before a maneuver" in next(kept.warnings(())).what


def test_lane_changes_lead_across_as_far_as_that_changes_nothing() -> None:
    """Planted: drivers' way of A's lane change costs an event, the written one that ends aside does not."""
    change = Comparison(
        (), (Change("event 'cut in' of 'B' at 8.00 s", "B", 8.0, "no longer happens"),), run=NOMINAL_RUN
    )
    tried = list[list[tuple[str, Way]]]()

    def made(ways: Ways) -> list[OffsetPath]:
        led = [replace(_path(name, ("across",)), instead=True) for name in "AC" if ways.get(name) is not Way.WRITTEN]
        tried.append([*ways.items()])
        return [_path("A", None), *led, _path("B", None)]

    def attempt(some: Sequence[OffsetPath], _: object) -> tuple[None, Runs]:
        leads = any(one.instead and one.entity == "A" for one in some) and ("A", Way.ASIDE) not in tried[-1]
        return None, iter([(change if leads else AS_BEFORE, _nobody())])

    *_, kept = largest_equivalent(made, _nobody(), attempt)
    assert kept.changes == () and kept.smaller == {} and kept.ways == {"A": Way.ASIDE}
    assert not any(name == "C" for ways in tried for name, _ in ways)
    assert "end where its driver is then" in next(kept.warnings(())).what


def test_less_is_looked_for_where_something_differed_and_is_kept_if_it_changes_nothing_elsewhere() -> None:
    """Planted: all that A moves costs an event in one run; a quarter mends it, and half of it does, but costs another
    event in another run."""
    paths, played = [_path("A", None), _path("A", ("late",))], list[tuple[float, str]]()

    def attempt(some: Sequence[OffsetPath], first: Collection[str]) -> tuple[float, Runs]:
        size = max((_largest(path) / 0.1 for path in some if path.after is None), default=0.0)

        def runs() -> Iterator[tuple[Comparison, NominalMotion]]:
            for run in sorted(RUN_NAMES[:3], key=lambda run: run not in first):
                played.append((size, run))
                lost = (size > 0.6) if run == RUN_NAMES[2] else (0.3 < size < 0.6 and run == RUN_NAMES[1])
                yield replace(_without_event("A") if lost else AS_BEFORE, run=run), _nobody()

        return size, runs()

    size, nominal, kept = largest_equivalent(lambda _: paths, _nobody(), attempt)
    assert size == pytest.approx(0.25) and nominal is not None and kept.changes == ()
    assert [one.run for one in kept.comparisons] == [*RUN_NAMES[:3]], "what is kept was played in all runs, in order"
    assert [run for size, run in played if size == 0.0][:1] == [RUN_NAMES[2]]
    assert (0.0, NOMINAL_RUN) not in played[:5], "whether its staying mends something shows where something differed"


def test_what_no_change_of_offsets_helps_against_is_told_and_costs_nobody_offsets() -> None:
    change = Comparison(
        (), (Change("event 'cut in' of 'A' at 8.00 s", "A", 8.0, "no longer happens"),), run=NOMINAL_RUN
    )
    paths = [_path("A", None), _path("B", None)]
    *_, kept = largest_equivalent(lambda _: paths, _nobody(), lambda *_: (None, iter([(change, _nobody())])))
    assert kept.paths == tuple(paths) and kept.smaller == {}
    assert kept.changes == change.changes


def test_nobody_moves_farther_than_was_sampled_whatever_is_tried() -> None:
    """Who is content with nothing less than nobody's moving sees all trials: none is larger than what was sampled."""
    places = np.random.default_rng(3).uniform(-0.4, 0.4, (2, 6)).round(3)
    paths = [
        OffsetPath(
            entity, None, (PathPiece(20.0 * np.arange(6.0), row),), placed_t=float(row[0]) - 1.75, start=float(row[0])
        )
        for entity, row in zip("AB", places, strict=True)
    ]
    tried: list[OffsetPath] = []

    def attempt(some: Sequence[OffsetPath], _: object) -> tuple[None, Runs]:
        tried.extend(some)
        moves = any(path.entity == "A" for path in some)
        return None, iter([(_without_event("A") if moves else AS_BEFORE, _nobody())])

    largest_equivalent(lambda _: paths, _nobody(), attempt)
    assert len({path.start for path in tried}) == 4
    for path in tried:
        sampled = places["AB".index(path.entity)]
        for piece in path.pieces:
            assert (np.abs(piece.offset) <= np.abs(sampled) + 1e-6).all() and (piece.offset * sampled >= 0.0).all()
        assert path.placed_t + 1.75 == pytest.approx(path.start), "it begins where its path does"


def test_a_path_of_another_size_begins_nearer_to_the_middle() -> None:
    path = replace(_path("A", None), placed_t=-1.9, side=-1.0, start=0.1)
    half = resized(path, 0.5)
    assert half.pieces[0].offset.tolist() == [0.0, 0.05, -0.05]
    assert half.placed_t == pytest.approx(-1.85)
    assert resized(path, 0.0).pieces == ()


def test_who_is_ignored_may_touch_whoever_else_is_and_nobody_more(tmp_path: Path) -> None:
    """Two cars touch once one is slower; only where both have no offsets of their own is that nobody's fault."""
    start = {"Ego": teleport(on_lane(-1, 10.0)) + speed(20.0), "Lead": teleport(on_lane(-1, 40.0)) + speed(20.0)}

    def run(wanted: float) -> Played:
        return Stage(tmp_path).play(maneuvers(event(speed(wanted), trigger=after(1.0))), start=start, last=8.0)

    before, touching = run(20.0), run(30.0)
    for ignored, count in (((), 1), (("Ego",), 1), (("Lead",), 1), (("Ego", "Lead"), 0)):
        found = compare_runs(before.scenario, before.network, before.motion, touching.motion, ignored=ignored)
        assert sum(change.pair is not None for change in found.changes) == count, ignored


def test_on_which_side_of_a_marking_it_ends_is_nothing_where_it_ends_beside_the_marking(tmp_path: Path) -> None:
    def run(lane: int, aside: float) -> Played:
        return Stage(tmp_path).play(start={"Ego": teleport(on_lane(lane, 10.0, offset=aside)) + speed(10.0)}, last=2.0)

    edge = run(-1, -1.7)
    width = edge.network.lane_state_at(0, -1, 10.0).width
    assert _compare(edge, run(-2, width - 1.8)).changes == (), "0.1 m farther to the right"
    (change,) = _compare(edge, run(-2, -0.5)).changes
    assert change.what == "the last lane of 'Ego', -1,"


def test_contacts_that_are_gone_or_come_at_another_time_are_told(tmp_path: Path) -> None:
    start = {"Ego": teleport(on_lane(-1, 10.0)) + speed(20.0), "Lead": teleport(on_lane(-1, 40.0)) + speed(20.0)}

    def run(wanted: float) -> Played:
        return Stage(tmp_path).play(maneuvers(event(speed(wanted), trigger=after(1.0))), start=start, last=8.0)

    gone = _compare(run(30.0), run(20.0))
    assert [(one.pair, one.how) for one in gone.changes] == [(("Ego", "Lead"), "no longer happens")]
    moved = _compare(run(30.0), run(25.0))
    (finding,) = moved.findings  # 25 m to close at 10 or 5 m/s
    assert not moved.changes and finding.size == pytest.approx(2.5, abs=0.15)
    assert str(finding.note(None)).startswith("'Ego' touches 'Lead' 2.")
