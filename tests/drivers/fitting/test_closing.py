"""The closing look at a fit: silent on a profile's own drives, and names what doesn't come back."""

from __future__ import annotations

from dataclasses import replace as with_fields
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

import xosc_lateral as xl
from laboratory.closing_null import recorded
from xosc_lateral.drivers.drives.drive import Run, all_runs
from xosc_lateral.drivers.evaluation.look_words import found_in, in_words, margins_in_words
from xosc_lateral.drivers.fitting.closing import look
from xosc_lateral.drivers.fitting.fitting import fit_warnings
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.files.profiles import read_profile
from xosc_lateral.workflows.profiles.profiles import derive_profile

CASES = Path(__file__).parents[4] / "shared" / "cases" / "fit"


@pytest.fixture(scope="module")
def rural() -> DriverProfile:
    return replace(read_profile("rural"), effects=(), beside={})


@pytest.fixture(scope="module")
def runs(rural: DriverProfile) -> list[Run]:
    return all_runs(recorded(rural, 3, 30, 200.0, 0.0))


def moved(runs: list[Run], change) -> list[Run]:
    return [with_fields(run, offset=change(run.offset)) for run in runs]


def test_a_profile_is_not_doubted_on_its_own_drives(rural, runs):
    found = look(rural, runs)
    assert found.lacking == []
    offsets = np.concatenate([run.offset for run in runs])
    numbers = dict(zip(found.names, found.measured.tolist(), strict=True))
    assert numbers["mean offset [m]"] == pytest.approx(offsets.mean(), abs=1e-9)
    assert numbers["time beyond 0.6 m"] == pytest.approx((np.abs(offsets) > 0.6).mean(), abs=1e-9)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("spread within a drive [m]", lambda x: 1.5 * x),
        ("mean offset [m]", lambda x: x + 0.3),
        ("skewness of the offset", lambda x: x.mean() + np.exp(3.0 * (x - x.mean())) / 3.0),
        ("kurtosis of lateral speed", lambda x: 0.02 * np.round(x / 0.02)),
        ("movement at 0.4 to 0.6 Hz [m]", lambda x: x + 0.03 * np.sin(2.0 * np.pi * 0.5 * 0.2 * np.arange(len(x)))),
    ],
)
def test_what_differs_is_named(rural, runs, name, change):
    if name.startswith("kurtosis"):  # a jump every minute
        rows = np.arange(len(runs[0]))
        change = lambda x: x + 0.3 * (rows // 300 % 2)  # noqa: E731
    assert name in look(rural, moved(runs, change)).lacking


def fitted(name: str) -> DriverProfile:
    path = CASES / f"{name}.csv.gz"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    return xl.fit(path)


@pytest.mark.slow
def test_a_dead_zone_comes_back_as_no_burst_driver():
    profile = fitted("dead_zone")
    numbers, lacking = found_in(profile)
    assert lacking == [] and numbers["kurtosis of lateral speed"][1] <= 3.3
    was, now = numbers["spread within a drive [m]"]
    assert 0.95 < now / was < 1.08
    assert profile.model.coarse_volatility.within <= 0.05  # type: ignore[union-attr]


def test_a_skewness_that_the_model_has_not_is_said_on_the_card_and_by_fit():
    profile = fitted("skewed")
    assert "skewness of the offset" in found_in(profile)[1]
    (line,) = [line for line in fit_warnings(profile) if "does not drive as its drives do" in line]
    assert line == in_words(profile) and "skewness of the offset 1.19 becomes -0.0" in line


def test_drives_without_a_sensor_get_no_coloured_one():
    assert fitted("noise_free_flip_2").sensor.order == 0  # type: ignore[union-attr]


def test_what_anybody_wrote_there_says_nothing(rural):
    for look_of in (None, 3, {"numbers": {"a": [1, 2]}}, {"numbers": {"a": 1}, "not_as_measured": ["a"]}):
        odd = replace(rural, provenance=replace(rural.provenance, fit={"look": look_of}))
        assert in_words(odd) == "" == margins_in_words(odd)


@pytest.mark.pages
def test_who_is_derived_from_a_doubted_profile_says_so(rural):
    found = {"numbers": {"skewness of the offset": [1.2, 0.0]}, "not_as_measured": ["skewness of the offset"]}
    doubted = replace(rural, provenance=replace(rural.provenance, fit={"look": found}))
    made = derive_profile(doubted, name="other")
    said = "rural does not drive as its drives do: skewness of the offset 1.2 becomes 0"
    assert str(made).endswith(said) and in_words(made.profile) == said == in_words(doubted)
    assert margins_in_words(made.profile) == ""


@pytest.mark.parametrize("noise", [0.0, -0.1, 3.0])
def test_a_sensor_noise_that_none_has_is_refused_in_words(noise):
    with pytest.raises(ValueError, match=f"sensor_noise of {noise:g} m: expected 0.0001 to 2 m, or nothing"):
        xl.fit([], sensor_noise=noise)
