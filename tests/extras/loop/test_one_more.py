"""One more hidden effect that the loop looks for: two files, as CONTRIBUTING's recipe says, and no list edited."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.drivers.model.test_stream import make_profile
from tests.kit.coarse import coarse_of, movement
from xosc_lateral.base.plugins import defined_in
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.model import effects
from xosc_lateral.drivers.model.effects import Acts, Effect, known_effects
from xosc_lateral.drivers.model.profile import DriverProfile, file_type
from xosc_lateral.drivers.model.sampling import sample_offsets
from xosc_lateral.extras.loop import selection, terms
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.held_out import removal_of
from xosc_lateral.extras.loop.model import Stage, Term
from xosc_lateral.extras.loop.selection import STAGES, TERMS, in_stages, shared_among
from xosc_lateral.extras.loop.significance import BUDGET
from xosc_lateral.extras.loop.timeline import Coarse
from xosc_lateral.files.profiles import read_profile, write_profile

EFFECT = '''
"""A mean that moves to one side, steadily."""
from xosc_lateral.drivers.model.effects.base import EffectTerms
from xosc_lateral.drivers.model.effects.hidden import HiddenEffect


class Ramp(HiddenEffect, frozen=True, kw_only=True):
    """By `size` [m] in `seconds` [s], about nothing in the middle."""

    positive = ("seconds",)
    size: float
    size_error: float = 0.0
    seconds: float = 600.0

    def advance(self, state, time, step):
        return EffectTerms(location=self.size * (time / self.seconds - 0.5))
'''
"""driver/effects/ramp.py"""

TERM = '''
"""Looked for with the mean."""
from typing import ClassVar
import numpy as np
from scipy.stats import norm
from xosc_lateral.drivers.model.effects.ramp import Ramp
from xosc_lateral.extras.loop.model import Description, Outcome, Stage, Term, fit_model


class RampTerm(Term):
    component: ClassVar[str] = "ramp"
    kind: ClassVar[str] = "drift"
    stages: ClassVar[tuple[Stage, ...]] = (Stage.MEAN,)
    weight: ClassVar[float] = 1.0

    def mean_columns(self, coarse):
        return (coarse.time / 900.0 - 0.5)[:, None]

    @classmethod
    def test(cls, search, fitted):
        if any(isinstance(term, cls) for term in fitted.terms):
            return None
        term = cls()
        after = fit_model(fitted.coarse, (*fitted.terms, term))
        (effect,) = term.estimate(after)
        return Outcome(term, (), float(2.0 * norm.sf(abs(effect.size / effect.size_error))), after)

    def estimate(self, fitted):
        part = fitted.mean_part(self)
        error = float(np.sqrt(fitted.covariance[part, part][0, 0]))
        return (Ramp(size=float(fitted.sizes[part][0]), size_error=error),)

    def removed(self, fitted, effects):
        return [("location", self.fine_mean_columns(fitted.coarse)[:, 0] * effects[0].size)]

    def describe(self, fitted, effects, key):
        return Description("ramp", "linear", effects[0].size, effects[0].size_error, "", "")
'''
"""identification/terms/ramp.py"""


@pytest.fixture
def added(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[type[Term]]:
    """Both files lie in their packages' folders, and what the packages do when they are imported is done again."""
    for package, text in ((effects, EFFECT), (terms, TERM)):
        folder = tmp_path / package.__name__
        folder.mkdir()
        (folder / "ramp.py").write_text(text)
        monkeypatch.setattr(package, "__path__", [*package.__path__, str(folder)])
    monkeypatch.setattr(effects, "EFFECTS", defined_in(effects.__name__, Effect))  # type: ignore[type-abstract]
    kinds = defined_in(terms.__name__, Term)  # type: ignore[type-abstract]
    monkeypatch.setattr(selection, "STAGES", in_stages(kinds))
    _forget()
    yield next(kind for kind in kinds if kind not in TERMS)
    _forget()
    for package in (effects, terms):
        del sys.modules[f"{package.__name__}.ramp"]


def _forget() -> None:
    known_effects.cache_clear()
    file_type.cache_clear()


def ramping(size: float, seed: int) -> Coarse:
    seconds = 900.0
    return coarse_of(size * np.linspace(-0.5, 0.5, 4500) + movement(np.random.default_rng(seed), seconds))


def found_in(coarse: Coarse) -> Any:
    budget = shared_among(defined_in(terms.__name__, Term))  # type: ignore[type-abstract]
    return selection.select(Search.over(coarse, [], np.random.SeedSequence(1), budget))


def test_a_file_more_in_either_folder_is_all_that_is_known_more(added: type[Term]) -> None:
    stages = in_stages((*TERMS, added))
    assert stages[0][1:] == (added,)
    assert stages[1:] == STAGES[1:]
    assert [kind for kind in defined_in(terms.__name__, Term) if kind is not added] == list(TERMS)  # type: ignore[type-abstract]


def test_it_takes_its_part_of_the_error_budget_from_all_others(added: type[Term]) -> None:
    before, after = shared_among(TERMS), shared_among((*TERMS, added))
    assert sum(after.values()) == pytest.approx(BUDGET)
    assert 0.0 < after["ramp"] < before["cycle"]


def test_the_loop_finds_it_where_it_acts_sizes_and_removes_it(added: type[Term], tmp_path: Path) -> None:
    found = found_in(ramping(0.25, 31))
    assert [type(one.term) for one in found.accepted] == [added]
    estimates = found.final.estimates
    (effect,) = estimates["ramp 0"][1]
    assert effect.size == pytest.approx(0.25, abs=3.0 * effect.size_error)
    removed = removal_of(found.final)[Acts.LOCATION]
    assert removed[-100] - removed[100] == pytest.approx(effect.size, rel=0.05)
    write_profile(DriverProfile("ramping", make_profile().model, (effect,)), tmp_path / "p.json")
    again = read_profile(tmp_path / "p.json")
    assert again.effects == (effect,)
    time = 0.2 * np.arange(3001)
    segment = Segment(time=time, speed=np.full(3001, 30.0), lane_width=np.full(3001, 3.6), context={})
    plain = sample_offsets(DriverProfile("plain", again.model), segment, 1)
    np.testing.assert_allclose(sample_offsets(again, segment, 1) - plain, effect.size * (time / 600.0 - 0.5), atol=1e-6)


@pytest.mark.usefixtures("added")
def test_and_nothing_where_nothing_ramps() -> None:
    assert found_in(ramping(0.0, 32)).accepted == ()


def test_stages_are_asked_in_order_and_equal_places_by_name() -> None:
    assert [stage.value for stage in Stage] == sorted(stage.value for stage in Stage)
    assert in_stages(tuple(sorted(TERMS, key=lambda kind: kind.place, reverse=True)))[3] == STAGES[3]
