"""No finding ends in an exception: every kind, shape and product is described, written, read back and sampled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from examples.driver_simulator.simulator import simulate_drive
from tests.kit import simulated as plants
from tests.kit.coarse import STEP, coarse_of, movement, wander
from xosc_lateral.base.segment import CONTEXT_UNITS
from xosc_lateral.drivers.drives.drive import Drive
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
from xosc_lateral.extras.loop import close, held_out, selection
from xosc_lateral.extras.loop.columns import Column, Values
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.loop_report import loop_record
from xosc_lateral.extras.loop.loop_words import verdict
from xosc_lateral.extras.loop.model import Fitted, Outcome, Term, fit_model
from xosc_lateral.extras.loop.residual import simulated_runs
from xosc_lateral.extras.loop.selection import ERROR_BUDGET, TERMS, Accepted, Selection, select
from xosc_lateral.extras.loop.terms.between import BetweenSpreadTerm, BetweenTerm
from xosc_lateral.extras.loop.terms.column import ColumnTerm
from xosc_lateral.extras.loop.terms.hidden import CycleTerm, RegimesTerm, fit_regimes
from xosc_lateral.extras.loop.terms.mean import CourseTerm, MeanTerm
from xosc_lateral.extras.loop.terms.spread import FineNoiseTerm, SlowSpreadTerm, SpreadTerm
from xosc_lateral.extras.loop.terms.time import StepTerm, TimeMeanTerm, TimeSpreadTerm
from xosc_lateral.extras.loop.timeline import Coarse
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
    Linear(acts=ACTS, column="x", episode=0.8),
    Proximity(acts=ACTS, column="gap", scale=20.0, episode=0.4),
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


@pytest.mark.pages
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
    fitted = fit_model(drives, (term,))
    (effect,) = term.estimate(fitted)
    assert isinstance(effect, SingleColumnEffect)
    told = term.describe(fitted, (effect,), "x")  # weights are as sure as what they do in a typical passage
    np.testing.assert_allclose(
        np.divide(effect.errors, np.abs(effect.coefficients)), told.size_error / abs(told.size_m)
    )
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
        FineNoiseTerm.of(SHAPES[-3]),
        BetweenTerm.of(structs.replace(SHAPES[1], response_s=60.0)),
    ]
    fitted = goes_through(coarse, [*columns, hidden[1], hidden[3], hidden[5], hidden[7]], tmp_path)
    assert len(fitted.estimates) == 9


@pytest.fixture(scope="module")
def campaign() -> Coarse:
    """Eight drives of two minutes and a half, each with its passengers."""
    rng, drives = np.random.default_rng(73), 8
    n = round(180.0 / STEP)
    passengers = np.repeat(np.arange(drives) % 4.0, n)
    gap = np.where(wander(rng, drives * n, 60.0) > 0.3, 30.0, np.nan)
    context = {"x": passengers, "y": wander(rng, drives * n, 20.0), "lane": np.clip(passengers, 0.0, 2.0)}
    context |= {"heading": 90.0 * passengers, "gap": gap}
    return coarse_of(movement(rng, 180.0 * drives) * (1.0 + 0.3 * passengers), context, drives=drives)


@pytest.mark.pages
@pytest.mark.parametrize("shape", SHAPES, ids=NAMES)
def test_every_shape_acts_between_drives(campaign: Coarse, shape: ColumnEffect, tmp_path: Path) -> None:
    goes_through(campaign, [BetweenTerm.of(structs.replace(shape, response_s=60.0))], tmp_path)


def test_what_differs_between_drives_beside_each_other(campaign: Coarse, tmp_path: Path) -> None:
    passengers = structs.replace(SHAPES[0], response_s=60.0)
    goes_through(campaign, [BetweenSpreadTerm.of(passengers)], tmp_path)
    both = [BetweenSpreadTerm.of(passengers), BetweenTerm.of(structs.replace(SHAPES[6], response_s=60.0))]
    fitted = goes_through(campaign, [*both, SpreadTerm.of(SHAPES[9]), TimeSpreadTerm(order=1)], tmp_path)
    assert len(fitted.estimates) == 4


def test_no_kind_of_finding_is_left_out(coarse: Coarse) -> None:
    of_columns = {MeanTerm, SpreadTerm, SlowSpreadTerm, FineNoiseTerm, CourseTerm, BetweenTerm, BetweenSpreadTerm}
    assert of_columns | set(map(type, hidden_terms(coarse))) == set(TERMS)


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


@pytest.mark.pages
def test_closing_words_that_fail_cost_no_finding(driven: Callable[..., list[Drive]], monkeypatch: Any) -> None:
    def breaks(*_: object, **__: object) -> None:
        raise ValueError("matmul")

    for stage in ("check_remainder", "what_drives_show"):
        monkeypatch.setattr(close, stage, breaks)
    table = simulate_drive(30.0, 1).table
    drop = [name for name in CONTEXT_UNITS if name in table and name not in ("truck_right", "speed")]
    result = close.close_loop(driven(101, [plants.truck_avoidance(0.5)], 700.0, drop=drop), seed=1)
    assert [finding.columns for finding in result.findings] == [("truck_right",)]
    failed = [one.component for one in result.identified.selection.rejected if "a fault of this program" in one.why]
    assert failed == ["what is left", "what these drives can show"]
    assert loop_record(result, [])["unexplained"]["omnibus"] is None
    assert "the check failed" in verdict(result)
