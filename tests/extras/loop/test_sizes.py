"""What a size is told to be, and how sure: planted responses through a delay and a first-order lag."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec import structs

from tests.kit.simulated.movements import ornstein_uhlenbeck, record_movement
from xosc_lateral.drivers.model.effects import Acts, Linear, Product, Proximity, Saturating, Threshold
from xosc_lateral.drivers.model.effects.response import respond
from xosc_lateral.drivers.model.effects.shapes import Factor
from xosc_lateral.extras.loop.candidates import FINE_SCALES, Family, candidates_of, shapes_of
from xosc_lateral.extras.loop.columns import Column, Values
from xosc_lateral.extras.loop.model import Fitted, fit_model
from xosc_lateral.extras.loop.refinement import Refinement
from xosc_lateral.extras.loop.terms.mean import MeanTerm
from xosc_lateral.extras.loop.timeline import Coarse, join_drives, on_fine_grid
from xosc_lateral.files.drives import drives_of_table

LAG, RESPONSE, SIZE = -0.6, 1.7, 0.25


@pytest.fixture(scope="module")
def passed() -> Coarse:
    """A car that trucks pass on the right, briefly; it moves 0.25 m left for each."""
    table = record_movement(ornstein_uhlenbeck, 1800.0, 3)
    time = table["time"].to_numpy()
    truck = (np.sin(2 * np.pi * time / 47.0) > 0.9).astype(float)
    shift = SIZE * respond(truck[:, None], float(time[1] - time[0]), LAG, RESPONSE)[:, 0]
    left, right = table["distance_left"] - shift, table["distance_right"] + shift
    table = table.assign(distance_left=left, distance_right=right, truck=truck)
    return Coarse.of(join_drives(drives_of_table(table, {})))


def term(lag: float = LAG, response: float = RESPONSE) -> MeanTerm:
    return MeanTerm.of(Linear(acts=Acts.LOCATION, column="truck", lag_s=lag, response_s=response))


def test_an_error_counts_that_the_timing_is_not_known(passed: Coarse) -> None:
    fitted = fit_model(passed, (term(),))
    (effect,) = fitted.terms[0].estimate(fitted)  # type: ignore[attr-defined]
    alone = float(np.sqrt(fitted.covariance[0, 0]))
    assert 1.1 * alone < effect.errors[0] < 4.0 * alone
    assert abs(effect.coefficients[0] - SIZE) < 2.5 * effect.errors[0]


def test_a_time_constant_is_found_between_the_dictionarys(passed: Coarse) -> None:
    """A grid of half as long again would put the size 15 % off."""
    bare = fit_model(passed, ())
    problem = MeanTerm.problem(bare)
    refinement = Refinement(passed, problem, np.zeros((len(problem.observed), 0)), [])
    columns = {"truck": Column("truck", Values.SWITCH, gaps=False, levels=(0.0, 1.0))}
    found = refinement.refine(structs.replace(term().effect, lag_s=0.0, response_s=4.0), 0.0, columns).effect
    assert found.lag_s == pytest.approx(LAG, abs=0.4)
    assert found.response_s == pytest.approx(RESPONSE, rel=0.25)


def test_a_product_turns_its_sign_where_the_driver_does() -> None:
    """Curves are cut above 33 m/s and taken wide below; half of the drive is slower than 28 m/s."""
    table = record_movement(ornstein_uhlenbeck, 1800.0, 4)
    time = table["time"].to_numpy()
    speed, bend = 28.0 + 6.0 * np.sin(2 * np.pi * time / 311.0), np.sin(2 * np.pi * time / 53.0)
    shift = 0.04 * respond((bend * (speed - 33.0))[:, None], float(time[1] - time[0]), LAG, RESPONSE)[:, 0]
    left, right = table["distance_left"] - shift, table["distance_right"] + shift
    moved = table.assign(distance_left=left, distance_right=right, speed=speed, bend=bend)
    coarse = Coarse.of(join_drives(drives_of_table(moved, {})))
    problem = MeanTerm.problem(fit_model(coarse, ()))
    refinement = Refinement(coarse, problem, np.zeros((len(problem.observed), 0)), [])
    factors = (Factor(column="bend"), Factor(column="speed", at=float(np.median(speed))))
    found = refinement.refine(Product(acts=Acts.LOCATION, factors=factors), 0.0, {}).effect
    assert isinstance(found, Product)
    assert found.factors[0].at == 0.0  # a bend's natural zero
    assert found.factors[1].at == pytest.approx(33.0, abs=1.0)


def test_what_a_term_explains_is_on_the_fine_grid_what_the_profile_gives(passed: Coarse) -> None:
    """Steps of a second would be fine noise, wherever the column changes."""
    fitted: Fitted = fit_model(passed, (term(),))
    explained = np.diff(fitted.explained)
    assert np.abs(explained).max() <= 1.01 * fitted.sizes[0] * 0.2 / RESPONSE
    slopes = np.diff(explained)[np.abs(explained[1:]) > 1e-3]
    assert (np.abs(slopes) > 1e-6).mean() > 0.9  # straight lines from second to second would bend in one of five places


def test_values_between_seconds_are_straight_lines() -> None:
    table = record_movement(ornstein_uhlenbeck, 200.0, 1)
    timeline = join_drives(drives_of_table(table, {}))
    line = 3.0 * np.arange(len(timeline) // 5) + 1.0
    fine = on_fine_grid(line, timeline)
    assert fine[2] == line[0]
    assert fine[7] == line[1]
    np.testing.assert_allclose(np.diff(fine[2:-3]), 0.6, rtol=1e-9)


def test_a_finer_choice_pays_for_its_number() -> None:
    """A product of a distance has no more scales than the distance alone, and both pay for them once."""
    rng = np.random.default_rng(1)
    distance = np.where(rng.random(400) < 0.5, np.nan, rng.exponential(40.0, 400))
    columns = [Column("gap", Values.NUMBER, gaps=True), Column("lane", Values.LEVELS, gaps=False, levels=(0.0, 1.0))]
    context = {"gap": distance, "lane": (rng.random(400) < 0.5).astype(float)}
    candidates = candidates_of(columns, context)
    for family in Family:
        members = [one for one in candidates if one.family is family]
        np.testing.assert_allclose([one.cost for one in members], 2.0 * np.log(len(members)))
    _, bent, finer = shapes_of(columns[0], distance, curves=False)
    scales = {one.scale for one in bent if isinstance(one, Proximity)}
    median = float(np.nanmedian(distance))
    assert {round(share * median, 9) for share in FINE_SCALES} <= {round(scale, 9) for scale in scales}
    coarse = sum(one.family is Family.BENT and one.columns == ("gap",) for one in candidates)
    assert finer == len(bent) / coarse


def test_a_column_that_mostly_has_one_of_two_values_has_limits_in_between() -> None:
    """A crossfall: -2.5 or 2.5 % nearly always, and on its way from one to the other for a tenth of the time."""
    way = np.linspace(-2.5, 2.5, 100)
    crossfall = np.concatenate([np.full(600, -2.5), way, np.full(200, 2.5), way[::-1]])
    _, bent, _ = shapes_of(Column("crossfall", Values.NUMBER, False), crossfall, curves=True)
    limits = {shape.at for shape in bent if isinstance(shape, Threshold)}
    assert len(limits) > 10
    assert min(np.abs(list(limits))) < 0.2
    middles = {shape.middle for shape in bent if isinstance(shape, Saturating)}
    assert max(np.abs(list(middles))) < 0.2
