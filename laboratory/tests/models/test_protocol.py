"""What the board relies on, for every model."""

from __future__ import annotations

from unittest.mock import patch

import numpy as np
import pytest

from laboratory.board.models import calibration
from laboratory.board.models.base import LateralModel
from laboratory.board.models.calibration_targets import distance_to, targets_of
from laboratory.board.models.catalogue import MODELS
from laboratory.board.models.profiles import drives_of
from tests.kit.runs import smooth_runs
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.drives.drive import all_runs
from xosc_lateral.drivers.model.sampled_offsets import cut_snippets, segment_of

ELSEWHERE = {"sumo", "two-level-refined"}  # a program of its own, a search that takes its time: tested apart
WITHOUT_START = {"lane-centre"}
RUNS = smooth_runs()
_fitted: dict[str, LateralModel] = {}


def _model(name: str) -> LateralModel:
    if name not in _fitted:
        with patch.multiple(
            calibration, FIRST_POINTS=16, DESCENTS=1, FIRST_STEPS=20, STEPS=20
        ):  # enough to be nearer than no movement
            _fitted[name] = MODELS[name].fit(RUNS)
    return _fitted[name]


@pytest.mark.parametrize("name", [name for name in MODELS if name not in ELSEWHERE])
def test_samples_have_the_segments_lengths_and_starts_and_come_again(name: str) -> None:
    model, run = _model(name), RUNS[0]
    segments = [segment_of(run, slice(20, 71)), segment_of(run, slice(100, 111)), segment_of(run)]
    starts = np.array([0.3, -0.2, 0.1])
    one = model.sample(segments, starts, np.random.default_rng(4))
    again = model.sample(segments, starts, np.random.default_rng(4))
    other = model.sample(segments, None, np.random.default_rng(4))
    assert [len(path) for path in one] == [51, 11, len(run)] == [len(path) for path in other]
    for path, same, start in zip(one, again, starts, strict=True):
        np.testing.assert_array_equal(path, same)
        assert np.isfinite(path).all() and np.abs(path).max() < 3.0
        if name not in WITHOUT_START:
            assert path[0] == pytest.approx(start, abs=1e-9)


@pytest.mark.parametrize("name", list(MODELS))
def test_each_model_names_its_source(name: str) -> None:
    model = MODELS[name]
    assert model.title and len(model.source) > 20
    assert isinstance(model.departures, str)


def test_a_fit_is_nearer_to_its_drives_than_no_movement_at_all() -> None:
    targets = targets_of(RUNS)
    nothing = distance_to(targets, _model("lane-centre"), 3)
    for name in ("ornstein-uhlenbeck", "social-force", "bounded-noise", "gaussian-process", "intermittent"):
        assert distance_to(targets, _model(name), 3) < 0.8 * nothing, name


def test_runs_too_short_to_fit_are_named() -> None:
    with pytest.raises(NotEnoughDataError, match=r"longest run lasts 4\.2 s"):
        MODELS["ornstein-uhlenbeck"].fit(smooth_runs(3, 4.0))


def test_runs_come_back_from_the_drives_that_the_loop_is_given() -> None:
    back = all_runs(drives_of(RUNS))
    assert sum(map(len, back)) == sum(map(len, RUNS))
    want = {run.drive: run.offset for run in RUNS}
    for run in back:
        np.testing.assert_allclose(run.offset, want[run.drive], atol=1e-12)


def test_windows_of_a_run_are_those_that_the_board_cuts() -> None:
    assert len(cut_snippets(RUNS, 10.0)) == sum(len(run) // 51 for run in RUNS)


@pytest.mark.slow
def test_the_two_level_model_refined_by_the_loop_is_a_model_like_the_others() -> None:
    runs = smooth_runs(6, 100.0)
    model = MODELS["two-level-refined"].fit(runs)
    (path,) = model.sample([segment_of(runs[0])], np.array([0.2]), np.random.default_rng(0))
    assert len(path) == len(runs[0]) and path[0] == pytest.approx(0.2, abs=1e-9)
    assert 0.0 < path.std() < 1.0
