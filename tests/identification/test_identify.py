"""Which columns may act, and what a base profile's own effects begin the search with."""

from __future__ import annotations

import numpy as np
import pytest

from tests.driver.effects.made_effects import made
from tests.driver.models.made_models import POPULATION
from tests.identification.made_coarse import movement, timeline_of, wander
from xosc_lateral.driver.effects import Acts, Cycle, Drift, Effect, Linear, VarianceTrend
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.identification.identify import initial_terms, usable_columns
from xosc_lateral.identification.terms.drift import DriftTerm
from xosc_lateral.identification.terms.mean import MeanTerm
from xosc_lateral.identification.terms.spread import SpreadTerm
from xosc_lateral.identification.terms.variance_trend import VarianceTrendTerm
from xosc_lateral.identification.timeline import Timeline

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
    columns, feedback, unused = usable_columns(timeline)
    assert {column.name for column in columns} == {"grade", "rain"}
    assert [one.column for one in feedback] == ["yaw_angle"]
    assert unused["still"] == "it hardly varies"


def test_what_is_left_out_on_request_is_told_so(timeline: Timeline) -> None:
    columns, _, unused = usable_columns(timeline, ["rain"])
    assert {column.name for column in columns} == {"grade"}
    assert unused["rain"] == "left out on request"


def test_a_base_s_effects_are_fitted_anew_from_nothing(timeline: Timeline) -> None:
    shift = made(Linear, 0.3, column="grade", lag_s=0.4, response_range=((0.0, 1.0),))
    (term,) = initial(timeline, shift)
    assert isinstance(term, MeanTerm)
    assert term.effect.lag_s == 0.4
    assert (term.effect.coefficients, term.effect.reference, term.effect.response_range) == ((), (), ())


def test_each_part_of_the_movement_has_its_term(timeline: Timeline) -> None:
    effects = (
        made(Linear, 0.2, column="grade", acts=Acts.SPREAD),
        made(Linear, 0.2, column="rain"),
        VarianceTrend(factor=1.5),
        Drift(size=0.1),
    )
    terms = initial(timeline, *effects)
    assert [type(term) for term in terms] == [SpreadTerm, MeanTerm, VarianceTrendTerm, DriftTerm]


def test_effects_of_columns_that_the_table_lacks_and_cycles_begin_nothing(timeline: Timeline) -> None:
    assert initial(timeline, made(Linear, 0.2, column="wind"), Cycle(amplitude=0.1, period_s=9.0)) == ()
    assert initial(timeline) == ()
