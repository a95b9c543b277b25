"""Every effect in blocks: the same terms, to the bit, however a drive is cut."""

from __future__ import annotations

import json
from typing import cast

import numpy as np
import pytest

from tests.kit.certified import FOLDER, contexts
from tests.kit.effects import EXAMPLES, OF_OTHER_COLUMNS, made
from tests.kit.profiles import whole_terms
from xosc_lateral.drivers.model.effects import (
    EFFECTS,
    ColumnEffect,
    Effect,
    EffectTerms,
    HiddenEffect,
    Linear,
    known_effects,
)
from xosc_lateral.drivers.model.effects.response import Response, ResponseState, respond
from xosc_lateral.drivers.model.records import plain, read_as
from xosc_lateral.files.profiles import read_profile

STEP = 0.2
N = 500
BLOCKS = (1, 1, 2, 40, 1, 155, 300)
PROFILE = read_profile(FOLDER / "two-level-effects.json")
EFFECTS_HERE: tuple[Effect, ...] = (
    *PROFILE.effects,
    *(effect for effect in EXAMPLES if effect.kind not in {there.kind for there in PROFILE.effects}),
    made(Linear, 0.5, column="x", episode=0.8, response_s=1.3, lag_s=-0.5),
)
"""The certified profile's, and one of each kind that version 0.1 did not have."""
COLUMNED = {f"{k}-{effect.kind}": effect for k, effect in enumerate(EFFECTS_HERE) if effect.columns}
HIDDEN = {effect.kind: effect for effect in EFFECTS_HERE if not effect.columns}


def cut(values: np.ndarray) -> list[np.ndarray]:
    return np.split(values, np.cumsum(BLOCKS)[:-1])


def same(one: EffectTerms, other: EffectTerms) -> None:
    for name in ("location", "spread", "rate", "fine"):
        a, b = getattr(one, name), getattr(other, name)
        assert (a is None) == (b is None)
        if a is not None:
            np.testing.assert_array_equal(a, b)


def joined(parts: list[EffectTerms]) -> EffectTerms:
    columns = ([getattr(part, name) for part in parts] for name in ("location", "spread", "rate", "fine"))
    return EffectTerms(*(None if own[0] is None else np.concatenate(own) for own in columns))


def test_every_effect_is_here() -> None:
    every = (*COLUMNED.values(), *HIDDEN.values(), *OF_OTHER_COLUMNS)
    assert {effect.kind for effect in every} == {kind.kind for kind in EFFECTS}
    assert set(EFFECTS) <= set(known_effects())


@pytest.mark.parametrize("kind", HIDDEN)
def test_hidden_effects_go_on_from_their_state_and_from_a_saved_one(kind: str) -> None:
    effect, time = cast(HiddenEffect, HIDDEN[kind]), 7.0 + STEP * np.arange(N)
    whole = whole_terms(effect, time, {}, np.random.default_rng(4))
    state = effect.begin(np.random.default_rng(4), STEP)
    parts = []
    for rows in cut(time):
        state = read_as(effect.State, json.loads(json.dumps(plain(state))))
        parts.append(effect.advance(state, rows, STEP))
    pieces = joined(parts)
    if kind == "drift":  # of a grid that begins at 7 s the step is 0.2 s to rounding only
        np.testing.assert_allclose(pieces.location, whole.location, rtol=0, atol=1e-12)  # type: ignore[arg-type]
    elif kind == "time-smooth":  # a sum over half cosines is rounded by how many rows there are
        for name in ("location", "spread", "fine"):
            np.testing.assert_allclose(getattr(pieces, name), getattr(whole, name), rtol=0, atol=1e-15)
    elif kind == "cycle":
        np.testing.assert_allclose(pieces.location, whole.location, rtol=0, atol=1e-9)  # type: ignore[arg-type]
    else:
        same(pieces, whole)


@pytest.mark.parametrize("name", COLUMNED)
def test_column_effects_respond_in_blocks_as_to_the_whole(name: str) -> None:
    effect, context = cast(ColumnEffect, COLUMNED[name]), contexts(N)
    context |= {"x": context["lead_distance"], "y": context["speed"]}
    whole = whole_terms(effect, STEP * np.arange(N), context, np.random.default_rng(0))
    response, parts = effect.response_in_blocks(STEP), []
    for rows in cut(np.arange(N)):
        parts.append(response.take(effect.known({column: values[rows] for column, values in context.items()})))
        response = effect.response_in_blocks(
            STEP, read_as(ResponseState, json.loads(json.dumps(plain(response.state))))
        )
    last = effect.known({column: values[:0] for column, values in context.items()})
    parts.append(response.finish(last))
    same(effect.acting(np.concatenate(parts)), whole)


@pytest.mark.parametrize("lag_s", [-3.0, -1.3, -0.1, 0.0, 0.1, 0.2, 2.5, 40.0, -150.0, 150.0])
@pytest.mark.parametrize("response_s", [0.0, 2.0])
def test_a_response_holds_no_more_than_it_needs(lag_s: float, response_s: float) -> None:
    values = np.random.default_rng(1).normal(size=(N, 2))
    response = Response(STEP, lag_s, response_s)
    parts, most = [], 0
    for row in values:
        parts.append(response.take(row[None, :]))
        assert response.state.held is not None
        most = max(most, len(response.state.held))
    parts.append(response.finish(values[:0]))
    np.testing.assert_array_equal(np.concatenate(parts), respond(values, STEP, lag_s, response_s))
    assert most <= abs(lag_s) / STEP + 3
