"""Each model does what was published of it."""

from __future__ import annotations

import numpy as np
import pytest

from laboratory.board.models.batch import batch_of
from laboratory.board.models.bounded_noise import BoundedNoise
from laboratory.board.models.constant_offset import ConstantOffset
from laboratory.board.models.gaussian_process import GaussianProcess
from laboratory.board.models.intermittent import ADJUSTMENT, Intermittent
from laboratory.board.models.lane_centre import LaneCentre
from laboratory.board.models.lc_sigma import LcSigma
from laboratory.board.models.linear_preview import NODES, LinearPreview
from laboratory.board.models.ornstein_uhlenbeck import OrnsteinUhlenbeck
from laboratory.board.models.potential_field import PotentialField
from laboratory.board.models.simulated import BURN_IN, driver_means_of
from laboratory.board.models.sloppy_driver import SloppyDriver
from laboratory.board.models.social_force import PUBLISHED_SHIFT, SocialForce, shift_beside
from laboratory.board.models.strip_based import StripBased
from tests.kit.runs import STEP, made_run, smooth_runs, straight


def _free(model: object, count: int, seconds: float, seed: int = 0, **context: float) -> np.ndarray:
    return np.array(model.sample(straight(count, seconds, **context), None, np.random.default_rng(seed)))  # type: ignore[attr-defined]


def test_the_lane_centre_is_zero_and_a_constant_offset_constant() -> None:
    assert not _free(LaneCentre(), 2, 10.0).any()
    model = ConstantOffset.fit([made_run(np.full(100, value), drive=f"{value}") for value in (-0.3, 0.1, 0.4)])
    paths = _free(model, 300, 4.0)
    assert (paths == paths[:, :1]).all()
    assert set(np.unique(paths.round(12))) == {-0.3, 0.1, 0.4}


def test_ornstein_uhlenbeck_forgets_exponentially_at_its_stationary_spread() -> None:
    paths = _free(OrnsteinUhlenbeck(mean=0.1, time_constant=4.0, spread=0.25), 4000, 8.0)
    assert paths.mean() == pytest.approx(0.1, abs=0.015)
    assert paths.std() == pytest.approx(0.25, rel=0.03)
    lag = round(4.0 / STEP)
    correlation = np.corrcoef(paths[:, 0], paths[:, lag])[0, 1]
    assert correlation == pytest.approx(np.exp(-1.0), abs=0.05)  # standard error of a correlation of 4000: 0.014


def test_sloppy_driver_keeps_to_one_side_at_five_times_sloppiness_squared() -> None:
    """The target is 5 s² times 0.5 to 1.5, and the loop steers to minus the target."""
    model = SloppyDriver(sloppiness=0.3)
    drift = model.drift(batch_of(straight(200, 240.0), np.zeros(200)), np.random.default_rng(1))[:, 600:]
    assert drift.mean() == pytest.approx(-5.0 * 0.3**2, rel=0.03)
    assert (drift < 0.0).all()


def test_lc_sigma_is_as_wide_as_its_sigma_and_as_slow_as_its_formula() -> None:
    for sigma in (0.2, 0.5):
        paths = _free(LcSigma(sigma=sigma), 400, 2000.0)[:, 3000:]
        assert paths.std() == pytest.approx(sigma, rel=0.08)
        lag = round(100.0 * (1.0 - sigma) / STEP)
        product = (paths[:, lag:] * paths[:, :-lag]).mean() / paths.var()
        assert product == pytest.approx(np.exp(-1.0), abs=0.06)


def test_lc_sigma_is_what_a_real_sumo_does() -> None:
    pytest.importorskip("sumo")
    from laboratory.board.models.sumo_process import simulate_sumo

    sigma = 0.4
    tracks = simulate_sumo(sigma, 7, lanes=20, seconds=260.0)
    scale = 100.0 * (1.0 - sigma)
    kicks = tracks[:, 1:] - np.exp(-STEP / scale) * tracks[:, :-1]
    assert kicks.std() == pytest.approx(sigma * np.sqrt(2 * STEP / scale), rel=0.02)
    assert abs(np.corrcoef(kicks[:, 1:].ravel(), kicks[:, :-1].ravel())[0, 1]) < 0.03
    assert np.abs(tracks).max() < 3.75 / 2 - 0.6  # what the formula does not say: SUMO keeps the vehicle in its lane


def test_strips_as_wide_as_the_lane_are_lane_based_driving() -> None:
    """ "Retains the concept of lane-based movement when the strip width equals the lane width"."""
    model = StripBased(strip_width=3.75, interval=1.0, discipline=0.1, lateral_speed=0.3)
    assert not _free(model, 20, 60.0).any()


def test_between_two_decisions_a_vehicle_is_on_a_strip() -> None:
    model = StripBased(strip_width=0.3, interval=5.0, discipline=0.2, lateral_speed=0.3)
    paths = _free(model, 50, 60.0)
    resting = np.diff(paths, axis=1) == 0.0
    place = paths[:, 1:][resting] / 0.3
    np.testing.assert_allclose(place, place.round(), atol=1e-9)
    assert np.abs(np.diff(paths, axis=1)).max() <= 0.3 * STEP + 1e-12
    assert len(np.unique(place.round())) >= 3


def test_potentials_hold_a_vehicle_midway_between_its_edges_and_push_it_away_from_a_neighbour() -> None:
    model = PotentialField(strength=1.0, reach=0.7, friction=0.8, noise=0.05)
    assert model.force(np.zeros(1), np.full(1, 3.75), np.zeros(1))[0] == 0.0
    alone, right = _free(model, 300, 60.0), _free(model, 300, 60.0, right_distance=0.0)
    left = _free(model, 300, 60.0, left_distance=0.0)
    assert right.mean() - alone.mean() > 0.015 and alone.mean() - left.mean() > 0.015
    rest = (right.mean() - left.mean()) / 2  # where the force of a neighbour on the right has its zero
    assert abs(model.force(np.array([rest]), np.full(1, 3.75), np.full(1, -1.0))[0]) < 0.01


def test_a_vehicle_alongside_shifts_the_social_force_by_the_published_distance() -> None:
    model = SocialForce(stiffness=0.5, friction=1.0, noise=0.05)
    shift = _free(model, 600, 60.0, right_distance=0.0).mean() - _free(model, 600, 60.0).mean()
    assert shift == pytest.approx(PUBLISHED_SHIFT, abs=0.012)


def test_the_shift_beside_a_vehicle_is_found_within_drivers() -> None:
    rng, runs = np.random.default_rng(3), []
    for number in range(30):
        beside = np.repeat(rng.integers(0, 2, 10), 40).astype(float)
        offset = 0.3 * rng.standard_normal() + 0.12 * beside + 0.05 * rng.standard_normal(400)
        runs.append(made_run(offset, drive=f"d{number}", right_distance=np.where(beside > 0, 1.0, np.nan)))
    assert shift_beside(runs) == pytest.approx(0.12, abs=0.01)
    assert shift_beside(smooth_runs(3)) == PUBLISHED_SHIFT


def test_bounded_noise_stays_in_its_bound_with_the_published_autocovariance() -> None:
    """Sine-Wiener noise: B²/2 exp(-lag / memory)."""
    model = BoundedNoise(mean=0.0, relaxation=10.0, bound=0.2, memory=3.0)
    noise = model.noise(20_000, 40, STEP, np.random.default_rng(2))
    assert np.abs(noise).max() <= 0.2
    assert (noise**2).mean() == pytest.approx(0.2**2 / 2, rel=0.03)
    lag = round(3.0 / STEP)
    assert (noise[:, 0] * noise[:, lag]).mean() == pytest.approx(0.2**2 / 2 * np.exp(-1.0), rel=0.08)
    paths = _free(model, 200, 300.0)
    assert np.abs(paths).max() <= 0.2 * 10.0  # a bounded push against a spring reaches no further


def test_a_gaussian_process_samples_its_covariance_and_gives_a_start_its_due() -> None:
    model = GaussianProcess.fit(smooth_runs(200, 60.0))
    free = _free(model, 4000, 10.0)
    target = model.covariance(STEP * np.arange(51))
    np.testing.assert_allclose((free * free[:, :1]).mean(axis=0) - model.mean**2, target, atol=0.08 * target[0])
    given = np.array(model.sample(straight(4000, 10.0), np.full(4000, 0.5), np.random.default_rng(1))).mean(axis=0)
    np.testing.assert_allclose(given - model.mean, (0.5 - model.mean) * target / target[0], atol=0.02)
    # The weave that was put in: standard deviation 0.15 m, correlation exp(-h²/16).
    change = 0.5 * np.diff(free[:, ::10], axis=1).var()
    assert change == pytest.approx(0.15**2 * (1 - np.exp(-(2.0**2) / 16.0)), rel=0.15)


def test_linear_preview_recovers_the_gains_of_a_driver_who_looks_ahead() -> None:
    rng, runs = np.random.default_rng(5), []
    truth = LinearPreview(left=np.array([60.0, 30.0, 10.0]), right=np.array([20.0, 50.0, 5.0]))
    for number in range(40):
        bends = np.repeat(rng.uniform(-0.004, 0.004, 40), 10)
        offset = 0.2 * rng.standard_normal() + truth.plan(bends, np.full(400, 25.0))
        runs.append(made_run(offset, drive=f"d{number}", speed=25.0, curvature=bends))
    found = LinearPreview.fit(runs)
    np.testing.assert_allclose(found.left, truth.left, rtol=0.05)
    np.testing.assert_allclose(found.right, truth.right, rtol=0.05)
    assert found.driver_means.std() == pytest.approx(driver_means_of(runs).std())


def test_linear_preview_moves_before_the_curve_begins_and_to_its_inside() -> None:
    model = LinearPreview(left=np.array([0.0, 100.0, 0.0]))
    curve = np.where(np.arange(100) >= 50, 0.003, 0.0)  # at 30 m/s: 300 m ahead
    plan = model.plan(curve, np.full(100, 30.0))
    assert plan[-1] == pytest.approx(0.3)
    first = int(np.argmax(plan > 1e-9))
    assert 300.0 - first * 30.0 * STEP == pytest.approx(NODES[2], abs=30.0 * STEP)


def test_intermittent_control_rests_between_adjustments_and_acts_sooner_on_larger_errors() -> None:
    model = Intermittent(look_ahead=4.0, threshold=0.05, accumulator_noise=0.02, motor_noise=0.2, unrest=0.01)
    batch = batch_of(straight(200, 120.0), np.zeros(200))
    _, steering = model.drive(batch, np.random.default_rng(6))
    change = np.diff(steering, axis=1)
    quiet = (np.abs(change) < 1e-12).mean()
    assert quiet > 0.5  # steering holds still most of the time (Markkula et al. 2018, section 4)
    lengths = [len(run) for row in change for run in _bursts(row)]
    assert np.median(lengths) == round(ADJUSTMENT / STEP)
    early, late = [], []
    for row in change:
        bursts = _bursts(row)
        ends = [run[-1] for run in bursts]
        for before, burst in zip(ends, bursts[1:], strict=False):
            (early if burst[0] - before < 5.0 / STEP else late).append(abs(row[burst].sum()))
    assert np.mean(early) > np.mean(late)  # short waits go with large adjustments, long ones with small


def _bursts(change: np.ndarray) -> list[np.ndarray]:
    rows = np.flatnonzero(np.abs(change) > 1e-12)
    return np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if rows.size else []


def test_a_free_run_has_forgotten_where_it_began() -> None:
    assert BURN_IN >= 60.0
    model = OrnsteinUhlenbeck(driver_means=np.full(1, 5.0), mean=0.0, time_constant=4.0, spread=0.2)
    assert _free(model, 500, 4.0).mean() == pytest.approx(0.0, abs=0.03)
