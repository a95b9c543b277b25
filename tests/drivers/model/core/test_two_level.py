"""The paper's model, fitted and sampled."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.fitting.models.two_level import fit_two_level, split_levels
from xosc_lateral.drivers.model.core.base import Start
from xosc_lateral.drivers.model.core.two_level.model import PAPER_SETTINGS, TwoLevelModel, TwoLevelSettings
from xosc_lateral.drivers.model.records import plain, read_as


def wandering(n: int, seed: int, *, spread: float = 0.07, memory: float = 25.0, noise: float = 0.004) -> np.ndarray:
    """An Ornstein-Uhlenbeck wander with some white noise: no relative of the model. Memory in steps."""
    rng = np.random.default_rng(seed)
    keep, values, x = np.exp(-1 / memory), np.empty(n), 0.0
    for i, shock in enumerate(rng.normal(size=n)):
        x = keep * x + np.sqrt(1 - keep**2) * spread * shock
        values[i] = x
    return values + noise * rng.normal(size=n)


@pytest.fixture(scope="module")
def model() -> TwoLevelModel:
    return fit_two_level([wandering(6000, seed) for seed in range(3)])


def together(model: TwoLevelModel, n: int, seed: int = 0, start: Start | None = None) -> np.ndarray:
    coarse, fine = model.stream(np.random.SeedSequence(seed), start).take(n)
    return coarse + fine


def test_smoothing_kernel_is_the_papers() -> None:
    kernel = TwoLevelSettings().smoothing_kernel
    assert len(kernel) == 11  # +-1 s at 0.2 s
    assert kernel.sum() == pytest.approx(1.0)
    assert kernel[5] / kernel[8] == pytest.approx(np.exp(0.5))  # one sigma of 0.6 s = three steps
    assert np.allclose(kernel, kernel[::-1])


def test_coarse_part_is_the_binned_offset_smoothed_and_fine_part_capped() -> None:
    values = np.where(np.arange(100) < 50, 0.01, 0.12)
    coarse, fine = split_levels(values)
    assert coarse[:40] == pytest.approx(0.025)  # centre of bin 10
    assert coarse[60:] == pytest.approx(0.125)
    kernel = TwoLevelSettings().smoothing_kernel
    assert coarse[50] == pytest.approx(0.025 + 0.1 * kernel[:6].sum())
    assert np.abs(fine).max() <= 0.03
    assert fine[:40] == pytest.approx(-0.015)


@pytest.mark.parametrize("seed", range(3))
def test_sampling_and_refitting_gives_the_same_transitions(model: TwoLevelModel, seed: int) -> None:
    """Smoothing blurs the bins, so the levels are compared before it, as the chain walked them."""
    stream = model.stream(np.random.SeedSequence(seed))
    levels = stream.walk(100_000)[:, 0]
    refit = fit_two_level([levels])
    visits = refit.chain.counts.sum(axis=1)
    p = model.chain.transition
    error = np.sqrt(p * (1 - p) / np.maximum(visits, 1)[:, None])
    often = visits > 100
    assert (np.abs(refit.chain.transition - p) <= 5 * error + 1e-3)[often].all()


@pytest.mark.parametrize("seed", range(3))
def test_sampled_offsets_have_the_datas_mean_spread_and_fine_part(model: TwoLevelModel, seed: int) -> None:
    real = np.concatenate([wandering(6000, k) for k in range(3)])
    sampled = together(model, 60_000, seed)
    # 18 000 correlated values hold about 18 000 / 50 independent ones.
    assert sampled.mean() == pytest.approx(real.mean(), abs=5 * 0.07 / np.sqrt(360))
    assert sampled.std() == pytest.approx(real.std(), rel=0.15)
    fine = model.stream(np.random.SeedSequence(seed)).take(60_000)[1]
    assert fine.std() == pytest.approx(split_levels(real)[1].std(), rel=0.1)


@pytest.mark.parametrize("start", [None, Start(0.11), Start(-0.62), Start(0.2, spread=1.5, fine=0.5)])
def test_pieces_are_the_whole(model: TwoLevelModel, start: Start | None) -> None:
    whole = np.array(model.stream(np.random.SeedSequence(7), start).take(1000))
    stream = model.stream(np.random.SeedSequence(7), start)
    assert np.array_equal(np.hstack([stream.take(n) for n in (1, 0, 4, 17, 300, 678)]), whole)


def test_pieces_are_the_whole_at_a_varying_pace(model: TwoLevelModel) -> None:
    rate = np.random.default_rng(0).uniform(0.3, 3.0, 900)
    whole = np.array(model.stream(np.random.SeedSequence(7)).take(900, rate))
    stream = model.stream(np.random.SeedSequence(7))
    assert np.array_equal(np.hstack([stream.take(300, rate[k : k + 300]) for k in (0, 300, 600)]), whole)


def test_pace_stretches_the_coarse_part_and_leaves_the_fine(model: TwoLevelModel) -> None:
    coarse, fine = model.stream(np.random.SeedSequence(3)).take(2000)
    fast, same = model.stream(np.random.SeedSequence(3)).take(1000, np.full(1000, 2.0))
    assert np.array_equal(fast[:990], coarse[:1980:2])
    assert np.array_equal(same, fine[:1000])


def test_a_drive_starts_where_it_is_told_to(model: TwoLevelModel) -> None:
    for offset in (-0.7, -0.2, 0.0, 0.123, 0.5):
        assert together(model, 2, 1, Start(offset))[0] == pytest.approx(offset, abs=1e-12)
    coarse, fine = model.stream(np.random.SeedSequence(2), Start(0.2, spread=2.0, fine=3.0)).take(1)
    assert model.mean + 2.0 * (coarse[0] - model.mean) + 3.0 * fine[0] == pytest.approx(0.2, abs=1e-12)


def test_ten_hours_stay_inside_the_data_and_do_not_stick(model: TwoLevelModel) -> None:
    values = together(model, 180_000, 5)
    bins = np.flatnonzero(model.chain.support)
    low, high = bins[0] / 20 - 0.5, (bins[-1] + 1) / 20 - 0.5
    assert low - 0.05 < values.min()
    assert values.max() < high + 0.05
    hours = values.reshape(10, -1)
    assert hours.std(axis=1).min() > 0.5 * values.std()
    assert np.abs(np.diff(values)).max() < 0.1


def test_same_seed_same_numbers_other_seed_others(model: TwoLevelModel) -> None:
    assert np.array_equal(together(model, 500, 1), together(model, 500, 1))
    assert not np.array_equal(together(model, 500, 1), together(model, 500, 2))


def test_short_samples_come_without_numba() -> None:
    code = (
        "import sys, numpy as np\n"
        "from xosc_lateral.drivers.fitting.models.two_level import fit_two_level\n"
        "model = fit_two_level([np.sin(np.arange(600) / 20) * 0.1])\n"
        "model.stream(np.random.SeedSequence(0)).take(100)\n"
        "assert 'numba' not in sys.modules and 'pandas' not in sys.modules and 'scipy' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("edge", [-0.5, 0.5])
def test_a_driver_on_the_marking_can_be_fitted_and_sampled(edge: float) -> None:
    model = fit_two_level([np.full(400, edge) + 0.001 * np.sin(np.arange(400))])
    values = together(model, 1000)
    assert np.abs(values - edge).max() < 0.12  # half a bin, and four deviations of the fine part


def test_counts_must_fit_the_settings() -> None:
    values = plain(TwoLevelModel(PAPER_SETTINGS, np.eye(20, dtype=int), np.ones(11)))
    values["settings"]["n_bins"] = 10
    with pytest.raises(DriverProfileError, match="20 bins, settings of 10"):
        read_as(TwoLevelModel, values)
