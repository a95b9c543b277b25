"""Events of two runs: what is explained by a lateral action's way, what is another meaning."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from tests.kit.stage import Stage, after, event, lane_change, maneuvers, speed, state_of, to_lane, when
from xosc_lateral.workflows.conversion.load import Played
from xosc_lateral.workflows.conversion.meaning import SIZES, keep_meaning
from xosc_lateral.workflows.conversion.shifts import Change, Comparison, compare_runs
from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.motion.offset_chain import Move, OffsetChain, Ring, Size, resized


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
    assert str(change) == "event 'then' of 'Ego' at 3.00 s no longer happens with the offsets"


def _chain(entity: str, after: tuple[str, ...] | None) -> OffsetChain:
    return OffsetChain(entity, after, Ring(0.1, (Move(0.0, 3.0, -0.2), Move(0.0, 3.0, 0.2))))


def _nobody() -> NominalMotion:
    return NominalMotion(0.02, (), end_time=20.0, ended_by="stop trigger", notes=())


def test_the_smallest_change_that_helps_is_one_chain_of_one_vehicle() -> None:
    """Planted: what A does before its maneuver changes an event if it is larger than a third of what was sampled."""
    change = Comparison((), (Change("event 'cut in' of 'A' at 8.00 s", "A", 8.0, "no longer happens"),))
    chains = [_chain("A", None), _chain("A", ("late",)), _chain("B", None)]

    def attempt(some: list[OffsetChain]) -> tuple[None, list[Comparison]]:
        large = [one for one in some if one.entity == "A" and one.after is None and one.ring.origin > 0.034]
        return None, [change if large else Comparison((), ())]

    _, kept = keep_meaning(chains, _nobody(), attempt)
    assert kept.changes == ()
    assert [chain.ring.origin for chain in kept.chains] == [pytest.approx(0.025), 0.1, 0.1]
    assert kept.smaller == {"A": (Size(0.25), False)}


def test_a_contact_costs_the_largest_offsets_alone() -> None:
    """Planted: B is touched where it is farther than 0.16 m from the middle; all else stays as it was sampled."""
    change = Comparison((), (Change("contact of 'Ego' and 'B' at 8.0 s", "Ego", 8.0, "is new"),))
    ring = Ring(0.05, (Move(0.0, 3.0, -0.1), Move(0.0, 4.0, 0.25), Move(0.0, 3.0, -0.15)))
    chains = [_chain("A", None), OffsetChain("B", None, ring)]

    def attempt(some: list[OffsetChain]) -> tuple[None, list[Comparison]]:
        ring = next(chain.ring for chain in some if chain.entity == "B")
        place = ring.origin + sum(move.change for move in ring.moves[:2])
        return None, [change if place > 0.16 else Comparison((), ())]

    _, kept = keep_meaning(chains, _nobody(), attempt)
    assert kept.chains[0] == chains[0] and kept.smaller == {"B": (Size(limit=0.75), True)}
    assert [move.change for move in kept.chains[1].ring.moves] == pytest.approx([-0.1, 0.2, -0.1])
    assert "lane offsets of 'B' are at most 0.75 times the largest that was sampled" in next(kept.warnings(()))


def test_what_no_change_of_offsets_helps_against_is_told_and_costs_nobody_offsets() -> None:
    change = Comparison((), (Change("event 'cut in' of 'A' at 8.00 s", "A", 8.0, "no longer happens"),))
    chains = [_chain("A", None), _chain("B", None)]
    _, kept = keep_meaning(chains, _nobody(), lambda _: (None, [change]))
    assert kept.chains == tuple(chains) and kept.smaller == {}
    assert kept.changes == change.changes


def _places(chain: OffsetChain) -> np.ndarray:
    return np.cumsum([chain.ring.origin, *(move.change for move in chain.ring.moves)])


def test_nobody_moves_farther_than_was_sampled_whatever_is_tried() -> None:
    """Whoever contradicts each trial sees all of them: none is larger than the sampled moves, nor on the other side."""
    rng = np.random.default_rng(3)
    places = rng.uniform(-0.4, 0.4, (2, 6)).round(3)
    chains = []
    for entity, row in zip("AB", places, strict=True):
        changes = np.diff(np.append(row, row[0])).tolist()
        ring = Ring(float(row[0]), tuple(Move(0.0, 3.0, change) for change in changes))
        chains.append(OffsetChain(entity, None, ring, placed_t=float(row[0]) - 1.75))
    tried: list[OffsetChain] = []

    def attempt(some: list[OffsetChain]) -> tuple[None, list[Comparison]]:
        tried.extend(some)
        change = Change("event 'cut in' of 'A' at 8.00 s", "A", 8.0, "no longer happens")
        return None, [Comparison((), (change,) if len(tried) < 60 else ())]

    keep_meaning(chains, _nobody(), attempt)
    assert len({chain.ring for chain in tried}) > 6
    for chain in tried:
        sampled = _places(chains["AB".index(chain.entity)])
        assert np.abs(_places(chain)).max() <= np.abs(sampled).max() + 1e-3
        assert abs(chain.placed_t + 1.75 - chain.ring.origin) < 1e-9
    for size in SIZES[:-1]:
        for chain in chains:
            made, sampled = _places(resized(chain, size)), _places(chain)
            low, high = min(sampled.min(), 0.0), max(sampled.max(), 0.0)
            assert low - 1e-3 <= made.min() and made.max() <= high + 1e-3, size
            wanted = size.factor * size.limit * np.abs(sampled).max()
            assert np.abs(made).max() == pytest.approx(wanted, abs=2e-3), size


def test_moves_of_another_size_lead_back_to_where_they_began() -> None:
    chain = replace(_chain("A", None), placed_t=-1.9, side=-1.0)
    half = resized(chain, Size(0.5))
    assert [move.change for move in half.ring.moves] == [-0.1, 0.1]
    assert half.placed_t == pytest.approx(-1.85)
    assert resized(chain, Size(0.0)).ring.moves == ()
