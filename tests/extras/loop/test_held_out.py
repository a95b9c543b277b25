"""Rows that nothing was fitted on: what a term gains there, which profiles are scored, and by what."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.coarse import SPREAD, coarse_of, movement, wander
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.model.core.base import ModelKind
from xosc_lateral.drivers.model.effects import Acts, Linear
from xosc_lateral.drivers.model.profile import Provenance
from xosc_lateral.extras.loop.columns import Column, Values
from xosc_lateral.extras.loop.held_out import HeldOut, _quantities, fit_without
from xosc_lateral.extras.loop.identify import Nested, gain_over
from xosc_lateral.extras.loop.model import Term, fit_model
from xosc_lateral.extras.loop.selection import Accepted, Gain, Selection
from xosc_lateral.extras.loop.terms.mean import MeanTerm
from xosc_lateral.extras.loop.terms.time import StepTerm
from xosc_lateral.extras.loop.timeline import Coarse

SECONDS = 900.0
N = round(SECONDS / 0.2)


def mean_term(column: str) -> MeanTerm:
    return MeanTerm.of(Linear(acts=Acts.LOCATION, column=column))


X, IDLE = mean_term("x"), mean_term("idle")


@pytest.fixture(scope="module")
def coarse() -> Coarse:
    """0.15 m per unit of a column, in 0.1 m of movement; another column does nothing."""
    rng = np.random.default_rng(151)
    x, idle = wander(rng, N, 30.0), wander(rng, N, 30.0)
    angle = np.arange(N) * 0.7 % 360.0
    return coarse_of(0.15 * x + movement(rng, SECONDS), {"x": x, "idle": idle, "wind": angle})


def chosen(coarse: Coarse, *terms: Term) -> Selection:
    accepted = tuple(Accepted(term, 1e-6) for term in terms)
    return Selection(accepted, (), fit_model(coarse, ()), fit_model(coarse, terms))


@pytest.fixture(scope="module")
def nested(coarse: Coarse) -> Nested:
    """Three folds; the idle column was chosen in one of them."""
    blocks = np.arange(len(coarse)) // 60
    folds = [blocks % 3 == fold for fold in range(3)]
    picked = ((X,), (X, IDLE), (X,))
    selections = tuple(chosen(coarse.only(~held), *terms) for held, terms in zip(folds, picked, strict=True))
    return Nested(selections, selections, coarse, blocks)


def test_what_acts_gains_on_rows_that_it_was_not_fitted_on(nested: Nested) -> None:
    gain = nested.of(X)
    assert gain.folds == 3
    assert gain.interval[0] > 0.0


def test_what_does_nothing_gains_nothing_and_counts_where_it_was_chosen(nested: Nested) -> None:
    gain = nested.of(IDLE)
    assert gain.folds == 1
    assert gain.interval[0] < 0.05


def test_a_term_that_no_fold_chose_gains_exactly_nothing(nested: Nested) -> None:
    assert nested.of(mean_term("wind")) == Gain(0.0, 0.0, 0)


def test_terms_together_gain_what_the_start_lacks(nested: Nested) -> None:
    assert nested.together([X]).mean == pytest.approx(nested.of(X).mean, abs=0.5)
    assert nested.together([]) == Gain(0.0, 0.0, 3)


def test_a_gain_is_the_meangain_over_with_its_standard_error(coarse: Coarse) -> None:
    blocks = np.arange(len(coarse)) // 60
    rows = np.random.default_rng(1).normal(size=len(coarse))
    found = gain_over(rows, blocks, coarse.valid, 2)
    sums = np.array([rows[blocks == block].sum() for block in np.unique(blocks[coarse.valid])])
    assert found.mean == pytest.approx(sums.mean())
    assert found.error == pytest.approx(sums.std(ddof=1) / np.sqrt(len(sums)))
    low, high = found.interval
    assert (low + high) / 2.0 == pytest.approx(found.mean)
    assert high - low == pytest.approx(2.0 * 1.96 * found.error)


@pytest.mark.parametrize(
    ("mean", "error", "stands"), [(0.5, 0.1, True), (-0.2, 0.3, True), (-0.4, 0.3, False), (0.0, 0.0, False)]
)
def test_only_a_loss_by_a_standard_error_vetoes_a_term_and_being_found_in_no_fold(
    mean: float, error: float, stands: bool
) -> None:
    assert Gain(mean, error, 4).stands is stands


def test_a_fold_is_scored_with_its_own_version_of_what_was_kept(coarse: Coarse) -> None:
    fold = chosen(coarse, X, IDLE)
    nested = Nested((fold,), (fold,), coarse, np.zeros(len(coarse), dtype=np.intp))
    assert nested.only((mean_term("x"), mean_term("idle"))).selections[0].final is fold.final
    assert nested.only((mean_term("x"),)).selections[0].final.terms == (X,)
    assert nested.only(()).selections[0].final.terms == ()


def test_a_base_is_fitted_to_what_is_left_without_the_effects(coarse: Coarse) -> None:
    fitted = fit_model(coarse, (X,))
    used = np.ones(len(coarse.timeline), dtype=bool)
    with_it = fit_without(fitted, used, ModelKind.TWO_LEVEL, "after", Provenance(source="here"))
    bare = fit_model(coarse, ())
    without = fit_without(bare, used, ModelKind.TWO_LEVEL, "before", None)
    assert [effect.columns for effect in with_it.effects] == [("x",)]
    assert without.effects == ()
    assert (with_it.name, with_it.provenance.source) == ("after", "here")
    paths = [one.model.stream(np.random.SeedSequence(1)).take(20_000)[0] for one in (with_it, without)]
    spreads = [3.6 * float(np.std(path)) for path in paths]
    assert spreads[0] == pytest.approx(SPREAD, rel=0.3)
    assert spreads[1] > 1.3 * spreads[0]


def test_without_a_run_of_ten_seconds_there_is_no_base(coarse: Coarse) -> None:
    fitted = fit_model(coarse, ())
    nothing = np.zeros(len(coarse.timeline), dtype=bool)
    with pytest.raises(NotEnoughDataError, match="no run of 10 s is left"):
        fit_without(fitted, nothing, ModelKind.TWO_LEVEL, "before", None)


def test_the_residual_is_cut_by_every_column_and_by_what_was_found(coarse: Coarse) -> None:
    columns = [Column("idle", Values.NUMBER, False), Column("wind", Values.ANGLE, False, period=360.0)]
    quantities = _quantities(chosen(coarse, X, StepTerm(at=300)).final, columns)
    assert list(quantities) == ["idle", "sin(wind)", "cos(wind)", "effect: mean 0", "effect: step 0"]
    np.testing.assert_allclose(quantities["sin(wind)"] ** 2 + quantities["cos(wind)"] ** 2, 1.0)
    step = quantities["effect: step 0"]
    assert (step[1499], step[1500]) == (0.0, 1.0)


def test_a_population_s_base_holds_what_its_trucks_do_to_the_rest() -> None:
    """Trucks move half as much, which no term says of whole drives; the paper's model holds no such thing."""
    rng = np.random.default_rng(152)
    drives, seconds = 40, 90.0
    truck = np.repeat(np.arange(drives) % 2, round(seconds / 0.2)).astype(float)
    moved = movement(rng, drives * seconds, 3.0) * np.where(truck > 0.0, 0.5, 1.0)
    fitted = fit_model(coarse_of(moved, {"is_truck": truck}, drives=drives), ())
    used = np.ones(len(fitted.coarse.timeline), dtype=bool)
    with_place = fit_without(fitted, used, ModelKind.AUTOREGRESSIVE, "after", None)
    spread = [effect for effect in with_place.effects if effect.acts is Acts.SPREAD]  # type: ignore[union-attr]
    assert [effect.columns for effect in spread] == [("is_truck",)]
    assert np.exp(spread[0].coefficients[0]) == pytest.approx(0.5, rel=0.25)  # type: ignore[union-attr]
    assert fit_without(fitted, used, ModelKind.TWO_LEVEL, "before", None).effects == ()


def test_what_is_scored_keeps_what_a_fold_chose_otherwise_but_not_what_was_taken_back(nested: Nested) -> None:
    """An error after that leaves out what only a fold chose would know the whole table."""
    judging, scored = nested.only([X]), nested.only([X], [IDLE])
    assert [len(one.accepted) for one in judging.selections] == [1, 1, 1]
    assert [len(one.accepted) for one in judging.scored] == [1, 2, 1]
    assert [len(one.accepted) for one in scored.scored] == [1, 1, 1]


def test_a_profile_is_surely_worse_where_nearly_all_half_samples_say_so() -> None:
    """The measured value is 0; the profiles expect 1 and -1.2: a half sample above 0.1 says "worse"."""
    for count, expected in ((100, True), (95, True), (94, False), (60, False), (50, False), (0, False)):
        halves = [{"": np.array([0.5 if number < count else -0.5])} for number in range(100)]
        none = np.zeros((1, 1))
        sides = {"real": {"": np.zeros(1)}, "before": {"": np.ones(1)}, "after": {"": np.full(1, -1.2)}}
        scored = HeldOut(None, **sides, runs_before=none, runs_after=none, halves=halves)  # type: ignore[arg-type]
        assert scored.surely_worse is expected, count
