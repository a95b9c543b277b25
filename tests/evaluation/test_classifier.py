"""The classifier, and the shapes that it looks at."""

from __future__ import annotations

import numpy as np
import pytest

from tests.baselines.made_runs import made_run
from xosc_lateral.evaluation.classifier import (
    FOLDS,
    area_under_roc,
    classifier_two_sample_test,
    context_features,
    snippet_features,
)
from xosc_lateral.evaluation.rocket import BIASES, rocket_features
from xosc_lateral.evaluation.shape import SHAPES, longest_true, shape_features
from xosc_lateral.evaluation.snippets import snippets_of


def _walks(seed: int, n: int = 100) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(n, 51)).cumsum(axis=1)


GROUPS = np.arange(100) // 10


def test_rough_is_told_from_smooth_and_like_is_not_told_from_like():
    pytest.importorskip("sklearn", reason="extra `classifier` is not installed")
    alike = classifier_two_sample_test(_walks(1), _walks(2), GROUPS, GROUPS)
    assert alike.auc == pytest.approx(0.5, abs=0.15)  # 3 standard errors of 2 x 100 snippets in ten groups
    rough = _walks(3) + np.random.default_rng(4).normal(size=(100, 51))
    apart = classifier_two_sample_test(_walks(1), rough, GROUPS, GROUPS)
    assert apart.auc > apart.low > 0.9


def test_convolutions_tell_shapes_apart_that_have_the_same_spectrum():
    """A jump there and back against the same one mirrored in time: slow rise, sudden fall."""
    pytest.importorskip("sklearn", reason="extra `classifier` is not installed")
    rng = np.random.default_rng(8)
    rise = np.minimum(np.arange(51.0) % 17.0, 12.0) / 12.0
    real, other = (
        np.array([np.roll(shape, rng.integers(51)) for _ in range(100)]) + 0.3 * rng.normal(size=(100, 51))
        for shape in (rise, rise[::-1])
    )
    assert classifier_two_sample_test(real, other, GROUPS, GROUPS, rocket=True).auc > 0.9
    alike = classifier_two_sample_test(real[:50], real[50:], GROUPS[:50], GROUPS[:50], rocket=True)
    assert alike.auc == pytest.approx(0.5, abs=0.2)


def test_a_convolutions_feature_is_the_share_above_its_bias():
    features = rocket_features(_walks(11, 5), _walks(12, 7))
    assert features.shape == (5, 84 * BIASES) and ((features >= 0.0) & (features <= 1.0)).all()
    level = (
        _walks(11, 5) + 1000.0
    )  # weights sum to zero: away from the ends a level is not seen, and half are bare of them
    unseen = (rocket_features(level, _walks(12, 7) + 1000.0) == features).mean()
    assert unseen > 0.4
    np.testing.assert_array_equal(features, rocket_features(_walks(11, 5), _walks(12, 7)))


def test_what_only_context_tells_is_told_with_context_alone():
    pytest.importorskip("sklearn", reason="extra `classifier` is not installed")
    side = np.random.default_rng(5).choice([-1.0, 1.0], size=100)
    real = _walks(6) + 30.0 * side[:, None]
    other = _walks(7) - 30.0 * side[:, None]  # as often on either side, but on the wrong one
    assert classifier_two_sample_test(real, other, GROUPS, GROUPS).auc < 0.65
    assert classifier_two_sample_test(real, other, GROUPS, GROUPS, context=(side[:, None], side[:, None])).auc > 0.8


def test_context_is_the_same_for_both_and_how_a_path_moves_with_it_is_not():
    runs = [
        made_run(walk, drive=f"d{k}", lead=np.full(51, 20.0 + k), sway=np.sin(np.arange(51.0)))
        for k, walk in enumerate(_walks(9, 6))
    ]
    cut = snippets_of(runs, 10.0, 0.2)
    real, other = context_features(cut, cut.offset), context_features(cut, _walks(10, 6))
    assert real.shape == (6, 9)  # mean, spread and correlation of lead, speed and sway
    np.testing.assert_array_equal(real[:, :8], other[:, :8])
    assert not np.allclose(real[:, 8], other[:, 8])
    assert (real[:, 2] == -2.0).all()  # `lead` never changes, so nothing moves with it


def test_classifier_stays_silent_with_too_few_drives():
    rows = np.zeros((10, 51))
    assert classifier_two_sample_test(rows, rows, np.zeros(10), np.zeros(10)) is None
    assert FOLDS == 5


def test_area_is_the_share_of_pairs_in_the_right_order():
    score = np.array([0.1, 0.4, 0.4, 0.9])
    label = np.array([False, True, False, True])
    assert area_under_roc(score, label, np.ones(4)) == pytest.approx((2 + 1 + 0.5) / 4)
    # A weight of two is a row that is there twice.
    weighted = area_under_roc(score, label, np.array([1.0, 1.0, 2.0, 1.0]))
    twice = area_under_roc(np.append(score, 0.4), np.append(label, False), np.ones(5))
    assert weighted == pytest.approx(twice)


def test_shape_knows_neither_place_nor_size():
    walks = _walks(8, 20)
    np.testing.assert_allclose(shape_features(3.0 * walks + 2.0), shape_features(walks), atol=1e-9)
    assert shape_features(walks).shape == (20, len(SHAPES))


def test_shapes_follow_their_definitions():
    ramp = np.linspace(0.0, 1.0, 40)
    rows = np.array([ramp, -ramp, np.sin(2 * np.pi * np.arange(40) / 10)])
    found = dict(zip(SHAPES, shape_features(rows).T, strict=True))
    np.testing.assert_allclose(found["longest_above_mean"][:2], 0.5)
    np.testing.assert_allclose(found["longest_decrease"][:2], [0.0, 39 / 39])
    assert found["first_minimum"][2] == pytest.approx(4.0)  # half a period of 10 rows, counted from the second lag
    assert found["late_extremes_high"][0] > 0.6 > -0.6 > found["late_extremes_high"][1]
    assert found["kurtosis"][2] == pytest.approx(1.5, abs=0.01)
    assert found["motifs"][0] < found["motifs"][2]
    np.testing.assert_allclose(longest_true(np.array([[1, 1, 0, 1], [0, 0, 0, 0]], dtype=bool)), [0.5, 0.0])


@pytest.mark.parametrize("rows", [np.zeros((3, 51)), np.full((3, 51), 0.2)])
def test_no_movement_is_a_number_too(rows):
    assert np.isfinite(shape_features(rows)).all() and np.isfinite(snippet_features(rows)).all()


def test_fast_movement_is_told_by_its_own_frequencies_where_it_is_looked_at():
    """Waves of a tenth of the walk's steps at 2.2 or at 2.4 Hz lie in one band of a logarithmic scale."""
    pytest.importorskip("sklearn", reason="extra `classifier` is not installed")
    time = 0.2 * np.arange(51)
    phase = np.random.default_rng(3).uniform(0.0, 2.0 * np.pi, (2, 100, 1))
    walks = [np.cumsum(_walks(seed), axis=1) for seed in (21, 22)]
    size = 0.1 * np.abs(np.diff(walks[0], axis=1)).mean()
    real, other = (
        walk + size * np.sin(2.0 * np.pi * frequency * time + start)
        for walk, frequency, start in zip(walks, (2.2, 2.4), phase, strict=True)
    )
    looked = classifier_two_sample_test(real, other, GROUPS, GROUPS, fast=True).auc
    assert looked > classifier_two_sample_test(real, other, GROUPS, GROUPS).auc + 0.1
