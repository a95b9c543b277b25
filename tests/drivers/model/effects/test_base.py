"""What every effect is: terms by rows, a kind after its class, parameters that can't be changed."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.kit.profiles import effect_from_dict
from xosc_lateral.drivers.model.effects import EFFECTS, Drift, Effect, EffectTerms, Step
from xosc_lateral.drivers.model.effects.base import step_of


@pytest.mark.parametrize("rows", [slice(1, 3), np.array([3, 0])], ids=["slice", "numbers"])
def test_rows_of_terms_are_those_rows_of_each_part(rows: slice | np.ndarray) -> None:
    values = np.arange(4.0)
    terms = EffectTerms(location=values, rate=10.0 + values).rows(rows)  # type: ignore[arg-type]
    np.testing.assert_array_equal(terms.location, values[rows])
    np.testing.assert_array_equal(terms.rate, 10.0 + values[rows])
    assert terms.spread is None
    assert terms.fine is None


@pytest.mark.parametrize(
    ("time", "step"), [([3.0, 3.2, 3.4], 0.2), ([5.0, 4.0], -1.0), ([7.0], 1.0), ([], 1.0)], ids=str
)
def test_the_step_is_that_of_the_first_two_rows_and_a_second_where_there_are_not_two(
    time: list[float], step: float
) -> None:
    assert step_of(np.array(time)) == pytest.approx(step)


def test_kinds_are_told_apart_and_read_as_the_class_that_bears_them() -> None:
    kinds = [effect.kind for effect in EFFECTS]
    assert len(set(kinds)) == len(kinds)
    assert all(kind == kind.lower() and " " not in kind and "_" not in kind for kind in kinds)
    assert isinstance(effect_from_dict({"kind": "step", "size": 0.1}), Step)


def test_a_subclass_is_named_by_its_class_in_files() -> None:
    class SlowGrowingThing(Drift, frozen=True, kw_only=True):
        pass

    assert SlowGrowingThing.kind == "slow-growing-thing"
    assert SlowGrowingThing(size=0.1).to_dict()["kind"] == "slow-growing-thing"


def test_an_effect_can_t_be_changed_and_equals_one_with_the_same_numbers() -> None:
    effect = Drift(size=0.15)
    with pytest.raises(AttributeError):
        effect.size = 0.2  # type: ignore[misc]
    assert effect == Drift(size=0.15)
    assert effect != Drift(size=0.16)
    assert len({effect, Drift(size=0.15), Drift(size=0.16)}) == 2


def test_plain_values_hold_the_kind_and_every_field_and_are_json() -> None:
    values = Step(size=0.12, size_error=0.01, at_s=40.0, share_before=0.3).to_dict()
    assert json.loads(json.dumps(values)) == values
    assert values == {"kind": "step", "size": 0.12, "size_error": 0.01, "at_s": 40.0, "share_before": 0.3}


def test_what_an_effect_must_say_itself_is_asked_for() -> None:
    class Silent(Effect, frozen=True, kw_only=True):
        pass

    with pytest.raises(NotImplementedError):
        _ = Silent().columns
