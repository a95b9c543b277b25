"""On and off: a two-state Markov process in continuous time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.effects import Regimes

STEP = 0.1


def on_rows(effect: Regimes, seconds: float, seed: int) -> np.ndarray:
    return effect.states(effect.begin(np.random.default_rng(seed), STEP), STEP * np.arange(round(seconds / STEP)))


def test_regimes_last_exponentially_long() -> None:
    on = on_rows(Regimes(factor=2.0, on_s=8.0, off_s=20.0), 40_000.0, seed=1)
    edges = np.flatnonzero(np.diff(on.astype(int)))
    lengths = np.diff(edges) * STEP
    first_on = bool(on[edges[0] + 1])
    for start, mean in ((0 if first_on else 1, 8.0), (1 if first_on else 0, 20.0)):
        own = lengths[start::2]
        assert own.mean() == pytest.approx(mean, rel=4.0 / np.sqrt(len(own)))
        # a length is known to a sample, and one shorter than that is not seen
        assert stats.kstest(own - STEP / 2, "expon", (0.0, mean)).statistic < 0.05


def test_the_share_that_is_on_is_the_same_from_the_first_row_on() -> None:
    effect = Regimes(factor=2.0, on_s=10.0, off_s=30.0)
    drives = np.stack([on_rows(effect, 60.0, seed) for seed in range(600)])
    for row in (0, 100, -1):
        assert drives[:, row].mean() == pytest.approx(0.25, abs=4.0 * np.sqrt(0.25 * 0.75 / 600))


def test_memory_of_the_state_is_that_of_the_two_rates() -> None:
    """Covariance p (1 - p) exp(-lag (1 / on + 1 / off)) of a two-state chain."""
    on = on_rows(Regimes(factor=2.0, on_s=10.0, off_s=10.0), 60_000.0, seed=2).astype(float)
    on -= on.mean()
    lag = 5.0
    rows = round(lag / STEP)
    remembered = float((on[rows:] * on[:-rows]).mean()) / float((on**2).mean())
    assert remembered == pytest.approx(np.exp(-lag * 0.2), abs=0.05)


def test_both_factors_hold_while_it_is_on() -> None:
    on = np.array([False, True, True, False])
    terms = Regimes(factor=1.5, fine_factor=0.8, on_s=9.0, off_s=9.0).terms_where(on)
    np.testing.assert_array_equal(np.asarray(terms.spread), [1.0, 1.5, 1.5, 1.0])
    np.testing.assert_array_equal(np.asarray(terms.fine), [1.0, 0.8, 0.8, 1.0])
    assert terms.location is None
    assert terms.rate is None


def test_the_drive_s_clock_does_not_matter() -> None:
    effect, time = Regimes(factor=2.0, on_s=3.0, off_s=3.0), STEP * np.arange(600)
    here, later = (effect.states(effect.begin(np.random.default_rng(3), STEP), start + time) for start in (0.0, 512.0))
    np.testing.assert_array_equal(here, later)
    assert 0 < here.sum() < 600


@pytest.mark.parametrize("field", ["factor", "fine_factor", "on_s", "off_s"])
def test_every_number_but_the_error_is_above_nothing(field: str) -> None:
    with pytest.raises(DriverProfileError, match=f"regimes: {field} = "):
        Regimes(**{"factor": 2.0, "on_s": 9.0, "off_s": 9.0} | {field: 0.0})
