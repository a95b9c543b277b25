"""Home traffic through a recording's band: a known filter is found again, and lane changes stay what they are."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

import xosc_lateral as xl
from tests.kit.lane_tracks import lane_change, track
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.cli import main
from xosc_lateral.extras.detect.observation import RECORDED_SPECTRUM, SensorBand, band_of, keeping_spectrum, spectrum_in
from xosc_lateral.extras.detect.tracks import STEP
from xosc_lateral.files.profiles import read_profile

CORNER = 0.3  # of the known filter [Hz]


def moving(seed: int, *, smoothed: bool) -> np.ndarray:
    """Four minutes at 20 Hz whose spectrum falls with the frequency; smoothed by a Gaussian in frequency. [m]"""
    n = 4800
    frequency = np.fft.rfftfreq(n, STEP)
    amplitude = 1.0 / (1.0 + (frequency / 0.05) ** 1.5)
    whole = np.fft.irfft(amplitude * np.exp(2j * np.pi * np.random.default_rng(seed).random(len(frequency))), n)
    if smoothed:
        whole = np.fft.irfft(np.fft.rfft(whole) * np.exp(-0.5 * (frequency / CORNER) ** 2), n)
    return 0.4 * whole / np.abs(whole).max()


def tracks(first: int, *, smoothed: bool) -> list:
    return [track(moving(k, smoothed=smoothed), name=str(k), step=STEP) for k in range(first, first + 12)]


def test_a_known_filter_is_found_again_and_home_has_the_recording_s_spectrum_through_it():
    recorded, home = keeping_spectrum(tracks(50, smoothed=True), "r"), keeping_spectrum(tracks(0, smoothed=False), "h")
    band = band_of(recorded, home)
    inside = (band.frequency > 0.12) & (band.frequency < 0.6)
    expected = np.exp(-0.5 * (band.frequency / CORNER) ** 2)
    assert inside.sum() > 4
    np.testing.assert_allclose(band.gain[inside], expected[inside], rtol=0.2, atol=0.03)
    seen = [one.having(offset=band.seen(one.offset)) for one in tracks(0, smoothed=False)]
    through = keeping_spectrum(seen, "seen")
    rows = (through.frequency > 0.12) & (through.frequency < 0.6)
    np.testing.assert_allclose(through.density[rows] ** 0.5, recorded.density[rows] ** 0.5, rtol=0.25)


def test_a_sine_is_seen_at_its_frequency_s_share_and_a_lane_change_as_it_is():
    band = SensorBand(np.array([0.15, 0.3, 0.9]), np.array([1.0, 0.5, 0.1]))
    time = STEP * np.arange(2400)
    sine = np.sin(2.0 * np.pi * 0.3 * time)
    np.testing.assert_allclose(band.seen(sine)[400:-400], 0.5 * sine[400:-400], atol=0.02)
    change = lane_change(time, 50.0, 9.0)
    assert np.abs(band.seen(change) - change).max() < 0.03
    assert np.ptp(band.seen(np.full(300, 0.7))) < 1e-12


def test_home_that_does_not_move_is_seen_as_it_is():
    still = keeping_spectrum([track(np.zeros(4800), step=STEP)], "still")
    assert band_of(keeping_spectrum(tracks(0, smoothed=True), "r"), still).gain.min() == pytest.approx(1.0)


def test_a_shipped_profile_holds_the_spectrum_of_its_recording_and_nothing_else_is_taken_for_one():
    """Cameras beside a motorway, smoothed by the provider: from 0.1 to 0.9 Hz the power falls by four decades."""
    shipped = read_profile("motorway")
    found = spectrum_in(shipped)
    low, high = (found.density[np.argmin(np.abs(found.frequency - hertz))] for hertz in (0.1, 0.9))
    assert low > 0.03 and high < 1e-4 * low
    with pytest.raises(DriverProfileError, match="rural does not hold the spectrum of its recording"):
        spectrum_in(read_profile("rural"))
    for hertz, density in (([0.2, 0.1], [1, 1]), ([0.2], [-1]), ([], []), ([0.1, 0.2, 0.3], [1, 1]), (7, "x")):
        known = {"frequency_hz": hertz, "m2_per_hz": density}
        with pytest.raises(DriverProfileError, match="does not hold"):
            spectrum_in(replace(shipped, provenance=replace(shipped.provenance, fit={RECORDED_SPECTRUM: known})))


def test_through_a_smoother_recording_s_band_thresholds_become_more_sensitive(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    xl.write_template("overtake-truck", tmp_path / "home")
    import pandas as pd

    drives = [pd.DataFrame({
        "drive": str(k), "time": STEP * np.arange(4800), "offset": 0.3 * moving(k, smoothed=True), "lane_width": 3.5,
        "speed": 30.0,
    }) for k in range(6)]  # fmt: skip
    pd.concat(drives).to_csv("recording.csv", index=False)
    found = {
        band: xl.detect("recording.csv", home="home", variants=2, ego="none", tune="20/h", detectors="lateral-speed",
                        band_of=band).rows()[1]["threshold"]
        for band in (None, "recording.csv", "motorway")
    }  # fmt: skip
    assert found["recording.csv"] < 0.95 * found[None] and found["motorway"] < 0.95 * found[None]
    assert main(["detect", "recording.csv", "--band-of", "recording.csv"]) == 2
