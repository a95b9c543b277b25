"""Laws that the models' equations imply: stationary variances, symmetries, probabilities, conditional moments."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.special import gamma, kv

from laboratory.board.models import calibration
from laboratory.board.models.batch import ALONGSIDE, MEAN_SPEED, SegmentBatch, batch_of
from laboratory.board.models.bounded_noise import BoundedNoise
from laboratory.board.models.calibration import Bounds, calibrate
from laboratory.board.models.gaussian_process import SCALES, GaussianProcess, matern, pooled_variogram
from laboratory.board.models.intermittent import Intermittent
from laboratory.board.models.linear_preview import LinearPreview
from laboratory.board.models.ornstein_uhlenbeck import recursion
from laboratory.board.models.potential_field import PotentialField
from laboratory.board.models.simulated import driver_means_of
from laboratory.board.models.social_force import SocialForce
from laboratory.board.models.strip_based import StripBased
from laboratory.board.models.sumo_process import _read_tracks
from laboratory.board.models.sumo_run import NEAREST, SumoRun, _repeated
from tests.kit.runs import STEP, made_run, smooth_runs, straight
from xosc_lateral.drivers.model.sampled_offsets import segment_of

RNG_SEED = 31
FIELD = PotentialField(strength=2.0, reach=0.4, friction=0.7, noise=0.3)


def still(n: int, m: int, *, lane_width: float = 3.75, beside: float = 0.0) -> SegmentBatch:
    shape = (n, m)
    return SegmentBatch(
        np.zeros(n), np.full(shape, lane_width), np.full(shape, 30.0), np.zeros(shape), np.full(shape, beside)
    )


# ---- forces ----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("model", [FIELD, SocialForce(stiffness=0.4, friction=1.0, noise=0.1, shift=0.07)])
def test_forces_are_those_of_a_mirror_when_the_road_is_mirrored(model):
    offset, width = np.linspace(-1.8, 1.8, 13), np.full(13, 3.6)
    for beside in (-1.0, 0.0, 1.0):
        there = model.force(-offset, width, np.full(13, -beside))
        assert there == pytest.approx(-model.force(offset, width, np.full(13, beside)), abs=1e-14)


def test_an_edge_pushes_with_its_strength_and_a_reach_further_off_with_a_third_of_it():
    """Exponential potential: 1/e per reach; the edge across a wide lane adds nothing."""
    at = np.array([-10.0, -10.0 + FIELD.reach, -10.0 + 2.0 * FIELD.reach])
    assert FIELD.force(at, np.full(3, 20.0), np.zeros(3)) == pytest.approx(2.0 * np.exp([0.0, -1.0, -2.0]))


def test_the_field_is_the_slope_of_one_potential_so_that_no_energy_comes_from_nowhere():
    x, width, beside = np.linspace(-1.7, 1.7, 4001), 3.5, 1.0

    def height(u: np.ndarray) -> np.ndarray:
        away = np.exp(-(width / 2 + u) / FIELD.reach) + np.exp(-(width / 2 - u) / FIELD.reach)
        return FIELD.strength * FIELD.reach * (away + np.exp(-(width - u) / FIELD.reach))

    slope = -np.gradient(height(x), x)
    assert FIELD.force(x, np.full(4001, width), np.full(4001, beside))[1:-1] == pytest.approx(slope[1:-1], abs=1e-4)


@pytest.mark.parametrize(("stiffness", "friction", "noise"), [(0.3, 0.5, 0.05), (1.0, 2.0, 0.2)])
def test_a_spring_with_friction_has_the_variance_of_the_langevin_equation(stiffness, friction, noise):
    """Stationary variance noise² / (2 friction stiffness), whatever the damping."""
    model = SocialForce(stiffness=stiffness, friction=friction, noise=noise)
    rows = model.simulate(still(3000, 400, lane_width=50.0), np.random.default_rng(RNG_SEED))[:, 250:]
    # semi-implicit Euler with steps of 0.2 s is off by some per cent of stiffness * step / friction
    assert rows.var() == pytest.approx(noise**2 / (2.0 * friction * stiffness), rel=0.12)


@pytest.mark.parametrize("model", [FIELD, SocialForce(stiffness=0.01, friction=0.1, noise=0.5)])
def test_nobody_leaves_a_lane_that_narrows(model):
    batch = still(200, 300)
    narrowing = replace(batch, lane_width=np.linspace(3.75, 2.5, 300)[None].repeat(200, axis=0))
    rows = model.simulate(narrowing, np.random.default_rng(1))
    previous = narrowing.lane_width[:, :-1]  # a step is taken within the width at its beginning
    assert (np.abs(rows[:, 1:]) <= 0.5 * previous + 1e-12).all()


# ---- noises ----------------------------------------------------------------------------------------------------------
def test_the_recursion_is_a_first_order_filter_from_its_start_on():
    rng = np.random.default_rng(2)
    kicks, start = rng.standard_normal((5, 80)), rng.standard_normal(5)
    expected = lfilter([1.0], [1.0, -0.93], np.column_stack([start, kicks[:, 1:]]), axis=1)
    assert recursion(start, 0.93, kicks.copy()) == pytest.approx(expected, abs=1e-12)


def test_bounded_noise_through_its_spring_has_the_variance_of_filtered_exponential_noise():
    """White-noise-like colour with memory m through a relaxation r: bound²/2 r² m / (r + m)."""
    relaxation, memory, bound = 5.0, 1.5, 0.2
    model = BoundedNoise(mean=0.0, relaxation=relaxation, bound=bound, memory=memory)
    rows = model.simulate(still(3000, 250), np.random.default_rng(RNG_SEED))[:, 200:]
    expected = bound**2 / 2 * relaxation**2 * memory / (relaxation + memory)
    assert rows.var() == pytest.approx(expected, rel=0.08)


def test_without_noise_an_intermittent_driver_has_nothing_to_correct():
    calm = Intermittent(look_ahead=4.0, threshold=0.05, accumulator_noise=0.0, motor_noise=0.0, unrest=0.0)
    offset, steering = calm.drive(replace(still(3, 100), start=np.array([-0.3, 0.0, 0.6])), np.random.default_rng(0))
    assert not steering.any()
    assert (offset == np.array([[-0.3], [0.0], [0.6]])).all()


def test_who_tolerates_more_steers_less_often():
    batch, rate = still(60, 300), []
    for threshold in (0.02, 0.08, 0.32):
        model = Intermittent(look_ahead=4.0, threshold=threshold, accumulator_noise=0.01, motor_noise=0.1, unrest=0.02)
        _, steering = model.drive(batch, np.random.default_rng(4))
        rate.append((np.abs(np.diff(steering, axis=1)) > 1e-12).mean())
    assert rate[0] > rate[1] > rate[2] > 0.0


# ---- choices ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("discipline", [0.0, 0.7, 2.0])
def test_strips_are_chosen_with_the_probabilities_of_a_logit_model(discipline):
    """From the middle: 1 / (1 + 2 exp(-discipline)) stay; the other two are equally likely."""
    model = StripBased(strip_width=0.1, interval=STEP, discipline=discipline, lateral_speed=10.0)
    n = 6000
    first = model.simulate(still(n, 3), np.random.default_rng(5))[:, 1]
    stay = 1.0 / (1.0 + 2.0 * np.exp(-discipline))
    error = 5.0 * np.sqrt(0.25 / n)
    assert (first == 0.0).mean() == pytest.approx(stay, abs=error)
    assert (first > 0.0).mean() == pytest.approx((1.0 - stay) / 2, abs=error)


def test_a_vehicle_never_chooses_a_strip_that_its_body_has_no_room_on():
    model = StripBased(strip_width=0.5, interval=STEP, discipline=0.0, lateral_speed=10.0)
    rows = model.simulate(still(100, 400, lane_width=3.2), np.random.default_rng(6))
    assert np.unique(rows.round(9)).tolist() == [-0.5, 0.0, 0.5]  # 3.2 m less 1.8 m: 0.7 m to either side


# ---- the road ahead --------------------------------------------------------------------------------------------------
def test_in_an_endless_curve_the_gains_add_up_wherever_one_is():
    model = LinearPreview(left=np.array([40.0, 20.0, -5.0]), right=np.array([10.0, 7.0, 3.0]))
    speed = np.random.default_rng(7).uniform(10.0, 40.0, 60)
    assert model.plan(np.full(60, 0.002), speed) == pytest.approx(np.full(60, 0.002 * 55.0))
    assert model.plan(np.full(60, -0.002), speed) == pytest.approx(np.full(60, -0.002 * 20.0))


def test_on_a_mirrored_road_a_driver_with_swapped_sides_plans_the_mirror():
    rng = np.random.default_rng(8)
    curvature, speed = np.repeat(rng.uniform(-0.004, 0.004, 20), 10), rng.uniform(15.0, 35.0, 200)
    left, right = rng.uniform(0.0, 60.0, (2, 3))
    here = LinearPreview(left=left, right=right).plan(curvature, speed)
    assert LinearPreview(left=right, right=left).plan(-curvature, speed) == pytest.approx(-here, abs=1e-12)


# ---- the Gaussian process --------------------------------------------------------------------------------------------
@pytest.mark.parametrize("scale", [0.5, 8.0])
def test_the_matern_kernel_is_the_bessel_function_of_the_book(scale):
    """Rasmussen and Williams, eq. 4.14: 2^(1-nu) / Gamma(nu) z^nu K_nu(z), z = sqrt(2 nu) h / scale, nu = 3/2."""
    lags, nu = np.array([0.1, 1.0, 7.0, 20.0]), 1.5
    z = np.sqrt(2.0 * nu) * lags / scale
    assert matern(lags, scale) == pytest.approx(2.0 ** (1.0 - nu) / gamma(nu) * z**nu * kv(nu, z), rel=1e-9)
    assert matern(np.array([0.0, -7.0]), scale).tolist() == [1.0, matern(np.array([7.0]), scale)[0]]


def test_paths_from_a_start_have_the_conditional_covariance():
    """K - k k' / K(0): what is left to chance once the start is known."""
    variances = np.zeros(2 * len(SCALES))
    variances[2], variances[-3] = 0.03, 0.01
    model = GaussianProcess(mean=0.1, constant=0.02, variances=variances)
    segments = straight(12_000, 6.0)
    paths = np.array(model.sample(segments, np.full(12_000, -0.4), np.random.default_rng(9)))
    lags = STEP * np.arange(31)
    line = model.covariance(lags)
    whole = model.covariance(np.abs(lags[:, None] - lags).ravel()).reshape(31, 31)
    expected = whole - np.outer(line, line) / line[0]
    assert np.abs(np.cov(paths.T) - expected).max() < 5.0 * line[0] * np.sqrt(2.0 / 12_000)
    assert paths[:, 0] == pytest.approx(np.full(12_000, -0.4))


def test_the_variogram_is_half_the_mean_squared_change_and_blind_to_every_drivers_own_place():
    runs = smooth_runs(3, 12.0, seed=1)
    lags, found = pooled_variogram(runs)
    for lag in (1, 7, 30):
        changes = np.concatenate([run.offset[lag:] - run.offset[:-lag] for run in runs])
        assert found[lags.tolist().index(pytest.approx(lag * STEP))] == pytest.approx(0.5 * (changes**2).mean())
    elsewhere = [replace(run, offset=run.offset + shift) for run, shift in zip(runs, (5.0, -3.0, 0.2), strict=True)]
    assert pooled_variogram(elsewhere)[1] == pytest.approx(found, rel=1e-9)


def test_moments_give_back_the_covariance_of_the_drives():
    """Drivers 0.2 m apart and a weave of 0.15 m that is forgotten as exp(-h²/16)."""
    model = GaussianProcess.of_moments(smooth_runs(200, 60.0, seed=2))
    lags = np.array([0.0, 2.0, 4.0, 8.0, 30.0])
    truth = 0.2**2 + 0.15**2 * np.exp(-(lags**2) / 16.0)
    assert model.covariance(lags) == pytest.approx(truth, abs=0.25 * 0.2**2)  # 200 drivers: 10 % of 0.04 m2, 2.5 sigma
    assert model.moved(level=1.0, constants=1.0, rough=1.0, lean=1.0).covariance(lags) == pytest.approx(
        model.covariance(lags)
    )
    assert model.moved(level=2.0, constants=1.0, rough=1.0, lean=1.0).covariance(lags) == pytest.approx(
        2.0 * model.covariance(lags)
    )


# ---- windows as arrays -----------------------------------------------------------------------------------------------
def test_short_windows_go_on_with_their_last_row_and_gaps_have_the_stated_values():
    n = 6
    run = made_run(
        np.zeros(n),
        speed=20.0,
        curvature=np.linspace(0.0, 0.005, n),
        left_distance=np.array([np.nan, ALONGSIDE - 0.1, ALONGSIDE, 0.0, 0.0, 90.0]),
        right_distance=np.array([0.0, 0.0, np.nan, 0.0, 90.0, np.inf]),
    )
    blind = segment_of(made_run(np.zeros(4), speed=np.nan))
    batch = batch_of([segment_of(run), blind], np.array([0.1, 0.2]))
    assert batch.shape == (2, n)
    assert batch.beside[0].tolist() == [-1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    assert batch.curvature[0].tolist() == run.context["curvature"].tolist() and not batch.curvature[1].any()
    assert batch.speed.tolist() == [[20.0] * n, [MEAN_SPEED] * n]
    longer = batch.with_burn_in(3)
    assert (
        longer.curvature[0, :4].tolist() == [0.0] * 4
        and longer.curvature[0, 3:].tolist() == batch.curvature[0].tolist()
    )
    assert longer.beside[0, :4].tolist() == [-1.0] * 4


def test_a_driver_has_one_mean_over_all_of_his_runs():
    runs = [
        made_run(np.full(10, 0.2), drive="b"),
        made_run(np.full(30, 0.6), drive="b"),
        made_run(np.ones(5), drive="a"),
    ]
    assert driver_means_of(runs).tolist() == pytest.approx([1.0, 0.5])


# ---- the search for numbers ------------------------------------------------------------------------------------------
@pytest.mark.parametrize("truth", [{"a": 0.5, "b": 30.0}, {"a": 0.011, "b": 0.1}, {"a": 9.9, "b": 100.0}])
def test_numbers_are_found_wherever_in_their_box_they_lie(truth, monkeypatch):
    """A distance with one minimum, 10 % wide: in the middle and at the corners of the box."""
    bounds = {"a": Bounds(0.01, 10.0), "b": Bounds(0.1, 100.0)}

    def distance(targets: object, model: dict[str, float], seed: int) -> float:
        return 1.0 + sum(np.log(model[name] / truth[name]) ** 2 for name in truth)

    monkeypatch.setattr(calibration, "distance_to", distance)
    found = calibrate(dict, bounds, smooth_runs(6, 65.0))
    assert {name: pytest.approx(value, rel=0.1) for name, value in truth.items()} == found
    assert all(bounds[name].low <= value <= bounds[name].high for name, value in found.items())


def test_bounds_are_walked_evenly_in_what_they_say_and_not_left():
    log, plain = Bounds(0.01, 100.0), Bounds(-1.0, 3.0, log=False)
    assert [log.at(share) for share in (-0.5, 0.0, 0.25, 0.5, 1.0, 7.0)] == pytest.approx(
        [0.01, 0.01, 0.1, 1, 100, 100]
    )
    assert [plain.at(share) for share in (0.0, 0.25, 1.0)] == [-1.0, 0.0, 3.0]


# ---- tracks of a real SUMO -------------------------------------------------------------------------------------------
def sumo(tracks: np.ndarray) -> SumoRun:
    model = SumoRun(0.3)
    vars(model)["tracks"] = tracks  # as simulated: no SUMO is needed here
    return model


def test_windows_of_tracks_are_stretches_of_them_moved_by_centimetres_to_their_start():
    tracks = 0.3 * np.cumsum(np.random.default_rng(10).standard_normal((5, 400)), axis=1) * STEP
    starts = np.array([-0.2, 0.0, 0.15])
    paths = sumo(tracks).sample(straight(3, 10.0), starts, np.random.default_rng(11))
    steps = np.diff(tracks, axis=1)
    for path, start in zip(paths, starts, strict=True):
        assert path[0] == pytest.approx(start)
        found = [
            (row, at)
            for row in range(5)
            for at in range(400 - 51)
            if np.allclose(steps[row, at : at + 50], np.diff(path), atol=1e-12)
        ]
        ((row, at),) = found
        gaps = np.sort(np.abs(tracks[:, : 400 - 51] - start).ravel())
        assert abs(tracks[row, at] - start) <= gaps[NEAREST]


def test_a_track_that_is_too_short_goes_back_the_way_it_came():
    assert _repeated(np.array([0.0, 1.0, 3.0]), 8).tolist() == [0.0, 1.0, 3.0, 1.0, 0.0, 1.0, 3.0, 1.0]
    (path,) = sumo(np.array([[0.0, 0.1, 0.2]])).sample(straight(1, 2.0), None, np.random.default_rng(0))
    assert len(path) == 11 and np.abs(np.diff(path)).max() == pytest.approx(0.1)


def test_tracks_are_read_as_offsets_to_the_left_of_lanes_that_lie_fifty_metres_apart(tmp_path):
    """An edge of one lane lies to the right of its line: its middle at half a width below."""
    steps = 302  # the first minute is left out
    rows = [
        f'<timestep time="{0.2 * k:.1f}"><vehicle id="v0" x="0" y="{-1.875 + 0.001 * k}"/>'
        f'<vehicle id="v1" x="0" y="{50 - 1.875 - 0.25}"/></timestep>'
        for k in range(steps)
    ]
    path = tmp_path / "tracks.xml"
    path.write_text(f"<fcd-export>{''.join(rows)}</fcd-export>")
    tracks = _read_tracks(path)
    assert tracks == pytest.approx(np.array([[0.300, 0.301], [-0.25, -0.25]]), abs=1e-9)
