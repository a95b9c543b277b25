"""Driver and sensor, separated where the truth is known."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from examples.driver_simulator.simulator import simulate_drive
from tests.kit.runs import made_run
from xosc_lateral.base.errors import DriverProfileError, NotEnoughDataError
from xosc_lateral.drivers.drives.drive import resample
from xosc_lateral.drivers.fitting.fitting import fit_runs, fit_warnings
from xosc_lateral.drivers.fitting.sensor.periodogram import quantisation_step, rounding_density
from xosc_lateral.drivers.fitting.sensor.separation import separate
from xosc_lateral.drivers.model.records import plain, read_as
from xosc_lateral.drivers.model.sensor import SensorModel

STEP = 0.2


@pytest.fixture(scope="module")
def truth() -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Times and true offsets of stretches of one simulated driver at 20 Hz, lane changes left out."""
    drive = simulate_drive(1500.0, seed=411, sensor_rate=20.0).truth
    ends = np.flatnonzero(drive.lane_change | (np.abs(np.diff(drive.offset, prepend=drive.offset[0])) > 1.0))
    pieces = np.split(np.arange(len(drive.time)), ends)
    kept = [rows[100:-100] for rows in pieces if len(rows) > 1000]
    return [drive.time[rows] for rows in kept], [drive.offset[rows] for rows in kept]


def split(truth, noise, **known):
    times, offsets = truth
    rows = [offset + error for offset, error in zip(offsets, noise, strict=True)]
    runs = [resample(t, y, np.arange(t[0], t[-1], STEP)) for t, y in zip(times, rows, strict=True)]
    return separate(runs, STEP, rows=rows, **known), runs


def noises(truth, snr: float, kind: str) -> list[np.ndarray]:
    rng = np.random.default_rng(7)
    spread = np.concatenate(truth[1]).std() / np.sqrt(snr)
    made = []
    for offset in truth[1]:
        white = rng.normal(size=len(offset))
        if kind == "bursts":
            white *= np.repeat(rng.choice([0.2, 2.0], len(offset) // 40 + 1, p=[0.8, 0.2]), 40)[: len(offset)]
        if kind == "low-passed":
            kernel = np.exp(-np.arange(200) * 0.05 / 0.16)  # first order, 1 Hz
            white = np.convolve(rng.normal(size=len(offset) + 400), kernel, "same")[200:-200]
        made.append(white)
    scale = spread / np.concatenate(made).std()
    return [scale * error for error in made]


@pytest.mark.parametrize("snr", [0.3, 1.0, 3.0])
@pytest.mark.parametrize("kind", ["white", "bursts", "low-passed"])
def test_the_variance_is_split_within_a_tenth(truth, kind, snr):
    found, _ = split(truth, noises(truth, snr, kind))
    variance = np.concatenate(truth[1]).var()
    assert found.sensor.driver_variance == pytest.approx(variance, rel=0.12 if kind == "low-passed" else 0.1)
    share = found.sensor.driver_variance / (found.sensor.driver_variance + found.sensor.sensor_variance)
    low, high = found.sensor.driver_share
    assert low <= share <= high
    assert share == pytest.approx(snr / (1.0 + snr), abs=0.05)


def test_the_written_path_is_as_calm_as_the_driver_and_not_as_the_camera(truth):
    """Below 1 Hz, where the driver can be seen at all: the true path's acceleration, not 10 times as much."""
    found, runs = split(truth, noises(truth, 1.0, "white"))
    true = [resample(t, x, np.arange(t[0], t[-1], STEP)) for t, x in zip(*truth, strict=True)]
    size = [
        np.concatenate([np.diff(x, 2) for x in paths]).std() / STEP**2
        for paths in (true, [found.driver_part(run, STEP) for run in runs], runs)
    ]
    assert size[2] > 10 * size[0]
    assert 0.5 * size[0] < size[1] < 1.15 * size[0], "what the driver does above 1 Hz is hidden for good"


def test_the_sensors_density_is_that_of_the_noise_that_was_added(truth):
    """White noise at 20 Hz: 2 sigma² / (20 Hz), at every frequency; what sampling with the sensor gives back."""
    noise = noises(truth, 1.0, "white")
    found, _ = split(truth, noise)
    planted = 2.0 * np.concatenate(noise).var() / 20.0
    assert found.sensor.density(np.array([1.0]))[0] == pytest.approx(planted, rel=0.1)
    sampled = found.sensor.sample(200_000, STEP, np.random.default_rng(5))
    pieces = sampled.reshape(-1, 500) * np.hanning(500)
    power = 2.0 * STEP * (np.abs(np.fft.rfft(pieces, axis=1)) ** 2).mean(axis=0) / (np.hanning(500) ** 2).sum()
    at = np.fft.rfftfreq(500, STEP)
    assert power[(at > 0.8) & (at < 1.5)].mean() == pytest.approx(planted, rel=0.15)


def test_a_clean_sensor_leaves_the_path_alone(truth):
    rng = np.random.default_rng(3)
    found, runs = split(truth, [0.002 * rng.normal(size=len(x)) for x in truth[1]])
    share = found.sensor.sensor_variance / (found.sensor.driver_variance + found.sensor.sensor_variance)
    assert share < 0.01
    assert found.driver_part(runs[0], STEP) == pytest.approx(runs[0], abs=0.02)
    assert found.driver_part(runs[0], STEP).mean() == pytest.approx(runs[0].mean(), abs=1e-3)


def test_steps_of_a_lattice_are_found_and_their_noise_is_known(truth):
    grain = 0.2
    noise = [np.round(x / grain) * grain - x for x in truth[1]]
    found, _ = split(truth, noise)
    assert found.sensor.rounding == pytest.approx(grain)
    assert found.sensor.driver_variance == pytest.approx(np.concatenate(truth[1]).var(), rel=0.1)
    coarse, _ = split(truth, [np.round(x / 2.0) * 2.0 - x for x in truth[1]])
    assert coarse.sensor.driver_share == (0.0, 1.0)
    profile = fit_runs([made_run(x[::4]) for x in truth[1][:2]], name="coarse", model="two-level")
    assert any("rounded to 2 m, too coarse" in line for line in fit_warnings(replace(profile, sensor=coarse.sensor)))
    assert not any("too coarse" in line for line in fit_warnings(replace(profile, sensor=found.sensor)))
    assert not any("rounded to" in line for line in fit_warnings(replace(profile, sensor=found.sensor)))
    unsure = replace(found.sensor, rounding=0.02, driver_share=(0.0, 1.0))  # fine steps, little data
    assert not any("rounded to" in line for line in fit_warnings(replace(profile, sensor=unsure)))


def test_an_error_less_than_rounding_alone_is_told(truth):
    noise = [np.round(x / 0.1) * 0.1 - x for x in truth[1]]
    found = split(truth, noise, rate=20.0, sensor_noise=0.005)[0]
    profile = replace(fit_runs([made_run(path) for path in truth[1]], name="rounded"), sensor=found.sensor)
    assert any("0.005 m is less than that of rounding to 0.1 m alone" in line for line in fit_warnings(profile, 0.005))
    assert not any("error" in line for line in (*fit_warnings(profile, 0.03), *fit_warnings(profile)))


def test_an_error_that_the_drives_contradict_is_told(truth):
    found = split(truth, noises(truth, 3.0, "white"), rate=20.0)[0]
    level = float(np.sqrt(found.sensor.sensor_variance))
    profile = replace(fit_runs([made_run(path) for path in truth[1]], name="noisy"), sensor=found.sensor)
    for wrong in (0.5 * level, 2.0 * level):
        assert any(f"contradict a sensor error of {wrong:g} m" in line for line in fit_warnings(profile, wrong))
    assert not any("error" in line for line in fit_warnings(profile, 1.05 * level))
    assert any("is not used" in line for line in fit_warnings(replace(profile, sensor=None), level))


def test_an_error_of_more_than_all_that_was_measured_is_refused(truth):
    with pytest.raises(DriverProfileError, match="1 m is more than all that was measured"):
        split(truth, noises(truth, 3.0, "white"), rate=20.0, sensor_noise=1.0)


def test_where_nothing_moves_a_known_error_is_no_contradiction(truth):
    """All was rounded to one level, whose step nobody can see."""
    found = split(truth, [-x for x in truth[1]], rate=20.0, sensor_noise=1.0)[0]
    assert found.sensor.driver_share == (0.0, 1.0)


def test_noise_that_dithers_a_lattice_is_seen_as_noise(truth):
    noise = noises(truth, 3.0, "white")
    grain = 0.9 * float(np.concatenate(truth[1]).std())
    rounded = [np.round((x + e) / grain) * grain - x for x, e in zip(truth[1], noise, strict=True)]
    found, _ = split(truth, rounded)
    assert found.sensor.rounding == pytest.approx(grain)
    assert found.sensor.driver_variance == pytest.approx(np.concatenate(truth[1]).var(), rel=0.1)


def test_low_passed_noise_is_found_beside_rounding(truth):
    """Phones write centimetres: their error is as slow as without."""
    noise = noises(truth, 3.0, "low-passed")
    rounded = [np.round((x + e) / 0.01) * 0.01 - x for x, e in zip(truth[1], noise, strict=True)]
    plain_split, fine_split = split(truth, noise)[0], split(truth, rounded)[0]
    assert fine_split.sensor.rounding == pytest.approx(0.01)
    assert fine_split.sensor.order == plain_split.sensor.order > 0
    assert fine_split.sensor.driver_variance == pytest.approx(plain_split.sensor.driver_variance, rel=0.02)


def test_a_known_noise_level_is_kept_to(truth):
    noise = noises(truth, 1.0, "white")
    level = float(np.concatenate(noise).std())
    found, _ = split(truth, noise, sensor_noise=level, rate=20.0)
    assert found.sensor.white * 10.0 == pytest.approx(level**2, rel=0.05)


@pytest.mark.parametrize("steps", [0.3, 0.5, 1.0, 2.0])
def test_an_error_that_is_known_and_is_rounding_s_is_not_looked_for_twice(truth, steps):
    """Steps of so many standard deviations."""
    grain = steps * float(np.concatenate(truth[1]).std())
    error = [np.round(x / grain) * grain - x for x in truth[1]]
    found = split(truth, error, rate=20.0, sensor_noise=grain / np.sqrt(12.0))[0]
    alone = split(truth, error, rate=20.0)[0]
    assert found.sensor.rounding == pytest.approx(grain)
    assert found.sensor.driver_variance == pytest.approx(alone.sensor.driver_variance, rel=0.02)


@pytest.mark.parametrize("grains", [0.1, 0.35, 0.5])
def test_white_noise_is_found_beside_rounding(truth, grains):
    """It makes rounding as white as it is itself."""
    noise = noises(truth, 12.0, "white")
    level, grain = float(np.concatenate(noise).std()), grains * float(np.concatenate(truth[1]).std())
    rounded = [np.round((x + e) / grain) * grain - x for x, e in zip(truth[1], noise, strict=True)]
    found, _ = split(truth, rounded, rate=20.0)
    assert found.sensor.white * 10.0 == pytest.approx(level**2, rel=0.12)
    exact, _ = split(truth, noise, rate=20.0)
    assert found.sensor.driver_variance == pytest.approx(exact.sensor.driver_variance, rel=0.02)


@pytest.mark.parametrize("step", [0.1, 0.05])
@pytest.mark.parametrize("noise", [0.0, 0.04, 0.1])
def test_rounding_noise_of_a_gaussian_signal_has_the_density_of_the_closed_form(noise, step):
    """Simulated: a slow signal of 0.25 m, white noise of up to 0.4 grains, rows at 10 and 20 Hz."""
    rng = np.random.default_rng(5)
    n = 2**17
    spectrum = np.fft.rfft(rng.normal(size=n)) / (1.0 + (np.fft.rfftfreq(n, step) / 0.1) ** 3)
    signal = np.fft.irfft(spectrum, n)
    signal *= 0.25 / signal.std()
    signal += noise * rng.normal(size=n)
    grain = 0.25
    error = np.round(signal / grain) * grain - signal
    pieces = (error.reshape(-1, 1024) - error.mean()) * np.hanning(1024)
    frequency = np.fft.rfftfreq(1024, step)
    density = 2.0 * step * (np.abs(np.fft.rfft(pieces, axis=1)) ** 2).mean(axis=0) / (np.hanning(1024) ** 2).sum()
    power = lambda f: 1.0 / (1.0 + (f / 0.1) ** 3) ** 2  # noqa: E731
    expected = rounding_density(grain, power, 0.0625, rate=1.0 / step, noise=noise**2)
    for low, high in ((0.05, 0.1), (0.1, 0.3), (0.3, 1.0), (1.0, 2.5)):
        band = (frequency > low) & (frequency < high)
        assert expected(frequency[band]).mean() == pytest.approx(density[band].mean(), rel=0.12)


@pytest.mark.parametrize(
    ("values", "step"), [(np.round(np.sin(np.arange(500.0)) / 0.05) * 0.05, 0.05), (np.sin(np.arange(500.0)), 0.0)]
)
def test_the_step_of_measured_values(values, step):
    assert quantisation_step(values) == pytest.approx(step)


def test_sampled_sensor_noise_has_the_model_s_density():
    sensor = SensorModel(0.002, 0.02, 0.5, 2)
    noise = sensor.sample(200_000, STEP, np.random.default_rng(1))
    pieces = noise.reshape(-1, 400) * np.hanning(400)
    density = 2 * STEP * (np.abs(np.fft.rfft(pieces, axis=1)) ** 2).mean(axis=0) / (np.hanning(400) ** 2).sum()
    frequency = np.fft.rfftfreq(400, STEP)
    band = (frequency > 0.05) & (frequency < 1.4)
    assert density[band] == pytest.approx(sensor.density(frequency[band]), rel=0.25)
    assert density[frequency > 1.6].max() < 1e-5


def test_offsets_that_never_move_are_all_the_driver_s():
    found = separate([np.full(600, 0.2)] * 3, STEP)
    assert found.sensor.share == 1.0
    assert found.driver_part(np.full(600, 0.2), STEP) == pytest.approx(np.full(600, 0.2))


def test_what_is_no_sensor_is_refused():
    sensor = SensorModel(0.01, 0.1, 0.5, 1, 0.05, 0.06, 0.02, (0.7, 0.8))
    assert read_as(SensorModel, plain(sensor)) == sensor
    with pytest.raises(DriverProfileError):
        SensorModel(-1.0)
    with pytest.raises(NotEnoughDataError, match=r"no run of 12\.8 s"):
        separate([np.zeros(20)], STEP)


def test_a_profile_keeps_driver_and_sensor_apart_and_samples_either(tmp_path, capsys):
    import pandas as pd

    from xosc_lateral.cli import main

    table = simulate_drive(900.0, seed=412, sensor_rate=20.0).table
    error = 0.15 * np.random.default_rng(2).normal(size=len(table))
    table.assign(distance_left=table.distance_left - error, distance_right=table.distance_right + error).to_csv(
        tmp_path / "phone.csv", index=False
    )
    profile = tmp_path / "phone.json"
    assert main(["fit", str(tmp_path / "phone.csv"), "-o", str(profile)]) == 0
    assert "of the measured variance" in capsys.readouterr().err
    rough = {}
    for words in ([], ["--with", "sensor"]):
        out = tmp_path / "out.csv"
        assert main(["sample", "-p", str(profile), "--duration", "600", *words, "-o", str(out), "--force"]) == 0
        rough[len(words)] = np.diff(pd.read_csv(out).offset, 2).std() / STEP**2
    assert rough[2] > 4 * rough[0]
    assert rough[0] < 0.3, "m/s2 rms; this driver's own"


def test_movement_like_no_traffic_is_the_sensors_only_where_it_could_not_be_told_apart(truth):
    _, runs = split(truth, noises(truth, 600.0, "white"))
    profile = replace(fit_runs([made_run(run) for run in runs], name="jittery", model="two-level"), sensor=None)
    told, untold = SensorModel(1e-5, driver_share=(0.98, 1.0)), SensorModel(1e-5)
    for sensor, is_told in ((None, True), (untold, True), (told, False)):
        lines = fit_warnings(replace(profile, sensor=sensor))
        assert any("check the sensor" in line for line in lines) is is_told
