"""What plug-ins propose: asked of theirs alone, with the column's own values."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from xosc_lateral.drivers.model.effects import EFFECTS, Acts, HiddenEffect, Linear
from xosc_lateral.drivers.model.effects.shapes import Piecewise
from xosc_lateral.extras.loop import candidates
from xosc_lateral.extras.loop.candidates import offered_effects, shapes_of
from xosc_lateral.extras.loop.columns import Column, Values


class Cubed(Linear, frozen=True, kw_only=True):
    """Says that it is worth a try on what goes to both sides."""

    @classmethod
    def proposals(cls, column: str, values: np.ndarray) -> Iterable[Cubed]:
        return (cls(acts=Acts.LOCATION, column=column),) if values.min() < 0.0 < values.max() else ()


class Sleepy(HiddenEffect, frozen=True, kw_only=True):
    """Hidden: reads no column, so it is asked about none."""


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(candidates, "known_effects", lambda: (*EFFECTS, Cubed, Sleepy))


def test_without_plug_ins_nothing_is_offered() -> None:
    assert offered_effects("x", np.linspace(-1.0, 1.0, 9)) == []


@pytest.mark.usefixtures("installed")
def test_a_plug_in_is_asked_about_the_column_and_its_values() -> None:
    (effect,) = offered_effects("x", np.linspace(-1.0, 1.0, 9))
    assert isinstance(effect, Cubed)
    assert effect.columns == ("x",)
    assert effect.coefficients == ()
    assert offered_effects("x", np.linspace(1.0, 2.0, 9)) == []


@pytest.mark.parametrize(("values", "gaps", "curves"), [
    (Values.NUMBER, False, 5 + 10), (Values.NUMBER, True, 0), (Values.ANGLE, False, 0),
])  # fmt: skip
def test_curves_with_one_bend_or_two_are_tried_on_numbers_that_are_always_there(
    values: Values, gaps: bool, curves: int
) -> None:
    """At five quantiles one bend, or two of them."""
    column, rows = Column("x", values, gaps, period=360.0 * (values is Values.ANGLE)), np.linspace(0.0, 100.0, 401)
    plain, bent, _ = shapes_of(column, rows, curves=True)
    found = [one.knots for one in bent if isinstance(one, Piecewise)]
    assert len(found) == curves and {len(knots) for knots in found} <= {1, 2}
    assert {knot for knots in found for knot in knots} <= {10.0, 30.0, 50.0, 70.0, 90.0}
    assert not any(isinstance(one, Piecewise) for one in (*plain, *shapes_of(column, rows, curves=False)[1]))
