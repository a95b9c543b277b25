"""One effect's response, row by row, against the whole drive at once."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.kit.effects import STEP, made
from tests.kit.profiles import whole_terms
from xosc_lateral.drivers.model.effects import ColumnEffect, Linear, Product
from xosc_lateral.drivers.model.effects.shapes import Factor
from xosc_lateral.drivers.model.group import ResponseStream, ResponseStreamState
from xosc_lateral.drivers.model.records import plain, read_as

N = 120

EFFECTS: dict[str, ColumnEffect] = {
    "at once": made(Linear, 0.15, column="x"),
    "late": made(Linear, 0.15, column="x", lag_s=1.3),
    "slow": made(Linear, 0.15, column="x", response_s=2.0),
    "ahead": made(Linear, 0.15, column="x", lag_s=-2.5, response_s=0.8),
    "ahead by whole steps": made(Linear, 0.15, column="x", lag_s=-10 * STEP),
    "of two columns": made(Product, 0.15, factors=(Factor(column="x"), Factor(column="y")), lag_s=-0.7),
}


def context(seed: int = 1) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    values = {name: np.cumsum(rng.normal(size=N)) for name in ("x", "y")}
    values["x"][40:45] = np.nan  # there was none for a second
    return values


def row(values: dict[str, np.ndarray], at: int) -> dict[str, np.ndarray]:
    """A row of context; the last one is given again where the drive has none left to look ahead to."""
    return {name: column[min(at, N - 1)][None] for name, column in values.items()}


def of_one_driver(effect: ColumnEffect) -> ResponseStream:
    stream = ResponseStream(effect, STEP)
    stream.join([effect.coefficients])
    return stream


def by_rows(effect: ColumnEffect, values: dict[str, np.ndarray], stop: int = N) -> tuple[list[float], ResponseStream]:
    stream = of_one_driver(effect)
    for at in range(stream.ahead):
        stream.see(row(values, at))
    found = []
    for at in range(stop):
        stream.see(row(values, at + stream.ahead))
        terms = stream.next()
        assert terms.location is not None and terms.location.shape == (1,)
        found.append(float(terms.location[0]))
    return found, stream


@pytest.mark.parametrize("name", EFFECTS)
def test_rows_one_by_one_are_the_drive_as_a_whole(name: str) -> None:
    effect, values = EFFECTS[name], context()
    whole = whole_terms(effect, STEP * np.arange(N), values, np.random.default_rng(0)).location
    np.testing.assert_array_equal(by_rows(effect, values)[0], whole)


def test_only_what_lies_ahead_has_to_be_known_before() -> None:
    assert ResponseStream(EFFECTS["at once"], STEP).ahead == 0
    assert ResponseStream(EFFECTS["slow"], STEP).ahead == 0
    assert ResponseStream(EFFECTS["ahead by whole steps"], STEP).ahead == 10
    assert ResponseStream(EFFECTS["ahead"], STEP).ahead == 13  # 2.5 s are 12.5 steps


@pytest.mark.parametrize("name", EFFECTS)
def test_rows_before_the_drive_are_seen_but_get_no_response(name: str) -> None:
    """What was before the drive counts for a slow response: the drive goes on as if it had begun back there."""
    effect, values, begin = EFFECTS[name], context(), 30
    stream = of_one_driver(effect)
    for at in range(begin):
        stream.see(row(values, at), before=True)
    for at in range(begin, begin + stream.ahead):
        stream.see(row(values, at))
    found = []
    for at in range(begin, N):
        stream.see(row(values, at + stream.ahead))
        location = stream.next().location
        assert location is not None
        found.append(float(location[0]))
    np.testing.assert_array_equal(found, by_rows(effect, values)[0][begin:])


@pytest.mark.parametrize("name", EFFECTS)
@pytest.mark.parametrize("stop", [1, 7, 50])
def test_a_state_that_went_through_json_goes_on_as_if_nothing_had_been(name: str, stop: int) -> None:
    effect, values = EFFECTS[name], context(2)
    begun, stream = by_rows(effect, values, stop)
    saved = read_as(ResponseStreamState, json.loads(json.dumps(plain(stream.state))))
    other = of_one_driver(effect)
    other.restore(saved)
    rest = []
    for at in range(stop, N):
        other.see(row(values, at + other.ahead))
        location = other.next().location
        assert location is not None
        rest.append(float(location[0]))
    np.testing.assert_array_equal([*begun, *rest], by_rows(effect, values)[0])
