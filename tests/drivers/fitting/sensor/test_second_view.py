"""Errors of both lane markings, which the lane width shows, too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, sosfilt

from tests.kit.runs import made_run
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.drives.drive import Drive, MarkingShares, Run
from xosc_lateral.drivers.fitting.fitting import driver_runs, half_widths_of
from xosc_lateral.drivers.fitting.sensor.periodogram import KNOTS, SecondView, second_view
from xosc_lateral.drivers.fitting.sensor.separation import Separation, separate
from xosc_lateral.drivers.model.sensor import SensorModel

FloatArray = NDArray[np.float64]
STEP = 0.2
N = 15_000


def path(seed: int) -> FloatArray:
    """A driver of 0.25 m, whose density falls by f^-2 from 0.08 Hz on, and by f^-6 from 0.3 Hz on."""
    rng = np.random.default_rng(seed)
    slow = rng.normal(size=N + 500)
    for order, corner in ((1, 0.08), (2, 0.3)):
        slow = sosfilt(butter(order, corner, fs=5.0, output="sos"), slow)
    slow = slow[500:]
    return np.asarray(0.25 * slow / slow.std())


def errors(seed: int, spread: float) -> tuple[FloatArray, FloatArray]:
    """Of offset and half the lane width: of two markings, each for some 0.8 s."""
    rng = np.random.default_rng([seed, 1])
    left, right = lfilter([1.0], [1.0, -np.exp(-STEP / 0.8)], rng.normal(size=(2, N)))
    scale = spread * np.sqrt(2.0) / np.concatenate([left, right]).std()
    return 0.5 * scale * (right - left), 0.5 * scale * (right + left)


def pieces(values: FloatArray) -> list[FloatArray]:
    return np.split(values, 5)


def split(seed: int, offset_error: FloatArray, half_width: FloatArray | None) -> Separation:
    half_widths = None if half_width is None else pieces(1.8 + half_width)
    return separate(pieces(path(seed) + offset_error), STEP, half_widths=half_widths)


def fast_share(found: Separation, truth: FloatArray, measured: FloatArray) -> float:
    """Lateral acceleration of the driver's part over the true one."""
    parts = [np.diff(found.driver_part(one, STEP), 2) for one in pieces(measured)]
    return float(np.concatenate(parts).std() / np.diff(truth, 2).std())


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_slow_errors_are_told_by_the_width(seed: int) -> None:
    """Errors of 0.8 s look like a driver: the width says how many of them there are."""
    of_offset, of_width = errors(seed, 0.2)
    measured = path(seed) + of_offset
    alone, both = split(seed, of_offset, None), split(seed, of_offset, of_width)
    assert both.sensor.second_view == pytest.approx(1.0, abs=0.1) and both.sensor.order == 0
    true = 1.0 - of_offset.var() / measured.var()
    assert both.sensor.share == pytest.approx(true, abs=0.04)
    low, high = both.sensor.driver_share
    assert low - 0.01 <= true <= high + 0.01
    assert abs(both.sensor.share - true) < 0.5 * abs(alone.sensor.share - true)
    assert 0.8 < fast_share(both, path(seed), measured) < 1.2


def test_a_width_from_elsewhere_is_not_followed() -> None:
    """Of a good sensor's offset, a camera's width must take nothing."""
    rng = np.random.default_rng(4)
    white, (_, of_width) = 0.01 * rng.normal(size=N), errors(4, 0.2)
    alone, both = split(4, white, None), split(4, white, of_width)
    assert both.sensor.share == pytest.approx(alone.sensor.share, abs=0.005)


def test_one_camera_is_believed(seen: tuple[Drive, list[Run]]) -> None:
    """What is not plausible by itself is taken where the same camera is known to have measured both."""
    drive, runs = seen
    rng = np.random.default_rng(5)
    other = replace(drive, half_width=1.8 + 0.3 * rng.normal(size=N))
    shares = [driver_runs(runs, [replace(other, mended=mended)])[1] for mended in (None, MarkingShares(0.01, 0.0))]
    assert [sensor is not None and sensor.second_view > 0.0 for sensor in shares] == [False, True]


def test_the_density_of_a_width_is_found() -> None:
    rng = np.random.default_rng(6)
    found = second_view(pieces(1.8 + 0.1 * rng.normal(size=N)), STEP)
    assert found is not None
    expected = 2.0 * STEP * 0.1**2
    np.testing.assert_allclose(found.density(np.array([0.01, 0.1, 0.5, 1.4, 2.4])), expected, rtol=0.15)
    assert found.variance(2.5) == pytest.approx(0.01, rel=0.1)
    np.testing.assert_allclose(found.scaled(2.0).density(KNOTS), 2.0 * found.density(KNOTS))
    short = second_view([1.8 + 0.1 * rng.normal(size=70) for _ in range(30)], STEP)
    assert short is not None and short.frequencies[0] > KNOTS[0]
    np.testing.assert_allclose(short.density(KNOTS), expected, rtol=0.3)


def test_a_width_that_stands_still_shows_nothing() -> None:
    assert second_view(pieces(np.full(N, 1.8)), STEP) is None
    assert split(7, errors(7, 0.1)[0], np.zeros(N)).sensor.second_view == 0.0


def test_a_flat_width_between_its_knots_is_straight() -> None:
    slopes = SecondView(tuple(KNOTS.tolist()), tuple(np.log(KNOTS).tolist()))
    np.testing.assert_allclose(slopes.density(np.array([0.3, 0.5])), [0.3, 0.5])


@pytest.fixture(scope="module")
def seen() -> tuple[Drive, list[Run]]:
    """A camera's drive at 5 Hz, cut into runs."""
    of_offset, of_width = errors(8, 0.2)
    time = STEP * np.arange(N)
    drive = Drive("d", time, path(8) + of_offset, np.full(N, 3.6), half_width=1.8 + of_width)
    runs = [
        replace(made_run(one), drive="d", time=at) for one, at in zip(pieces(drive.offset), pieces(time), strict=True)
    ]
    return drive, runs


def test_runs_take_the_width_of_their_own_rows(seen: tuple[Drive, list[Run]]) -> None:
    drive, runs = seen
    found = half_widths_of(runs, [drive])
    assert found is not None and drive.half_width is not None
    np.testing.assert_allclose(np.concatenate(found), drive.half_width)
    assert half_widths_of(runs, [replace(drive, half_width=None)]) is None
    assert half_widths_of(runs, []) is None


def test_a_profile_says_by_what_the_error_was_estimated(seen: tuple[Drive, list[Run]]) -> None:
    drive, runs = seen
    _, sensor = driver_runs(runs, [drive])
    assert sensor is not None and sensor.second_view == pytest.approx(1.0, abs=0.1)
    assert "estimated by the lane width" in sensor.in_words()
    _, alone = driver_runs(runs, [replace(drive, half_width=None)])
    assert alone is not None and "lane width" not in alone.in_words()


def test_a_drive_with_widths_of_another_shape_is_refused() -> None:
    with pytest.raises(ValueError, match="half_width"):
        Drive("d", np.arange(3.0), np.zeros(3), np.full(3, 3.5), half_width=np.zeros(2))
    with pytest.raises(DriverProfileError):
        SensorModel(white=0.0, second_view=-1.0)
