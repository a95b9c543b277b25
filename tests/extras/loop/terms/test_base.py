"""What every term has unless it says otherwise, and what column terms share."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.coarse import coarse_of, movement, wander
from xosc_lateral.drivers.model.effects import Acts, Linear
from xosc_lateral.extras.loop.held_out import removal_of
from xosc_lateral.extras.loop.model import fit_model
from xosc_lateral.extras.loop.terms.column import columns_on_size, of_kind, shrunk
from xosc_lateral.extras.loop.terms.mean import MeanTerm
from xosc_lateral.extras.loop.terms.spread import SpreadTerm
from xosc_lateral.extras.loop.terms.time import StepTerm, TimeSpreadTerm
from xosc_lateral.extras.loop.timeline import Coarse

SECONDS = 900.0


@pytest.fixture(scope="module")
def coarse() -> Coarse:
    rng = np.random.default_rng(81)
    x, switch = wander(rng, 4500, 30.0), (np.arange(4500) % 100 == 0).astype(float)
    return coarse_of(0.15 * x + movement(rng, SECONDS), {"x": x, "rare": switch})


def term(kind: type = MeanTerm, column: str = "x") -> MeanTerm:
    return kind.of(Linear(acts=Acts.LOCATION, column=column))  # type: ignore[attr-defined,no-any-return]


def test_a_term_without_columns_has_none_of_any_kind(coarse: Coarse) -> None:
    step = StepTerm(at=400)
    assert step.columns == ()
    assert step.scale_columns(coarse).shape == (len(coarse), 0)
    assert step.known_scale(coarse) is None
    assert step.mean_columns(coarse).shape == (len(coarse), 1)
    assert TimeSpreadTerm().mean_columns(coarse).shape == (len(coarse), 0)


def test_columns_of_the_mean_are_there_on_the_fine_grid_too(coarse: Coarse) -> None:
    step = StepTerm(at=400).fine_mean_columns(coarse)[:, 0]
    assert len(step) == len(coarse.timeline)
    assert (step[:1990] == 0.0).all()
    assert (step[2010:] == 1.0).all()


def test_terms_of_two_kinds_that_share_a_budget_are_told_apart_by_kind() -> None:
    assert StepTerm(at=1).kind_key == "step"
    assert TimeSpreadTerm().kind_key == "time_spread"


def test_a_term_matches_one_of_its_kind_and_columns(coarse: Coarse) -> None:
    assert term().matches(term())
    assert not term().matches(term(column="rare"))
    assert not term().matches(term(SpreadTerm))
    assert StepTerm(at=100).matches(StepTerm(at=150))
    assert not StepTerm(at=100).matches(StepTerm(at=400))


def test_nothing_is_removed_before_a_term_says_so(coarse: Coarse) -> None:
    for part in removal_of(fit_model(coarse, ())).values():
        np.testing.assert_array_equal(part, np.zeros(len(coarse.timeline)))


# ---- column terms ----------------------------------------------------------------------------------------------------
def test_an_effect_that_acts_on_something_else_becomes_one_of_this_kind() -> None:
    assert term(SpreadTerm).effect.acts is Acts.SPREAD  # type: ignore[attr-defined]
    assert term(SpreadTerm).columns == ("x",)


@pytest.mark.parametrize(("z", "kept"), [(0.5, 0.0), (1.0, 0.0), (2.0, 0.75), (5.0, 0.96)])
def test_a_size_is_shrunk_by_how_sure_it_is(z: float, kept: float) -> None:
    """Positive-part James-Stein: 1 - 1 / z^2."""
    assert shrunk(np.array([0.15]), np.array([0.15 / z]))[0] == pytest.approx(0.15 * kept)


def test_several_sizes_are_shrunk_together() -> None:
    sizes, errors = np.array([0.3, -0.1]), np.array([0.1, 0.1])
    np.testing.assert_allclose(shrunk(sizes, errors), sizes * (1.0 - 2.0 / 10.0))
    np.testing.assert_array_equal(shrunk(np.zeros(2), np.zeros(2)), np.zeros(2))


def test_a_shift_counts_all_that_was_seen_and_a_factor_its_inner_nine_tenths(coarse: Coarse) -> None:
    response = coarse.response(term().effect)[coarse.valid, 0]  # type: ignore[attr-defined]
    low, high = term().ends(coarse)
    assert (low[0], high[0]) == (response.min(), response.max())
    low, high = term(SpreadTerm).ends(coarse)
    np.testing.assert_allclose([low[0], high[0]], np.quantile(response, [0.05, 0.95]))


def test_a_switch_that_is_hardly_ever_on_keeps_its_two_ends(coarse: Coarse) -> None:
    low, high = term(SpreadTerm, "rare").ends(coarse)
    assert high[0] > low[0]


def test_bounded_responses_have_no_mean(coarse: Coarse) -> None:
    assert term(SpreadTerm).bounded(coarse)[coarse.valid].mean() == pytest.approx(0.0, abs=1e-12)


def test_a_sized_effect_is_neutral_on_average_and_holds_its_range(coarse: Coarse) -> None:
    fitted = fit_model(coarse, (term(),))
    (effect,) = term().estimate(fitted) if fitted.terms[0] is term() else fitted.terms[0].estimate(fitted)  # type: ignore[attr-defined]
    assert effect.coefficients[0] == pytest.approx(0.15, abs=4.0 * effect.errors[0])
    strength = effect.strength(0.2, coarse.context)
    assert strength[coarse.timeline.valid].mean() == pytest.approx(0.0, abs=1e-9)
    assert len(effect.response_range) == 1


def test_lists_of_terms_by_what_they_act_on(coarse: Coarse) -> None:
    fitted = fit_model(coarse, (term(), term(SpreadTerm, "rare"), TimeSpreadTerm()))
    assert len(of_kind(fitted, MeanTerm)) == len(of_kind(fitted, SpreadTerm)) == 1
    assert columns_on_size(fitted) == {"rare"}


def test_terms_of_one_component_are_numbered_and_what_they_did_adds_up(coarse: Coarse) -> None:
    fitted = fit_model(coarse, (term(), term(column="rare"), term(SpreadTerm)))
    estimates = fitted.estimates
    assert list(estimates) == ["mean 0", "mean 1", "spread 0"]
    removal = removal_of(fitted)
    parts = [effects[0].strength(0.2, coarse.context) for key, (_, effects) in estimates.items() if "mean" in key]
    np.testing.assert_allclose(removal[Acts.LOCATION], parts[0] + parts[1], atol=1e-15)  # type: ignore[operator]
    np.testing.assert_array_equal(removal[Acts.SPREAD], estimates["spread 0"][1][0].strength(0.2, coarse.context))
