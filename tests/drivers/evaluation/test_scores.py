"""Scores against definitions, closed forms and scipy; profiles against data of their own and of others."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.stats import wasserstein_distance

from laboratory.comparison import compare_profiles, driver_distances
from tests.kit.snippet_distances import snippet_distances
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.drives.drive import STEP, Run
from xosc_lateral.drivers.evaluation.lane_keeping import figures_of, margins
from xosc_lateral.drivers.evaluation.metrics import (
    METRICS,
    cut_snippets,
    free_runs,
    metric_distances,
    snippet_metrics,
    split_groups,
    wasserstein,
)
from xosc_lateral.drivers.evaluation.scores import score_profile, score_snippets, scores_to_dict
from xosc_lateral.drivers.evaluation.snippets import snippets_of
from xosc_lateral.drivers.evaluation.spectra import autocorrelation, spectrum
from xosc_lateral.drivers.fitting.fitting import fit_runs
from xosc_lateral.drivers.fitting.models.two_level import split_levels
from xosc_lateral.drivers.model.profile import DriverProfile

# ---- metrics and distances -------------------------------------------------------------------------------------------


def test_the_ten_metrics_follow_their_definitions():
    rows = np.random.default_rng(1).normal(size=(50, 51)).cumsum(axis=1)
    difference = 10 * np.diff(rows, axis=1)
    expected = {
        "max": rows.max(axis=1),
        "min": rows.min(axis=1),
        "mean": rows.mean(axis=1),
        "std": rows.std(axis=1),
        "median": np.median(rows, axis=1),
        "q25": np.quantile(rows, 0.25, axis=1),
        "q75": np.quantile(rows, 0.75, axis=1),
        "range": np.ptp(rows, axis=1),
        "diff_mean": difference.mean(axis=1),
        "diff_std": difference.std(axis=1),
    }
    metrics = snippet_metrics(rows)
    assert tuple(expected) == METRICS
    for k, name in enumerate(METRICS):
        np.testing.assert_allclose(metrics[:, k], expected[name], rtol=1e-12, atol=1e-12, err_msg=name)


def test_quantiles_hold_for_even_lengths_too():
    rows = np.random.default_rng(2).normal(size=(20, 32))
    np.testing.assert_allclose(snippet_metrics(rows)[:, 5], np.quantile(rows, 0.25, axis=1))


def test_a_value_that_is_not_finite_is_refused():
    with pytest.raises(ValueError, match="not finite"):
        snippet_metrics(np.array([[0.0, np.nan, 1.0]]))


@pytest.mark.parametrize("sizes", [(40, 40), (31, 77), (1, 5)])
def test_wasserstein_agrees_with_scipy(sizes):
    rng = np.random.default_rng(3)
    a, b = rng.normal(size=sizes[0]), rng.normal(0.4, 1.7, size=sizes[1])
    assert wasserstein(a, b) == pytest.approx(wasserstein_distance(a, b), rel=1e-12)


def test_distance_of_a_shift_is_the_shift_in_standard_deviations():
    rows = np.random.default_rng(4).normal(size=(400, 51)).cumsum(axis=1)
    shifted = snippet_distances(rows, rows + 0.5)
    spread = snippet_metrics(rows).std(axis=0)
    assert shifted.by_metric["mean"] == pytest.approx(0.5 / spread[METRICS.index("mean")], rel=1e-9)
    assert shifted.by_metric["std"] == pytest.approx(0.0, abs=1e-9)
    assert shifted.worst in {"max", "min", "mean", "median", "q25", "q75"}


def test_a_metric_that_never_varies_gives_no_infinite_distance():
    flat = np.zeros((10, 51))
    found = metric_distances(snippet_metrics(flat), snippet_metrics(flat + 0.1))
    assert found.by_metric["mean"] == pytest.approx(0.1) and np.isfinite(found.mean)


def test_halves_share_no_group():
    groups = np.repeat(np.arange(9), 5)
    half = split_groups(groups, np.random.default_rng(0))
    assert not set(groups[half]) & set(groups[~half]) and 15 < half.sum() < 30


def test_one_group_alone_can_not_be_split():
    with pytest.raises(NotEnoughDataError, match="1 group"):
        split_groups(np.zeros(5), np.random.default_rng(0))


# ---- long-term -------------------------------------------------------------------------------------------------------


def test_spectrum_of_white_noise_is_flat_and_as_strong_as_it_should_be():
    rng = np.random.default_rng(6)
    found = spectrum([rng.normal(0, 0.3, 4000) for _ in range(6)], STEP)
    # one-sided density of white noise with variance s2: 2 s2 step, in every band
    np.testing.assert_allclose(found.density, 2 * 0.3**2 * STEP, rtol=0.2)
    assert found.frequency[0] < 0.013 and found.frequency[-1] > 0.85


def test_spectrum_finds_a_weave_where_it_is():
    time = STEP * np.arange(5000)
    rng = np.random.default_rng(7)
    found = spectrum([0.2 * np.sin(2 * np.pi * 0.1 * time) + rng.normal(0, 0.01, len(time))], STEP)
    assert found.frequency[np.argmax(found.density)] == pytest.approx(0.1, rel=0.15)


def test_bands_slower_than_all_runs_are_left_out():
    found = spectrum([np.random.default_rng(8).normal(size=100) for _ in range(20)], STEP)
    assert found.frequency.min() > 1 / (100 * STEP) and np.isfinite(found.density).all()


def test_autocorrelation_of_a_first_order_process_decays_as_it_must():
    rng = np.random.default_rng(9)
    keep, x = 0.95, np.zeros(200_000)
    kick = rng.normal(size=len(x))
    for k in range(1, len(x)):
        x[k] = keep * x[k - 1] + kick[k]
    np.testing.assert_allclose(autocorrelation([x], [1, 5, 20]), keep ** np.array([1, 5, 20]), atol=0.02)


def test_margins_count_time_and_entries():
    width = np.full(1000, 3.6)
    offset = np.zeros(1000)
    offset[100:150] = 0.7  # 1.1 m from the left marking
    offset[400:410] = -0.8
    found = margins([offset], [width], STEP)
    assert found.share_near == pytest.approx(0.06)
    assert found.excursions_per_hour == pytest.approx(2 / (1000 * STEP / 3600))
    assert found.largest == 0.8


# ---- profiles --------------------------------------------------------------------------------------------------------


def _run(offset: np.ndarray, drive: str, index: int = 0) -> Run:
    n = len(offset)
    return Run(drive, index, STEP * np.arange(n), offset, np.full(n, 3.6), {"speed": np.full(n, 30.0)})


def _swaying(seed: int, drives: int, mean: float = 0.0, spread: float = 0.25, n: int = 600) -> list[Run]:
    """Drivers that sway: second-order noise with time constants of 4 and 2 s, smooth like real driving."""
    from scipy.signal import lfilter

    rng = np.random.default_rng(seed)
    kicks = rng.normal(size=(drives, n + 400))
    x = lfilter([1.0], np.poly([0.95, 0.9]), kicks, axis=1)[:, 400:]
    return [_run(mean + spread * row / x.std(), f"d{k:02d}") for k, row in enumerate(x)]


@pytest.fixture(scope="module")
def profile() -> DriverProfile:
    return fit_runs(_swaying(1, 30), name="swaying", model="two-level")


def test_snippets_stay_within_their_run_and_keep_their_place():
    runs = _swaying(2, 8, n=170)
    cut = snippets_of(runs, 10.0, STEP)
    assert cut.offset.shape == (24, 51)
    for one, row in zip(cut.items, cut.offset, strict=True):
        np.testing.assert_array_equal(one.run.offset[one.rows], row)
    np.testing.assert_array_equal(cut.cut_from([run.offset for run in runs]), cut.offset)
    assert set(cut.group) == {run.drive for run in runs}


def test_one_long_drive_is_split_by_blocks_of_time():
    run = _run(np.zeros(3001), "alone")
    assert len(set(snippets_of([run], 10.0, STEP).group)) == 5


def test_runs_shorter_than_a_snippet_give_none():
    assert len(snippets_of([_run(np.zeros(20), "a")], 10.0, STEP)) == 0


@pytest.mark.pages
def test_a_profile_is_as_close_to_what_it_generates_as_that_is_to_itself(profile):
    made = [_run(row, f"s{k}") for k, row in enumerate(free_runs(profile, 3, drivers=40, duration=100.0))]
    scores = score_profile(profile, made, seed=1, classify=False)
    assert scores.snippets.ratio == pytest.approx(1.0, abs=0.25)
    assert scores.snippets.worst_ratio[1] < 2.0
    assert scores.spectrum_error < 1.0
    assert scores.margins_sampled.share_near == pytest.approx(scores.margins_real.share_near, abs=0.03)


@pytest.mark.pages
def test_a_foreign_driver_is_far_away(profile):
    restless = score_profile(profile, _swaying(4, 12, spread=0.5), seed=1, classify=False)
    assert restless.snippets.ratio > 2.0


@pytest.mark.pages
def test_two_levels_miss_the_differences_as_the_paper_reports(profile):
    scores = score_profile(profile, _swaying(5, 20), seed=2, classify=False)
    ratio = {
        name: scores.snippets.distances.by_metric[name] / scores.snippets.floor.by_metric[name] for name in METRICS
    }
    assert ratio["diff_std"] > 2.0
    assert max(ratio[name] for name in ("max", "min", "mean", "median", "q25", "q75")) < 1.5


def test_every_artificial_snippet_starts_where_the_real_one_starts(profile):
    from xosc_lateral.drivers.evaluation.snippets import sample_snippets

    cut = snippets_of(_swaying(6, 10), 10.0, STEP)
    np.testing.assert_allclose(sample_snippets(profile, cut, 0)[:, 0], cut.offset[:, 0], atol=1e-12)


def test_first_evaluation_is_the_real_drive_but_for_the_shift(profile):
    runs = _swaying(7, 8)
    scores = score_profile(profile, runs, seed=0, classify=False)
    first = scores.evaluations[0]
    cut = snippets_of(runs, 10.0, STEP)
    parts = [split_levels(one.run.rel_offset) for one in cut.items]
    coarse = np.array([part[0][one.rows] for part, one in zip(parts, cut.items, strict=True)])
    fine = np.array([part[1][one.rows] for part, one in zip(parts, cut.items, strict=True)])
    expected = snippet_metrics((coarse + np.roll(fine, 25, axis=1)) * 3.6)
    np.testing.assert_allclose(first.artificial, expected)
    assert [one.number for one in scores.evaluations] == [1, 2, 3, 4]
    assert first.distances.by_metric["mean"] < min(one.distances.by_metric["mean"] for one in scores.evaluations[1::2])


@pytest.mark.pages
def test_same_seed_same_scores_and_json_holds_them_all(profile):
    runs = _swaying(8, 6)
    first, again = (json.dumps(scores_to_dict(score_profile(profile, runs, seed=5, classify=False))) for _ in range(2))
    assert first == again
    values = json.loads(first)
    assert set(values["snippets"]["distance"]) == set(METRICS)
    assert len(values["evaluations"]) == 4 and values["classifier_auc"] is None
    assert [one["start"] for one in values["realism"][:3]] == ["same", "free", "free"]


def test_too_few_snippets_are_refused_with_their_number(profile):
    with pytest.raises(NotEnoughDataError, match=r"2 snippets of 10 s .* 20 are needed"):
        score_profile(profile, [_run(np.zeros(110), "a")], seed=0)


def test_ratio_compares_halves_of_equal_size():
    rng = np.random.default_rng(10)
    real, other = rng.normal(size=(2, 600, 51))
    scores = score_snippets(real, other, np.arange(600).astype(str), seed=0)
    assert scores.ratio == pytest.approx(1.0, abs=0.15)


def test_profiles_know_their_drivers():
    drivers = [(0.4, 0.1), (-0.3, 0.1), (0.0, 0.3)]
    runs = [_swaying(20 + k, 1, mean, spread, n=2000)[0] for k, (mean, spread) in enumerate(drivers)]
    early = [fit_runs([_run(run.offset[:1200], "d")], name=f"d{k}", model="two-level") for k, run in enumerate(runs)]
    late = [cut_snippets(run.offset[1200:], 51) for run in runs]
    distance = driver_distances(early, late)
    assert (distance.argmin(axis=1) == np.arange(3)).all() and (distance.argmin(axis=0) == np.arange(3)).all()


def test_comparison_tells_left_from_right(profile):
    left = fit_runs(_swaying(30, 20, mean=0.4), name="left", model="two-level")
    assert figures_of(left)[0].mean_offset == pytest.approx(0.4, abs=0.08)
    assert compare_profiles(left, profile).by_metric["mean"] > 1.0
    assert compare_profiles(profile, profile).mean < 0.15
