"""Strict structs: what is read comes back, what is wrong is named."""

from __future__ import annotations

import json
from copy import deepcopy
from typing import Any

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.kit.profiles import effect_from_dict
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.effects import Product
from xosc_lateral.drivers.model.records import Record, kebab, plain, read_as

FloatArray = NDArray[np.float64]


class Inner(Record, frozen=True):
    size: float


class Outer(Record, frozen=True):
    name: str
    parts: tuple[Inner, ...] = ()


class State(msgspec.Struct):
    rng: np.random.Generator
    values: FloatArray
    counts: NDArray[np.int64]
    maybe: FloatArray | None = None


def test_a_state_comes_back_from_json_and_goes_on_bit_by_bit() -> None:
    state = State(np.random.default_rng(3), np.empty((0, 2)), np.array([1, 2]), np.array([[0.1], [1 / 3]]))
    state.rng.random(7)
    again = read_as(State, json.loads(json.dumps(plain(state))))
    assert again.values.shape == (0, 2)
    assert again.counts.dtype == np.int64
    np.testing.assert_array_equal(again.maybe, state.maybe)
    np.testing.assert_array_equal(again.rng.random(5), state.rng.random(5))


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "unknown": ({"name": "a", "colour": 1}, "unknown field 'colour'"),
    "unknown within": ({"name": "a", "parts": [{"size": 1}, {"size": 1, "x": 0}]}, r"parts\[1\]: unknown field 'x'"),
    "missing": ({"parts": []}, "no 'name'"),
    "of another kind": ({"name": "a", "parts": [{"size": "big"}]}, r"parts\[0\].size: expected 'float', got 'str'"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_named_with_its_path(case: str) -> None:
    values, message = WRONG[case]
    with pytest.raises(DriverProfileError, match=f"^{message}$"):
        read_as(Outer, values)
    with pytest.raises(DriverProfileError, match=r"^here\.?"):
        read_as(Outer, values, "here")


@pytest.mark.parametrize("shape", [[3], [-1, 0], "x", [0, 1e9], None], ids=str)
def test_an_object_is_no_array(shape: object) -> None:
    state = plain(State(np.random.default_rng(0), np.empty((0, 1)), np.array([1])))
    with pytest.raises(DriverProfileError, match="values: "):
        read_as(State, state | {"values": {"shape": shape}})


def test_parameters_are_shared_by_copies() -> None:
    record = Outer("a")
    assert deepcopy(record) is record


@pytest.mark.parametrize(("name", "kind"), [("LeadDistance", "lead-distance"), ("TwoLevelModel", "two-level")])
def test_kinds_are_the_classes_names(name: str, kind: str) -> None:
    assert kebab(name) == kind


def test_factors_of_a_product_are_read_strictly() -> None:
    factors = [{"column": "rain"}, {"column": "wind", "form": "sine", "at": 360.0}]
    effect = effect_from_dict({"kind": "product", "acts": "location", "factors": factors})
    assert isinstance(effect, Product)
    with pytest.raises(DriverProfileError, match=r"factors\[1\]: unknown field 'unit'"):
        effect_from_dict({"kind": "product", "acts": "location", "factors": [factors[0], factors[1] | {"unit": "m"}]})
    with pytest.raises(DriverProfileError, match="factors"):
        effect_from_dict({"kind": "product", "acts": "location", "factors": factors[:1]})
