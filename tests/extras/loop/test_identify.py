"""Which columns may act, and what a base profile's own effects begin the search with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.kit.coarse import movement, timeline_of, wander
from tests.kit.core_models import POPULATION
from tests.kit.effects import made
from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.drivers.model.effects import Acts, Cycle, Drift, Effect, Linear, VarianceTrend
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.extras.loop.identify import CLOCK, initial_terms, usable_columns
from xosc_lateral.extras.loop.model import fit_model
from xosc_lateral.extras.loop.terms.between import BetweenTerm
from xosc_lateral.extras.loop.terms.mean import MeanTerm
from xosc_lateral.extras.loop.terms.spread import SpreadTerm
from xosc_lateral.extras.loop.terms.time import TimeMeanTerm, TimeSpreadTerm
from xosc_lateral.extras.loop.timeline import Coarse, Timeline, join_drives

SECONDS = 900.0
N = round(SECONDS / 0.2)


@pytest.fixture(scope="module")
def timeline() -> Timeline:
    rng = np.random.default_rng(141)
    own = movement(rng, SECONDS)
    heading = np.gradient(own, 0.2) / 30.0
    columns = {
        "grade": wander(rng, N, 40.0),
        "yaw_angle": heading,
        "still": np.full(N, 1.0),
        "rain": wander(rng, N, 90.0),
    }
    return timeline_of(own, columns)


def initial(timeline: Timeline, *effects: Effect) -> tuple:
    return initial_terms(DriverProfile(name="p", model=POPULATION, effects=effects), timeline)


def test_what_follows_from_the_movement_may_not_act_and_is_told(timeline: Timeline) -> None:
    usable = usable_columns(timeline)
    assert {column.name for column in usable.columns} == {"grade", "rain"}
    assert [one.column for one in usable.feedback] == ["yaw_angle"]
    assert usable.unused["still"] == "it hardly varies"


def test_what_is_left_out_on_request_is_told_so(timeline: Timeline) -> None:
    usable = usable_columns(timeline, ["rain"])
    assert {column.name for column in usable.columns} == {"grade"}
    assert usable.unused["rain"] == "left out on request"


def test_a_clock_is_not_looked_at(timeline: Timeline) -> None:
    with_clock = replace(timeline, context={**timeline.context, "kilometres": 0.03 * timeline.time})
    usable = usable_columns(with_clock)
    assert "kilometres" not in {column.name for column in usable.columns}
    assert usable.unused["kilometres"] == CLOCK


def test_what_is_declared_own_movement_is_a_consequence(timeline: Timeline) -> None:
    usable = usable_columns(timeline, roles={"rain": "own"})
    assert {one.column: one.source for one in usable.feedback} == {"rain": "declared", "yaw_angle": "name"}


def test_a_base_s_effects_are_fitted_anew_from_nothing(timeline: Timeline) -> None:
    shift = made(Linear, 0.3, column="grade", lag_s=0.4, response_range=((0.0, 1.0),))
    (term,) = initial(timeline, shift)
    assert isinstance(term, MeanTerm)
    assert term.effect.lag_s == 0.4
    assert (term.effect.coefficients, term.effect.reference, term.effect.response_range) == ((), (), ())


def test_lags_in_a_row_become_one_as_late(timeline: Timeline) -> None:
    (term,) = initial(timeline, made(Linear, 0.3, column="grade", response_s=1.5, response_order=2))
    assert (term.effect.response_s, term.effect.response_order) == (3.0, 1)


def test_each_part_of_the_movement_has_its_term(timeline: Timeline) -> None:
    effects = (
        made(Linear, 0.2, column="grade", acts=Acts.SPREAD),
        made(Linear, 0.2, column="rain"),
        VarianceTrend(factor=1.5),
        Drift(size=0.1),
    )
    terms = initial(timeline, *effects)
    assert [type(term) for term in terms] == [SpreadTerm, MeanTerm, TimeSpreadTerm, TimeMeanTerm]


def test_effects_of_columns_that_the_table_lacks_and_cycles_begin_nothing(timeline: Timeline) -> None:
    assert initial(timeline, made(Linear, 0.2, column="wind"), Cycle(amplitude=0.1, period_s=9.0)) == ()
    assert initial(timeline) == ()


def test_the_effect_of_a_vehicle_s_class_is_fitted_between_vehicles() -> None:
    rng = np.random.default_rng(7)
    trucks = np.arange(60) % 3 == 0
    drives = []
    for index, truck in enumerate(trucks):
        n = 300
        own = 0.1 * rng.normal() - 0.15 * truck + 0.1 * wander(rng, n, 4.0)
        context = {"is_truck": np.full(n, float(truck)), "speed": 30.0 + wander(rng, n, 20.0)}
        drives.append(Drive(f"v{index}", 0.2 * np.arange(n), own, np.full(n, 3.6), context, frozenset({"is_truck"})))
    timeline = join_drives(drives)
    by_class, by_speed = initial(timeline, made(Linear, -0.1, column="is_truck"), made(Linear, 0.01, column="speed"))
    assert isinstance(by_class, BetweenTerm)
    assert isinstance(by_speed, MeanTerm)
    (effect,) = by_class.estimate(fit_model(Coarse.of(timeline), (by_class, by_speed)))
    assert isinstance(effect, Linear)
    # a third are trucks, levels differ by 0.1 m: 0.1 * sqrt(1 / 20 + 1 / 40) = 0.03 m
    assert effect.coefficients[0] == pytest.approx(-0.15, abs=0.09)
    assert effect.errors[0] == pytest.approx(0.03, rel=0.5)
