"""The classifier, and the shapes that it looks at."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.drivers.evaluation.classifier import (
    classifier_two_sample_test,
)


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
