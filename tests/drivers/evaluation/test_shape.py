"""Each of the seventeen shapes against the words that describe it, one snippet at a time, by numpy and scipy alone."""

from __future__ import annotations

from collections import Counter
from itertools import groupby, pairwise

import numpy as np
import pytest
from scipy.signal import periodogram
from scipy.stats import entropy, kurtosis

from xosc_lateral.drivers.evaluation.classifier import EXTREME_QUANTILE, LARGE_CHANGE, SHAPES, shape_features

RNG = np.random.default_rng(41)
TIME = 0.2 * np.arange(51)
SNIPPETS = {
    "walks": RNG.normal(size=(6, 51)).cumsum(axis=1),
    "noise": RNG.normal(size=(6, 51)),
    "waves": np.sin(2.0 * np.pi * np.outer([0.1, 0.2, 0.35, 0.6], TIME) + RNG.uniform(0.0, 6.0, (4, 1))),
    "ramps": np.outer([1.0, -2.0], TIME) + 0.01 * RNG.normal(size=(2, 51)),
}


def longest(flags: np.ndarray) -> int:
    return max((len(list(run)) for value, run in groupby(flags.tolist()) if value), default=0)


def fullest(z: np.ndarray, bins: int) -> float:
    counts, edges = np.histogram(z, bins)
    return float(edges[counts.argmax()] + 0.5 * (edges[1] - edges[0]))


def median_place(z: np.ndarray, flags: np.ndarray) -> float:
    rows = np.flatnonzero(flags)
    return float(2.0 * rows[(len(rows) - 1) // 2] / (len(z) - 1) - 1.0) if len(rows) else 0.0


def words(z: np.ndarray) -> float:
    letters = np.empty(len(z), dtype=int)
    letters[np.argsort(z, kind="stable")] = 3 * np.arange(len(z)) // len(z)
    counts = Counter(zip(letters, letters[1:], letters[2:], strict=False))
    return float(entropy(list(counts.values()), base=2))


def described(snippet: np.ndarray) -> dict[str, float]:
    """The docstring of `shape_features`, taken at its word."""
    z = (snippet - snippet.mean()) / snippet.std()
    m, change = len(z), np.diff(z)
    memory = np.correlate(z, z, "full")[m - 1 :][: m // 2 + 1] / (z @ z)
    below = np.flatnonzero(memory < np.exp(-1.0))
    dips = [k for k in range(1, len(memory) - 1) if memory[k] < memory[k - 1] and memory[k] < memory[k + 1]]
    _, power = periodogram(z, window=np.hanning(m), detrend=False, scaling="spectrum")
    power = power[1:]
    if m % 2 == 0:
        power[-1] *= 2.0  # the one-sided spectrum has the last frequency once
    share = power / power.sum()
    return {
        "mode_5": fullest(z, 5),
        "mode_10": fullest(z, 10),
        "longest_above_mean": longest(z > 0.0) / m,
        "longest_decrease": longest(change < 0.0) / (m - 1),
        "decay": float(below[0]) if len(below) else float(len(memory)),
        "first_minimum": float(dips[0] - 1) if dips else float(len(memory) - 2),
        "reversibility": float((change**3).mean()),
        "large_changes": float((np.abs(change) > LARGE_CHANGE).mean()),
        "centroid": float(share @ np.linspace(0.0, 1.0, len(share))),
        "low_power": float(share[: max(1, len(share) // 5)].sum()),
        "late_extremes_high": median_place(z, z > EXTREME_QUANTILE),
        "late_extremes_low": median_place(z, z < -EXTREME_QUANTILE),
        "motifs": words(z),
        "forecast_error": float(np.std([z[k] - z[k - 3 : k].mean() for k in range(3, m)])),
        "kurtosis": float(kurtosis(z, fisher=False)),
        "change_kurtosis": float(kurtosis(change, fisher=False)),
        "sign_changes": float(np.mean([a * b < 0.0 for a, b in pairwise(change)])),
    }


@pytest.mark.parametrize("kind", SNIPPETS)
def test_every_shape_is_what_its_description_says(kind):
    for snippet, row in zip(SNIPPETS[kind], shape_features(SNIPPETS[kind]), strict=True):
        expected = described(snippet)
        assert list(expected) == list(SHAPES)
        for name, value in zip(SHAPES, row, strict=True):
            assert value == pytest.approx(expected[name], rel=1e-6, abs=1e-9), name


@pytest.mark.parametrize("kind", SNIPPETS)
def test_shapes_see_neither_where_a_snippet_lies_nor_how_large_it_is(kind):
    moved = 0.037 * SNIPPETS[kind] + 12.0
    np.testing.assert_allclose(shape_features(moved), shape_features(SNIPPETS[kind]), rtol=1e-6, atol=1e-6)


def test_a_mirror_changes_sides_and_nothing_else():
    """Left for right: modes and skewed changes change sign, high extremes become low ones."""
    here, there = (dict(zip(SHAPES, shape_features(sign * SNIPPETS["walks"]).T, strict=True)) for sign in (1.0, -1.0))
    np.testing.assert_allclose(there["reversibility"], -here["reversibility"], atol=1e-12)
    np.testing.assert_allclose(there["late_extremes_low"], here["late_extremes_high"])
    for name in ("decay", "first_minimum", "large_changes", "centroid", "low_power", "forecast_error", "kurtosis",
                 "change_kurtosis", "sign_changes"):  # fmt: skip
        np.testing.assert_allclose(there[name], here[name], rtol=1e-9, err_msg=name)
