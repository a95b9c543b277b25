"""The fair measure: the truth is at its floor, what is known to be wrong shows where it should."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from tests.kit.runs import smooth_runs
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.evaluation.realism import Realism, WithFloor, score_realism
from xosc_lateral.drivers.evaluation.snippets import SnippetCondition, sample_runs, sensor_noise
from xosc_lateral.drivers.fitting.fitting import fit_runs
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sensor import SensorModel
from xosc_lateral.workflows.profiles.realism_text import realism_lines, start_fade_note

SHORT = SnippetCondition(10.0, False)
SLOW = SnippetCondition(10.0, False, slow=True)


@pytest.fixture(scope="module")
def profile() -> DriverProfile:
    return fit_runs(smooth_runs(20, 60.0, seed=3), name="smooth", model="two-level")


@pytest.fixture(scope="module")
def own(profile: DriverProfile) -> list[Run]:
    """Runs that the profile itself made."""
    like = smooth_runs(14, 45.0, seed=4)
    paths = sample_runs(profile, like, 5, same_start=False)
    return [
        Run(run.drive, 0, run.time, path, run.lane_width, run.context) for run, path in zip(like, paths, strict=True)
    ]


@pytest.fixture(scope="module")
def realism(profile: DriverProfile, own: list[Run]) -> Realism:
    return score_realism(profile, own, seed=1, classify=False)


def test_free_runs_of_one_drive_are_of_one_driver(profile: DriverProfile) -> None:
    """Given in any order, they are pieces of one drive; with the starts of real ones each is of a new driver."""
    (run,) = smooth_runs(1, 120.0, seed=6)
    whole = [Run(drive, 0, run.time, run.offset, run.lane_width) for drive in ("first", "second")]
    parts = [slice(300, 601), slice(0, 200)]
    pieces = [
        Run(one.drive, k, one.time[rows], one.offset[rows], one.lane_width[rows])
        for one in whole
        for k, rows in enumerate(parts)
    ]
    uncut = sample_runs(profile, whole, 5, same_start=False)
    for k, path in enumerate(sample_runs(profile, pieces, 5, same_start=False)):
        np.testing.assert_array_equal(path, uncut[k // 2][parts[k % 2]])
    started = sample_runs(profile, pieces, 5)
    assert [path[0] for path in started] == pytest.approx([piece.offset[0] for piece in pieces])


def test_the_truth_is_as_near_as_other_drivers(realism: Realism):
    assert [one.condition.seconds for one in realism.conditions][:3] == [10.0, 10.0, 10.0]
    for one in realism.conditions:
        assert not one.with_sensor and one.alone is None
        for family in ("metrics", "lane_keeping", "spectrum"):
            assert 0.25 < one.families[family].ratio < 2.0, (one.condition.name, family)


def test_every_indicator_stands_beside_its_floor(realism: Realism):
    for one in realism.conditions:
        assert set(one.means) < set(one.named) and len(one.named) == 17
        assert all(value.floor >= 0.0 for value in one.named.values())
    text = "\n".join(realism_lines(realism))
    for words in (
        "within a snippet",
        "time to line crossing",
        "wandering zone",
        "jerk",
        "variance between drivers",
        "same start",
    ):
        assert words in text


def test_a_sensor_that_the_recording_has_not_shows_and_less_below_half_a_hertz(profile: DriverProfile, own: list[Run]):
    noisy = replace(profile, sensor=SensorModel(white=4e-3))  # 0.08 m rms
    scores = score_realism(noisy, own, seed=1, classify=False)
    assert scores.of(SHORT).with_sensor and scores.of(SLOW).with_sensor
    far = [scores.of(one).families["spectrum"].ratio for one in (SHORT, SLOW)]
    assert far[0] > 3.0 and far[0] > 1.5 * far[1]
    path = np.zeros(400)
    error = sensor_noise(noisy, [path], 0)[0]
    assert error.std() == pytest.approx(np.sqrt(4e-3 * 1.5), rel=0.15)
    assert not sensor_noise(profile, [path], 0)[0].any()


def test_a_foreign_place_shows_in_free_runs_and_less_from_the_same_start(profile: DriverProfile, own: list[Run]):
    moved = [Run(one.drive, 0, one.time, one.offset + 0.5, one.lane_width, one.context) for one in own]
    scores = score_realism(profile, moved, seed=1, classify=False)
    free = scores.of(SHORT).families["metrics"]
    same = scores.of(SnippetCondition(10.0, True)).families["metrics"]
    assert free.ratio > 2.5
    assert same.value < free.value


def test_a_floor_of_zero_has_no_ratio():
    assert np.isnan(WithFloor(0.1, 0.0).ratio) and WithFloor(0.1, 0.2).ratio == pytest.approx(0.5)


def test_the_fade_of_the_papers_model_is_said(profile: DriverProfile):
    assert "raises diff. std" in start_fade_note(profile)
