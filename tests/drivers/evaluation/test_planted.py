"""`evaluate` on drives whose driver and sensor are known; the whole grid is `laboratory.evaluate_planted`."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

import xosc_lateral as xl
from laboratory.evaluate_planted import recorded, said, wrong_drivers
from xosc_lateral.drivers.drives.drive import all_runs
from xosc_lateral.drivers.evaluation import realism
from xosc_lateral.drivers.evaluation.snippets import SnippetCondition, sample_runs, sensor_noise, snippets_of
from xosc_lateral.drivers.evaluation.spectra import RECORDED_BELOW, in_band
from xosc_lateral.drivers.fitting.fitting import driver_runs
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.files.profiles import read_profile

CAMERA = Path(__file__).parents[4] / "shared" / "cases" / "fit" / "evaluate_5hz_camera.csv.gz"


@pytest.fixture(scope="module")
def truth() -> DriverProfile:
    return replace(read_profile("motorway"), effects=(), beside={})


@pytest.mark.parametrize(("noise", "rate"), [(0.01, 50.0), (0.03, 10.0), (0.05, 5.0)])
def test_through_whatever_sensor_the_driver_himself_is_like_and_another_is_not(truth, noise, rate):
    drives = recorded(truth, 1, noise, rate)
    found, words = said(truth, drives)
    assert found == {"driver": "alike", "recording": "alike"}, words
    assert words.startswith("driver like other real drivers")
    name, wrong = next(iter(wrong_drivers(truth).items()))
    found, words = said(wrong, drives)
    assert found["driver"] == "unlike" and "mean square about the measured mean" in words, (name, words)


@pytest.mark.pages
def test_a_classifier_does_not_tell_the_driver_himself_by_what_two_rates_leave_of_a_sensor(truth):
    """Above 1.5 Hz noise that was recorded at 20 Hz is a hundredth of what it is at 5 Hz: a logarithm sees that."""
    drives = recorded(truth, 1, 0.03, 20.0)
    runs = all_runs(drives)
    _, sensor = driver_runs(runs, drives)
    cut, told = snippets_of(runs, 30.0, 0.2), []
    for each in (truth, wrong_drivers(truth)["1.8 times as restless"]):
        profile = replace(each, sensor=sensor)
        free = sample_runs(profile, runs, 0, same_start=False)
        noise = sensor_noise(profile, free, 0)
        paths = [run.offset for run in runs], [path + error for path, error in zip(free, noise, strict=True)]
        both = [in_band(cut.cut_from(side), 0.2) for side in paths]
        condition = SnippetCondition(30.0, False, below=RECORDED_BELOW)
        told.append(realism._under(condition, cut, *both, profile, 0, True).alone.auc)
    assert told[0] < 0.65 and told[1] > 0.8


@pytest.mark.pages
@pytest.mark.slow
def test_a_camera_at_5_hz_is_not_held_against_the_driver():
    if not CAMERA.is_file():
        pytest.skip(f"{CAMERA} is not there")
    found = xl.evaluate(xl.fit(CAMERA), CAMERA, classify=False)
    assert found.worst[1] < 1.5 and "unlike" not in found.headline()
    verdict = found.to_dict()["verdict"]
    assert verdict["driver"] == verdict["recording"] == "not known"  # of four drives
    assert {one["cause"] for one in verdict["ratios"]} == {"driver", "sensor"}
