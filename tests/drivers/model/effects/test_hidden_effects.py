"""Hidden effects against what their parameters promise, with tolerances from the number of draws."""

import numpy as np
import pytest

from tests.kit.profiles import whole_terms
from xosc_lateral.drivers.model.effects import Cycle, Drift, Population, Regimes, Step, VarianceTrend

STEP = 0.2


def grid(seconds: float) -> np.ndarray:
    return STEP * np.arange(round(seconds / STEP))


def test_a_drift_has_its_size_and_correlation_time() -> None:
    effect = Drift(size=0.3, correlation_s=50.0)
    time = grid(400.0)
    paths = np.stack([whole_terms(effect, time, {}, np.random.default_rng(seed)).location for seed in range(400)])
    assert paths.std(axis=0).mean() == pytest.approx(0.3, rel=0.08)
    lagged = np.mean(paths[:, 0] * paths[:, round(50.0 / STEP)]) / 0.3**2
    assert lagged == pytest.approx(np.exp(-1.0), abs=3.5 / np.sqrt(400))


def test_hidden_effects_draw_in_the_order_of_time() -> None:
    short, long = grid(60.0), grid(600.0)
    for effect in (
        Drift(size=0.2),
        Cycle(amplitude=0.1, period_s=9.0, coherence_s=50.0),
        Regimes(factor=2.0, on_s=9.0, off_s=9.0),
    ):
        one = whole_terms(effect, short, {}, np.random.default_rng(1))
        other = whole_terms(effect, long, {}, np.random.default_rng(1))
        for name in ("location", "spread", "fine"):
            if getattr(one, name) is not None:
                assert getattr(other, name)[: len(short)] == pytest.approx(getattr(one, name))


def test_a_step_keeps_the_mean_of_the_drive_and_jumps_by_its_size() -> None:
    effect = Step(size=0.4, at_s=30.0, share_before=0.3)
    location = whole_terms(effect, grid(100.0), {}, np.random.default_rng(0)).location
    assert location is not None
    assert location.mean() == pytest.approx(0.0, abs=1e-9)
    assert location[-1] - location[0] == pytest.approx(0.4)


def test_growing_spread_grows_by_its_factor_and_holds_outside() -> None:
    effect = VarianceTrend(factor=2.0, fine_factor=1.5, from_s=10.0, to_s=110.0)
    terms = whole_terms(effect, np.array([0.0, 10.0, 60.0, 110.0, 500.0]), {}, np.random.default_rng(0))
    assert terms.spread == pytest.approx([2**-0.5, 2**-0.5, 1.0, 2**0.5, 2**0.5])
    assert terms.fine is not None
    assert terms.fine[-1] / terms.fine[0] == pytest.approx(1.5)


def test_a_weave_has_its_period_and_amplitude() -> None:
    location = whole_terms(Cycle(amplitude=0.1, period_s=12.0), grid(1200.0), {}, np.random.default_rng(2)).location
    assert location is not None
    power = np.abs(np.fft.rfft(location))
    assert np.fft.rfftfreq(len(location), STEP)[np.argmax(power)] == pytest.approx(1.0 / 12.0)
    assert location.std() == pytest.approx(0.1 / np.sqrt(2.0), rel=0.02)


def test_regimes_are_on_for_their_share_of_the_time() -> None:
    effect = Regimes(factor=3.0, fine_factor=1.5, on_s=20.0, off_s=60.0)
    terms = whole_terms(effect, grid(200_000.0), {}, np.random.default_rng(3))
    assert terms.spread is not None
    on = terms.spread > 1.5
    assert on.mean() == pytest.approx(0.25, abs=0.02)
    lengths = on.sum() * STEP / np.sum(np.diff(on.astype(int)) == 1)
    assert lengths == pytest.approx(20.0, rel=0.1)


def test_a_population_differs_between_runs_only() -> None:
    effect = Population(shift=0.2, log_spread=0.3)
    runs = [whole_terms(effect, grid(10.0), {}, np.random.default_rng(seed)) for seed in range(600)]
    shifts = np.array([run.location[0] for run in runs])
    assert shifts.std() == pytest.approx(0.2, rel=0.12)
    assert np.log([run.spread[0] for run in runs]).std() == pytest.approx(0.3, rel=0.12)
    assert all(np.ptp(run.location) == 0.0 for run in runs)
