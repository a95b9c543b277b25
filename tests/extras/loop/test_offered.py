"""What plug-ins propose: asked of theirs alone, with the column's own values."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from xosc_lateral.drivers.model.effects import EFFECTS, Acts, HiddenEffect, Linear
from xosc_lateral.extras.loop import candidates
from xosc_lateral.extras.loop.candidates import offered_effects


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
