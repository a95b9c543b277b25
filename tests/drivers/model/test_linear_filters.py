"""Loops: many recursions side by side, compiled or not, are each what scipy's filter makes of it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from xosc_lateral.drivers.model import linear_filters
from xosc_lateral.drivers.model.linear_filters import convolve, recur
from xosc_lateral.drivers.model.seeds import AutoregressiveSeed, DriveSeed, TwoLevelSeed, child, generator

COEFFICIENTS = np.array([1.2, -0.5, 0.1])


@pytest.mark.parametrize("paths", [1, 3, 40])
@pytest.mark.parametrize("compiled", [False, True], ids=["plain", "compiled"])
def test_recursions_side_by_side_are_scipys_filter(paths: int, compiled: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(linear_filters, "worth_compiling", lambda steps: compiled)
    rng = np.random.default_rng(paths)
    past, noise = rng.normal(size=(3, paths)), rng.normal(size=(60, paths))
    series = recur(past, noise, COEFFICIENTS)
    for k in range(paths):
        # What the past adds to the first steps, as lfilter wants to be told.
        state = [sum(COEFFICIENTS[j] * past[2 - j + i, k] for j in range(i, 3)) for i in range(3)]
        expected, _ = lfilter([1.0], np.concatenate([[1.0], -COEFFICIENTS]), noise[:, k], zi=state)
        np.testing.assert_allclose(series[3:, k], expected, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(series[:3], past)


def test_one_recursion_gives_the_same_bits_alone_and_beside_others() -> None:
    rng = np.random.default_rng(1)
    past, noise = rng.normal(size=(3, 20)), rng.normal(size=(30, 20))
    beside = recur(past, noise, COEFFICIENTS)
    for k in (0, 7, 19):
        np.testing.assert_array_equal(recur(past[:, k], noise[:, k], COEFFICIENTS), beside[:, k])


@pytest.mark.parametrize("columns", [1, 5])
def test_a_convolution_in_columns_is_numpys(columns: int) -> None:
    rng = np.random.default_rng(2)
    values, half = rng.normal(size=(400, columns)), rng.normal(size=12)
    kernel = np.concatenate([half, [0.7], half[::-1]])
    found = convolve(values, kernel)
    for k in range(columns):
        np.testing.assert_allclose(found[:, k], np.convolve(values[:, k], kernel, "valid"), rtol=0, atol=1e-12)


def test_every_source_of_chance_has_a_seed_of_its_own() -> None:
    for keys in (DriveSeed, TwoLevelSeed, AutoregressiveSeed):
        assert len({int(key) for key in keys}) == len(keys)
    root = np.random.SeedSequence(5)
    first = {generator(root, key).integers(1 << 62) for key in DriveSeed}
    assert len(first) == len(DriveSeed)
    assert root.n_children_spawned == 0
    assert child(child(root, 1), 2).spawn_key == child(root, 1, 2).spawn_key == (1, 2)
