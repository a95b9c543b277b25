"""The machine of scenarios finds what is planted, shrinks it, and finds nothing in a source against itself."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from laboratory.find import player
from laboratory.find.engine import Finding, shrink, spec_of
from laboratory.find.judge import compares, told
from laboratory.find.scenarios import Planted, Scenarios

pytestmark = pytest.mark.pages
REAL = os.environ.get("ESMINI_LIBRARY")
Run = dict[str, Any]


def late(run: Run) -> Run:
    """The last event starts 0.3 s later, and ends so."""
    name = next((name for name, _, state, _ in reversed(run["states"]) if state == player.RUNNING), None)
    states = [(one, kind, state, t + 0.3 * (one == name)) for one, kind, state, t in run["states"]]
    return {**run, "states": states}


def aside(run: Run) -> Run:
    """Whoever is not Ego drives 1 m to the left."""
    for name, rows in run["rows"].items():
        if name != "Ego":
            rows[:, 1:3] += np.stack([-np.sin(rows[:, 3]), np.cos(rows[:, 3])], axis=1)
            rows[:, 7] += 1.0
    return run


def doubled(run: Run) -> Run:
    """Whoever is not Ego stays for a frame, and all his way comes one later."""
    for name, rows in run["rows"].items():
        if name != "Ego" and len(rows) > 300:
            rows[300:, 1:] = rows[299:-1, 1:].copy()
    return run


def lost(run: Run) -> Run:
    """The last event never comes."""
    name = next((name for name, _, state, _ in reversed(run["states"]) if state == player.RUNNING), None)
    return {**run, "states": [one for one in run["states"] if one[0] != name]}


def first_found(machine: Planted, kind: str) -> tuple[int, Finding]:
    """Seed and finding; within ten seeds."""
    for seed in range(10):
        found = [one for one in machine.look(spec_of(machine, seed)) if one["kind"].startswith(kind)]
        if found:
            return seed, found[0]
    raise AssertionError(f"{kind}: not found")


@pytest.mark.parametrize(
    ("plant", "kind"),
    [(late, "event starts later"), (aside, "swerves"), (doubled, "jumps along"), (lost, "event lost")],
)
def test_a_planted_fault_is_found_and_shrunk(plant: Callable[[Run], Run], kind: str) -> None:
    machine = Planted(plant)
    seed, found = first_found(machine, kind)
    spec, again = shrink(machine, spec_of(machine, seed), found)
    assert len(spec["vehicles"]) <= 2 and len(spec["events"]) <= 2
    assert again["kind"] == found["kind"] and not again["said"]
    assert machine.look(spec_of(machine, seed)) == machine.look(spec_of(machine, seed))


def test_a_message_that_is_removed_makes_a_finding_silent() -> None:
    finding = {"kind": "event starts later", "who": "A", "event": "e0", "t": 2.0}
    line = "event 'e0' of 'A' at 2.00 s happens 0.30 s later with the offsets"
    assert told(finding, [("A", line)])
    assert not told(finding, [])
    for other in (line.replace("2.00", "5.00"), line.replace("happens 0.30 s later", "is new")):
        assert not told(finding, [("A", other)])
    assert not told(finding, [("B", line.replace("'A'", "'B'").replace("e0", "e1"))])


def test_what_esmini_plays_otherwise_is_told_whenever_another_ego_brings_it_about() -> None:
    finding = {"kind": "event added", "who": "D", "event": "e6", "t": 6.9}
    line = "'D': road '2' has no lane 4: lane change not played (at 7.95 s)"
    assert told({**finding, "ego": "1.2"}, [("D", line)])
    assert not told({**finding, "ego": "nominal"}, [("D", line)])


@pytest.mark.parametrize(("act", "kinds"), [("teleport", set()), ("speed", {"corner"})])
def test_who_is_put_to_a_place_near_by_goes_round_no_corner(act: str, kinds: set[str]) -> None:
    time = 0.01 * np.arange(1000)
    rows = np.zeros((len(time), 9))
    rows[:, 0], rows[:, 1], rows[:, 4] = time, 20.0 * time - 0.4 * (time > 5.0), 20.0
    aside = rows.copy()
    aside[:, 2] = aside[:, 7] = 0.2 * (time <= 5.0)
    spec = {
        "road": {"kind": "plain"}, "vehicles": [{"name": "A", "class": "car"}],
        "events": [{"name": "e0", "of": "A", "do": [[act]], "when": []}],
    }  # fmt: skip
    states = [("e0", player.EVENT, player.RUNNING, 5.0), ("e0", player.EVENT, player.DONE, 5.0)]
    runs = [{"rows": {"A": one}, "states": states, "contacts": {}, "end": 10.0} for one in (rows, aside)]
    found = compares(spec, *runs, ["A"], ["e0"])
    assert {one["kind"] for one in found} & {"corner", "heading", "elsewhere"} == kinds


def test_a_bound_of_the_product_that_is_widened_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("xosc_lateral.world.motion.look.ALONG", 5.0)
    seed, found = first_found(Planted(), "bound is wider: ALONG")
    spec, _ = shrink(Planted(), spec_of(Planted(), seed), found)
    assert len(spec["vehicles"]) <= 2 and len(spec["events"]) <= 2


def test_a_source_against_itself_gives_nothing() -> None:
    """`python -m laboratory.find OUT --null 100` does it for a hundred seeds."""
    machine = Planted()
    assert [one for seed in range(4) for one in machine.look(spec_of(machine, seed))] == []


@pytest.mark.skipif(not REAL, reason="ESMINI_LIBRARY names no library of esmini")
def test_in_the_reference_player_a_seed_gives_the_same_again() -> None:
    machine = Scenarios(REAL)
    spec = spec_of(machine, 2)
    assert machine.look(spec) == machine.look(spec)
    assert not [one for one in machine.look(spec) if one["stage"] == "input"]
