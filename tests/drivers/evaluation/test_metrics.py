"""The ten metrics against numpy, and what moves them."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.drivers.evaluation.metrics import DIFFERENCE_SCALE, METRICS, cut_snippets, snippet_metrics

ROWS = np.random.default_rng(1).normal(size=(40, 51)).cumsum(axis=1)
FOUND = {name: snippet_metrics(ROWS)[:, k] for k, name in enumerate(METRICS)}
EXPECTED = {
    "max": ROWS.max(axis=1),
    "min": ROWS.min(axis=1),
    "mean": ROWS.mean(axis=1),
    "std": ROWS.std(axis=1),
    "median": np.median(ROWS, axis=1),
    "q25": np.quantile(ROWS, 0.25, axis=1),
    "q75": np.quantile(ROWS, 0.75, axis=1),
    "range": np.ptp(ROWS, axis=1),
    "diff_mean": 10.0 * np.diff(ROWS, axis=1).mean(axis=1),
    "diff_std": 10.0 * np.diff(ROWS, axis=1).std(axis=1),
}


@pytest.mark.parametrize("name", METRICS)
def test_each_metric_is_numpys(name: str) -> None:
    np.testing.assert_allclose(FOUND[name], EXPECTED[name], rtol=1e-12, atol=1e-13)


def test_a_place_moves_the_six_that_tell_a_place() -> None:
    moved = snippet_metrics(ROWS + 0.15) - snippet_metrics(ROWS)
    places = [name in ("max", "min", "mean", "median", "q25", "q75") for name in METRICS]
    np.testing.assert_allclose(moved, np.tile(np.where(places, 0.15, 0.0), (40, 1)), atol=1e-12)


def test_the_unit_goes_through() -> None:
    np.testing.assert_allclose(snippet_metrics(100.0 * ROWS), 100.0 * snippet_metrics(ROWS), rtol=1e-12)


def test_the_mirror_image_swaps_what_is_left_and_right() -> None:
    mirrored = dict(zip(METRICS, snippet_metrics(-ROWS).T, strict=True))
    for name, other in (("max", "min"), ("q25", "q75"), ("mean", "mean"), ("median", "median")):
        np.testing.assert_allclose(mirrored[name], -FOUND[other], atol=1e-12)
    for name in ("std", "range", "diff_std"):
        np.testing.assert_allclose(mirrored[name], FOUND[name], atol=1e-12)


def test_a_snippet_backwards_differs_in_the_mean_difference_alone() -> None:
    change = snippet_metrics(ROWS[:, ::-1]) - snippet_metrics(ROWS)
    np.testing.assert_allclose(np.delete(change, METRICS.index("diff_mean"), axis=1), 0.0, atol=1e-12)


@pytest.mark.parametrize("length", [2, 3, 4, 5])
def test_short_snippets_have_quantiles_between_their_values(length: int) -> None:
    rows = ROWS[:, :length]
    np.testing.assert_allclose(snippet_metrics(rows)[:, METRICS.index("q75")], np.quantile(rows, 0.75, axis=1))


def test_a_slope_is_told_per_step_ten_times() -> None:
    found = snippet_metrics(0.01 * np.arange(51.0)[None])[0]
    assert found[METRICS.index("diff_mean")] == pytest.approx(0.01 * DIFFERENCE_SCALE)
    assert found[METRICS.index("diff_std")] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("shape", [(3, 1), (51,), (2, 3, 4)], ids=str)
def test_what_is_no_set_of_snippets_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="at least 2"):
        snippet_metrics(np.zeros(shape))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_no_number_is_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="not finite"):
        snippet_metrics(np.array([[0.0, bad]]))


@pytest.mark.parametrize(("n", "count"), [(0, 0), (50, 0), (51, 1), (101, 1), (102, 2)])
def test_series_are_cut_into_whole_snippets(n: int, count: int) -> None:
    series = np.arange(float(n))
    cut = cut_snippets(series, 51)
    assert cut.shape == (count, 51)
    np.testing.assert_array_equal(cut.ravel(), series[: 51 * count])
