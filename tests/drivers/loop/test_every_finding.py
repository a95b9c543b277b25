"""No finding ends in an exception: every kind, shape and product is described, written, read back and sampled."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

from tests.kit.coarse import STEP, coarse_of, movement, wander
from xosc_lateral.drivers.loop import held_out, selection
from xosc_lateral.drivers.loop.columns import Column, Values
from xosc_lateral.drivers.loop.dictionary import Search
from xosc_lateral.drivers.loop.model import Fitted, Outcome, Term, fit_model
from xosc_lateral.drivers.loop.residual import simulated_runs
from xosc_lateral.drivers.loop.selection import ERROR_BUDGET, Accepted, Selection, select
from xosc_lateral.drivers.loop.terms.between import BetweenTerm
from xosc_lateral.drivers.loop.terms.column import ColumnTerm
from xosc_lateral.drivers.loop.terms.hidden import CycleTerm, RegimesTerm, fit_regimes
from xosc_lateral.drivers.loop.terms.mean import CourseTerm, MeanTerm
from xosc_lateral.drivers.loop.terms.spread import FineNoiseTerm, SlowSpreadTerm, SpreadTerm
from xosc_lateral.drivers.loop.terms.time import StepTerm, TimeMeanTerm, TimeSpreadTerm
from xosc_lateral.drivers.loop.timeline import Coarse
from xosc_lateral.drivers.model.core.base import ModelKind
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Factor, Form, Linear, Product
from xosc_lateral.drivers.model.effects.shapes import (
    Angular,
    Levels,
    Magnitude,
    Nearness,
    Piecewise,
    Proximity,
    Saturating,
    SingleColumnEffect,
    Threshold,
)
from xosc_lateral.files.profiles import read_profile, write_profile

ACTS = Acts.LOCATION
SHAPES: list[ColumnEffect] = [
    Linear(acts=ACTS, column="x"),
    Magnitude(acts=ACTS, column="x"),
    Saturating(acts=ACTS, column="x", middle=0.0, scale=1.0),
    Threshold(acts=ACTS, column="x", at=0.5),
    Threshold(acts=ACTS, column="x", at=0.5, jump=False),
    Piecewise(acts=ACTS, column="x", knots=(-0.5, 0.5)),
    Levels(acts=ACTS, column="lane", levels=(1.0, 2.0)),
    Angular(acts=ACTS, column="heading"),
    Nearness(acts=ACTS, column="gap", scale=20.0),
    Nearness(acts=ACTS, column="gap", presence=True),
    Proximity(acts=ACTS, column="gap", scale=20.0),
    Product(acts=ACTS, factors=(Factor(column="x"), Factor(column="heading", form=Form.SINE, at=360.0))),
    Product(acts=ACTS, factors=(Factor(column="lane", form=Form.EQUALS, at=1.0), Factor(column="y", at=0.2))),
    Product(acts=ACTS, factors=(Factor(column="gap", form=Form.PROXIMITY, at=20.0), Factor(column="x"))),
]
NAMES = [f"{effect.kind}-{number}" for number, effect in enumerate(SHAPES)]


@pytest.fixture(scope="module")
def coarse() -> Coarse:
    """Two drives of ten minutes with every kind of column."""
    rng, n = np.random.default_rng(71), round(1260.0 / STEP)
    x, gap = wander(rng, n, 8.0), 30.0 + 15.0 * wander(rng, n, 20.0)
    columns = {
        "x": x,
        "y": wander(rng, n, 20.0),
        "lane": np.clip(np.round(1.0 + wander(rng, n, 60.0)), 0.0, 2.0),
        "heading": (180.0 + 90.0 * wander(rng, n, 60.0)) % 360.0,
        "gap": np.where(wander(rng, n, 60.0) > 0.3, np.abs(gap), np.nan),
    }
    return coarse_of(movement(rng, 1260.0) + 0.1 * np.maximum(x, 0.0), columns, drives=2)


def goes_through(coarse: Coarse, terms: Sequence[Term], folder: Path) -> Fitted:
    """Describe, write, read back, sample."""
    fitted = fit_model(coarse, terms)
    for key, (term, effects) in fitted.estimates.items():
        described = term.describe(fitted, effects, key)
        assert np.isfinite([described.size_m, described.size_error]).all()
        assert all(np.isfinite(part).all() for _, part in term.removed(fitted, effects))
        term.quantity(coarse, effects)
    profile = held_out.fit_refined(fitted, ModelKind.AUTOREGRESSIVE, "all", None, None)
    path = folder / "all.json"
    write_profile(profile, path)
    read = read_profile(path)
    assert read.effects == profile.effects
    assert np.isfinite(simulated_runs(read, coarse.timeline, np.random.SeedSequence(1), runs=1)).all()
    selected = Selection(tuple(Accepted(term, 1e-6) for term in terms), (), fit_model(coarse, ()), fitted)
    assert selected.without(terms, "why").accepted == ()
    return fitted


@pytest.mark.parametrize("shape", SHAPES, ids=NAMES)
def test_every_shape_acts_on_everything(coarse: Coarse, shape: ColumnEffect, tmp_path: Path) -> None:
    kinds: list[type[ColumnTerm]] = [MeanTerm, SpreadTerm, SlowSpreadTerm, FineNoiseTerm]
    terms: list[Term] = [kind.of(structs.replace(shape, lag_s=0.2, response_s=1.0)) for kind in kinds]
    if isinstance(shape, SingleColumnEffect):
        former = MeanTerm.of(shape)
        sizes = (before := fit_model(coarse, (former,))).sizes[before.mean_part(former)]
        terms = [CourseTerm.over_time(shape, sizes), *terms[1:]]
    goes_through(coarse, terms, tmp_path)


@pytest.mark.parametrize(
    "shape", [one for one in SHAPES if isinstance(one, SingleColumnEffect)], ids=lambda shape: shape.kind
)
def test_a_course_does_what_its_fit_says_whatever_the_shape(coarse: Coarse, shape: SingleColumnEffect) -> None:
    known, timeline = shape.known(coarse.context), coarse.timeline
    mix = np.linspace(1.0, -0.5, known.shape[1])
    response = timeline.respond(known @ mix, 0.0, 1.0)
    late = {0.0: 0.1, 1.0: 0.2, 2.0: 0.3, 3.0: 0.4, 4.0: 0.3, 5.0: 0.2, 6.0: 0.1}
    path = np.sum([weight * timeline.shifted(response, seconds) for seconds, weight in late.items()], axis=0)
    planted = 0.3 * path / path.std()
    offset = planted + 0.3 * movement(np.random.default_rng(72), len(planted) * STEP)
    drives = coarse_of(offset, timeline.context, drives=2)
    term = CourseTerm.over_time(shape, mix)
    (effect,) = term.estimate(fit_model(drives, (term,)))
    assert isinstance(effect, SingleColumnEffect)
    inside = timeline.valid
    assert np.corrcoef(drives.strength(effect)[inside], planted[inside])[0, 1] > 0.9


def hidden_terms(coarse: Coarse) -> list[Term]:
    """One of each."""
    regimes = RegimesTerm(fit_regimes(fit_model(coarse, ()).innovations, coarse.valid))
    by_time: list[Term] = [StepTerm(at=300), TimeMeanTerm(), TimeMeanTerm(1, settling_s=150.0)]
    return [*by_time, TimeSpreadTerm(), TimeSpreadTerm(slow=True), regimes, CycleTerm(0.1), CycleTerm(0.1, 3)]


@pytest.mark.parametrize("number", range(8))
def test_every_hidden_effect_alone(coarse: Coarse, number: int, tmp_path: Path) -> None:
    goes_through(coarse, [hidden_terms(coarse)[number]], tmp_path)


def test_all_beside_each_other(coarse: Coarse, tmp_path: Path) -> None:
    hidden = hidden_terms(coarse)
    columns = [
        MeanTerm.of(SHAPES[0]),
        CourseTerm.over_time(SHAPES[6], np.array([0.1, -0.05])),
        SpreadTerm.of(SHAPES[7]),
        FineNoiseTerm.of(SHAPES[11]),
        BetweenTerm.of(structs.replace(SHAPES[1], response_s=60.0)),
    ]
    fitted = goes_through(coarse, [*columns, hidden[1], hidden[3], hidden[5], hidden[7]], tmp_path)
    assert len(fitted.estimates) == 9


def test_what_was_found_is_kept_where_a_later_stage_fails(coarse: Coarse, monkeypatch: pytest.MonkeyPatch) -> None:
    def breaks(search: Search, fitted: Fitted) -> Outcome | None:
        raise ValueError("matmul")

    monkeypatch.setattr(SpreadTerm, "test", breaks)
    monkeypatch.setattr(selection, "STAGES", ((MeanTerm,), (SpreadTerm,)))
    search = Search.over(coarse, [Column("x", Values.NUMBER, False)], np.random.SeedSequence(1), ERROR_BUDGET)
    found = select(search)
    assert [one.term.columns for one in found.accepted] == [("x",)]
    (failed,) = [one for one in found.rejected if one.component == "spread"]
    assert "a fault of this program (ValueError: matmul)" in failed.why


def test_what_cannot_be_told_is_taken_back(coarse: Coarse, monkeypatch: pytest.MonkeyPatch) -> None:
    def breaks(self: Term, *_: object) -> None:
        raise ValueError("matmul")

    monkeypatch.setattr(MeanTerm, "describe", breaks)
    monkeypatch.setattr(selection, "STAGES", ((MeanTerm,),))
    search = Search.over(coarse, [Column("x", Values.NUMBER, False)], np.random.SeedSequence(1), ERROR_BUDGET)
    found = select(search)
    assert found.accepted == ()
    assert [one.columns for one in found.rejected if one.was_found] == [("x",)]
