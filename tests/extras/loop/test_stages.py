"""Which terms are looked for, and in which order."""

from __future__ import annotations

from xosc_lateral.extras.loop.selection import ERROR_BUDGET, STAGES, TERMS
from xosc_lateral.extras.loop.terms.hidden import CycleTerm, RegimesTerm
from xosc_lateral.extras.loop.terms.mean import MeanTerm
from xosc_lateral.extras.loop.terms.spread import SpreadTerm
from xosc_lateral.extras.loop.terms.time import TimeMeanTerm

LISTED = [kind for stage in STAGES for kind in stage]


def test_every_term_is_looked_for() -> None:
    """A drift is looked for with a step, which it competes with."""
    assert set(TERMS) - set(LISTED) == {TimeMeanTerm}


def test_the_order_of_the_stages() -> None:
    """Of equally sure terms the first is taken, and what was not found is told in this order."""
    names = [[kind.component for kind in stage] for stage in STAGES]
    assert names == [
        ["mean"],
        ["cycle", "time_mean", "course"],
        ["mean", "course"],
        ["time_spread", "spread", "slow_spread"],
        ["regimes"],
        ["fine_noise"],
        ["between", "between_spread"],
    ]


def test_every_component_has_a_share_of_the_error_budget_and_none_is_left_over() -> None:
    assert {kind.component for kind in TERMS} == set(ERROR_BUDGET)


def test_the_mean_comes_first_and_again_once_hidden_movement_is_known() -> None:
    assert STAGES[0] == (MeanTerm,)
    assert LISTED.count(MeanTerm) == 2
    assert LISTED.index(CycleTerm) < len(LISTED) - LISTED[::-1].index(MeanTerm) - 1


def test_what_explains_anything_that_clusters_comes_after_the_spread() -> None:
    assert LISTED.index(SpreadTerm) < LISTED.index(RegimesTerm)


def test_kinds_are_those_of_the_report_s_schema() -> None:
    schema = {"location", "scale", "dynamics", "memory", "periodic", "drift", "step", "regime", "population"}
    assert {kind.kind for kind in TERMS} <= schema
