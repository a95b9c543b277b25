"""A slow drift: half cosines that follow it, and a process whose size and memory are known beforehand."""

from __future__ import annotations

import numpy as np
import pytest

from tests.identification.made_coarse import SPREAD, coarse_of, movement, wander
from xosc_lateral.driver.effects import Drift
from xosc_lateral.identification.regression import Fitted, fit_model
from xosc_lateral.identification.terms.base import Removal
from xosc_lateral.identification.terms.drift import SIZES, DriftTerm

SECONDS = 3000.0


def fit(size: float, seed: int, memory: float = 300.0) -> Fitted:
    """0.1 m of movement about a mean that wanders by `size` [m]."""
    rng = np.random.default_rng(seed)
    slow = size * wander(rng, round(SECONDS / 0.2), memory)
    return fit_model(coarse_of(slow + movement(rng, SECONDS)), (DriftTerm(),))


def estimate(fitted: Fitted) -> Drift:
    (effect,) = fitted.terms[0].estimate(fitted)  # type: ignore[attr-defined]
    assert isinstance(effect, Drift)
    return effect


def test_a_wander_of_20_centimetres_is_sized_within_its_error() -> None:
    """Ten correlation times hold a size to a quarter; the median of five drives to less."""
    found = [estimate(fit(0.2, seed)) for seed in range(41, 46)]
    assert np.median([one.size for one in found]) == pytest.approx(0.2, rel=0.3)
    assert all(0.0 < one.size_error < one.size for one in found)


def test_without_a_wander_hardly_anything_is_left_for_it() -> None:
    assert np.median([estimate(fit(0.0, seed)).size for seed in range(51, 56)]) <= 0.4 * SPREAD


def test_slow_wander_is_told_from_quick() -> None:
    quick, slow = (
        np.median([estimate(fit(0.2, seed, m)).correlation_s for seed in (61, 62, 63)]) for m in (60.0, 900.0)
    )
    assert quick < slow


def test_the_unit_scales_the_size_along_the_grid_of_sizes() -> None:
    rng = np.random.default_rng(64)
    offset = 0.2 * wander(rng, round(SECONDS / 0.2), 300.0) + movement(rng, SECONDS)
    one, two = (estimate(fit_model(coarse_of(k * offset), (DriftTerm(),))) for k in (1.0, 2.0))
    assert two.size / one.size == pytest.approx(2.0, rel=2.0 * (SIZES[1] / SIZES[0] - 1.0))


def test_what_is_removed_is_the_wander_about_its_mean() -> None:
    rng = np.random.default_rng(65)
    slow, own = 0.2 * wander(rng, round(SECONDS / 0.2), 600.0), movement(rng, SECONDS)
    fitted = fit_model(coarse_of(slow + own), (DriftTerm(),))
    timeline = fitted.coarse.timeline
    removal = Removal(np.zeros(len(timeline)))
    DriftTerm.remove(fitted.terms[0], fitted, (estimate(fitted),), removal)  # type: ignore[arg-type]
    inside = timeline.valid
    assert removal.location[inside].mean() == pytest.approx(0.0, abs=0.01)
    assert np.corrcoef(removal.location[inside], slow[inside])[0, 1] > 0.85
    assert (removal.spread == 0.0).all()


def test_it_is_looked_for_beside_a_step_and_not_by_itself() -> None:
    assert DriftTerm.test(None, None) is None  # type: ignore[arg-type]
    assert not DriftTerm().predictable


def test_it_is_told_by_its_size_and_how_long_it_lasts() -> None:
    told = DriftTerm().describe(None, (Drift(size=0.2, size_error=0.05, correlation_s=300.0),), "drift 0")  # type: ignore[arg-type]
    assert (told.name, told.shape, told.size, told.error) == ("slow drift", "correlated over 300 s", 0.2, 0.05)
