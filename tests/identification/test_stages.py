"""Which terms are looked for, and in which order."""

from __future__ import annotations

import inspect
import pkgutil
from importlib import import_module

from xosc_lateral.identification import terms
from xosc_lateral.identification.significance import WEIGHTS
from xosc_lateral.identification.stages import STAGES
from xosc_lateral.identification.terms.base import Term
from xosc_lateral.identification.terms.cycle import CycleTerm
from xosc_lateral.identification.terms.drift import DriftTerm
from xosc_lateral.identification.terms.mean import MeanTerm
from xosc_lateral.identification.terms.regimes import RegimesTerm
from xosc_lateral.identification.terms.spread import SpreadTerm

LISTED = [kind for stage in STAGES for kind in stage]


def written() -> set[type[Term]]:
    """Every term that a file of the folder defines and that can be made."""
    found = set()
    for module in pkgutil.iter_modules(terms.__path__):
        for _, kind in inspect.getmembers(import_module(f"{terms.__name__}.{module.name}"), inspect.isclass):
            if issubclass(kind, Term) and not inspect.isabstract(kind):
                found.add(kind)
    return found


def test_every_term_is_looked_for() -> None:
    """A drift is looked for with a step, which it competes with."""
    assert written() - set(LISTED) == {DriftTerm}
    assert set(LISTED) <= written()


def test_every_component_has_a_share_of_the_error_budget_and_none_is_left_over() -> None:
    assert {kind.component for kind in written()} == set(WEIGHTS)


def test_the_mean_comes_first_and_again_once_hidden_movement_is_known() -> None:
    assert STAGES[0] == (MeanTerm,)
    assert LISTED.count(MeanTerm) == 2
    assert LISTED.index(CycleTerm) < len(LISTED) - LISTED[::-1].index(MeanTerm) - 1


def test_what_explains_anything_that_clusters_comes_after_the_spread() -> None:
    assert LISTED.index(SpreadTerm) < LISTED.index(RegimesTerm)


def test_kinds_are_those_of_the_report_s_schema() -> None:
    schema = {"location", "scale", "dynamics", "memory", "periodic", "drift", "step", "regime", "population"}
    assert {kind.kind for kind in written()} <= schema
