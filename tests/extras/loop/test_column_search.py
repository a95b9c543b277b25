"""The search for one more column: names the planted one with its timing, refuses to be sure of idle ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.kit.coarse import STEP, coarse_of, movement, wander
from xosc_lateral.drivers.model.effects import Acts, Linear, Saturating
from xosc_lateral.drivers.model.effects.ends import ends_of
from xosc_lateral.drivers.model.effects.response import respond
from xosc_lateral.extras.loop.column_search import ColumnSearch
from xosc_lateral.extras.loop.columns import Column, Values
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.identify import search_of
from xosc_lateral.extras.loop.model import Outcome, fit_model
from xosc_lateral.extras.loop.selection import ERROR_BUDGET, select
from xosc_lateral.extras.loop.terms.mean import MeanTerm
from xosc_lateral.extras.loop.terms.spread import SpreadTerm
from xosc_lateral.extras.loop.timeline import Coarse

SECONDS = 700.0
COLUMNS = [Column(name, Values.NUMBER, False) for name in ("idle", "x")]


def drive(seed: int, shift: float = 0.0, *, lag_s: float = 0.0, log_spread: float = 0.0) -> Coarse:
    """0.1 m of movement; a column that may shift it, another that does nothing."""
    rng = np.random.default_rng(seed)
    n = round(SECONDS / 0.2)
    x, idle = wander(rng, n, 12.0), wander(rng, n, 12.0)
    own = movement(rng, SECONDS) * np.exp(log_spread * x)
    return coarse_of(shift * respond(x, 0.2, lag_s, 2.0) + own, {"x": x, "idle": idle})


def outcome(coarse: Coarse, kind: type, columns: list[Column] = COLUMNS, seed: int = 1) -> Outcome | None:
    search = Search.over(coarse, columns, np.random.SeedSequence(seed), ERROR_BUDGET)
    return kind.test(search, fit_model(coarse, ()))


@pytest.fixture(scope="module")
def found() -> Outcome:
    """What moves the mean of a drive that a column shifts by 0.15 m, a second late."""
    one = outcome(drive(31, 0.15, lag_s=1.0), MeanTerm)
    assert one is not None
    return one


def test_a_shift_of_15_centimetres_is_named_with_its_delay(found: Outcome) -> None:
    assert isinstance(found.term, MeanTerm)
    assert found.columns == ("x",)
    assert found.p_value < ERROR_BUDGET["mean"]
    assert found.term.effect.lag_s == pytest.approx(1.0, abs=1.0)
    assert found.after is not None
    assert found.after.terms == (found.term,)


def test_idle_columns_are_hardly_ever_sure_to_do_anything() -> None:
    """At a level of 2.3 % two of three null drives below it are chance in one test of six hundred."""
    told = [outcome(drive(seed), MeanTerm) for seed in (32, 33, 34)]
    values = [one.p_value for one in told if one is not None]
    assert len(values) == 3
    assert sum(value < ERROR_BUDGET["mean"] for value in values) <= 1
    assert max(values) > 0.1


def test_what_a_column_may_do_is_told_by_the_best_p_value() -> None:
    coarse = drive(36, log_spread=0.5)
    search = Search.over(coarse, COLUMNS, np.random.SeedSequence(1), ERROR_BUDGET)
    fitted = fit_model(coarse, ())
    response, p_value = ColumnSearch(search, SpreadTerm, fitted).likely_response(0.1)
    assert p_value <= 0.1
    assert response.shape == (len(coarse), 1)
    x = coarse.response(Linear(acts=Acts.LOCATION, column="x"))
    assert abs(np.corrcoef(response[coarse.valid, 0], x[coarse.valid, 0])[0, 1]) > 0.7
    nothing, unsure = ColumnSearch(search, SpreadTerm, fitted).likely_response(0.0)
    assert (nothing.shape, unsure) == ((len(coarse), 0), 1.0)


def test_a_part_of_a_table_is_given_as_many_terms_as_the_table_has_and_no_others() -> None:
    """Folds: the best candidate although nothing is significant; and nothing where the table has nothing."""
    coarse = drive(33)
    search = Search.over(coarse, COLUMNS, np.random.SeedSequence(1), ERROR_BUDGET)
    assert select(search).accepted == ()
    one = select(replace(search, wanted={"mean": 1}))
    assert [accepted.term.component for accepted in one.accepted] == ["mean"]
    assert one.accepted[0].p_value > search.levels["mean"]
    assert {rejected.component for rejected in one.rejected} == {"mean"}
    assert select(replace(search, wanted={})).accepted == ()


def test_a_spread_is_found_as_a_spread_and_not_as_a_shift() -> None:
    coarse = drive(36, log_spread=0.5)
    spread, shift = outcome(coarse, SpreadTerm), outcome(coarse, MeanTerm)
    assert spread is not None
    assert spread.columns == ("x",)
    assert spread.p_value < ERROR_BUDGET["spread"]
    assert shift is not None
    assert shift.p_value > ERROR_BUDGET["mean"]


def test_a_column_that_is_barred_is_not_taken_up() -> None:
    """What changes the spread already is no candidate for it."""
    coarse = drive(37, log_spread=0.5)
    search = Search.over(coarse, COLUMNS, np.random.SeedSequence(1), ERROR_BUDGET)
    term = SpreadTerm.of(Linear(acts=Acts.LOCATION, column="x", response_s=2.0))
    found = SpreadTerm.test(search, fit_model(coarse, (term,)))
    assert found is None or "x" not in found.columns


def test_without_columns_there_is_nothing_to_find() -> None:
    assert outcome(drive(38), MeanTerm, columns=[]) is None


def test_the_mirror_image_is_found_with_the_same_certainty(found: Outcome) -> None:
    mirrored = drive(31, 0.15, lag_s=1.0)
    other = outcome(replace(mirrored, offset=-mirrored.offset), MeanTerm)
    assert other is not None
    assert other.p_value == pytest.approx(found.p_value, rel=1e-6)
    assert other.columns == found.columns


def test_a_product_has_to_give_more_than_its_parts() -> None:
    """What one column does alone, curved and late, is never blamed on its product with another that goes along."""
    rng = np.random.default_rng(61)
    n = round(1500.0 / 0.2)
    x, idle = wander(rng, n, 12.0), wander(rng, n, 12.0)
    names = {"x": x, "along": x + 0.3 * wander(rng, n, 12.0), "idle": idle}
    shift = 0.2 * respond(np.maximum(x, 0.0) ** 1.5, 0.2, 3.0, 5.0)
    coarse = coarse_of(shift + movement(rng, 1500.0), names)
    columns = [Column(name, Values.NUMBER, False) for name in sorted(names)]
    found = select(Search.over(coarse, columns, np.random.SeedSequence(1), ERROR_BUDGET))
    assert [one.term.columns for one in found.accepted if one.term.component in ("mean", "course")] == [("x",)]


def test_a_true_product_is_named_beside_its_parts() -> None:
    rng = np.random.default_rng(62)
    n = round(1500.0 / 0.2)
    x, other = wander(rng, n, 12.0), wander(rng, n, 12.0)
    coarse = coarse_of(0.1 * respond(x * other, 0.2, 0.0, 2.0) + movement(rng, 1500.0), {"x": x, "other": other})
    columns = [Column(name, Values.NUMBER, False) for name in ("other", "x")]
    found = select(Search.over(coarse, columns, np.random.SeedSequence(1), ERROR_BUDGET))
    assert ("other", "x") in [one.term.columns for one in found.accepted]


def test_the_side_of_the_last_bend_is_named_with_its_side(last_bends: Coarse) -> None:
    """A driver who keeps 0.16 m to the side of the last bend until the next: no curvature of the moment says so."""
    search = search_of(last_bends, np.random.SeedSequence(1), (), {})[1]
    outcome = ColumnSearch(search, MeanTerm, fit_model(last_bends, ())).outcome()
    assert outcome is not None and outcome.after is not None and outcome.p_value < 1e-6
    effect = outcome.after.effects_of(outcome.after.terms[0])[0]
    assert isinstance(effect, Saturating) and effect.episode > 0.0
    ends = ends_of(effect)
    assert ends is not None
    assert ends.low["curvature"] < 0.0 < ends.high["curvature"]
    assert ends.change == pytest.approx(0.32, abs=0.06)


@pytest.fixture
def last_bends() -> Coarse:
    """Three drives of ten minutes, a bend every 35 s."""
    rng, n, keep = np.random.default_rng(1), 3000, np.exp(-STEP / 2.0)
    bends = np.zeros((3, n))
    for one in bends:
        for start in range(50, n - 75, 175):
            one[start : start + 50] = rng.choice([-1.0, 1.0]) * rng.uniform(0.001, 0.004) * np.hanning(50)
    number = np.maximum.accumulate(np.where(np.abs(bends) > 5e-4, np.arange(n), 0), axis=1)
    sides = np.sign(np.take_along_axis(bends, number, axis=1)) * (number > 0)
    moved = lfilter([1.0 - keep], [1.0, -keep], sides, axis=1)
    offset = np.concatenate([0.16 * one + movement(rng, 600.0) for one in moved])
    return coarse_of(offset, {"curvature": bends.ravel()}, drives=3)
