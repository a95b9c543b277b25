"""The board on made drives whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest

from laboratory.board.benchmark import benchmark_realism
from laboratory.board.half import floors, make_half
from laboratory.board.ranking import agreeing, differing_pairs, kendall_tau, rank_groups, ranks, resampled_rows
from laboratory.board.result import Board
from laboratory.board.sampled_half import sample_half
from laboratory.board.units import halves, units_of
from tests.kit.runs import made_run, smooth_runs
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.evaluation.snippets import band_power, differences, features_of

QUICK = ["lane-centre", "constant", "gaussian-process"]


@pytest.fixture(scope="module")
def board() -> Board:
    return benchmark_realism(smooth_runs(40, 65.0), models=QUICK, resamples=10, classify=False)


def test_gaussian_drivers_are_best_told_by_a_gaussian_process(board: Board) -> None:
    assert [row.key for row in board.rows] == ["gaussian-process", "constant", "lane-centre"]
    assert board.rows[0].score < 4.0 < 6.0 < board.rows[1].score
    assert board.tau == pytest.approx(1.0)
    assert [(row.best_rank, row.worst_rank) for row in board.rows] == [(1, 1), (2, 2), (3, 3)]
    assert not board.absent


def test_every_number_has_a_floor_and_the_ranked_ones_are_named(board: Board) -> None:
    for row in board.rows:
        assert all(number.floor > 0.0 for number in row.numbers)
        assert sum(number.ranked for number in row.numbers) == 5
        assert row.low <= row.score <= row.high
        assert row.number("metrics, 10 s, same start").unit == "sd"


def test_the_same_seed_gives_the_same_board(board: Board) -> None:
    again = benchmark_realism(smooth_runs(40, 65.0), models=QUICK, resamples=10, classify=False)
    assert [row.score for row in again.rows] == [row.score for row in board.rows]
    assert [row.low for row in again.rows] == [row.low for row in board.rows]


class _Truth:
    """Samples from where the drives came from: other drivers of the same kind."""

    title, source, departures = "truth", "made", ""

    @property
    def settings(self) -> dict[str, float]:
        return {}

    def sample(self, segments: list[Segment], starts: np.ndarray | None, rng: np.random.Generator) -> list[np.ndarray]:
        longest = max(len(segment.time[segment.inside]) for segment in segments)
        drivers = smooth_runs(len(segments), 0.2 * (longest - 1), seed=int(rng.integers(2**31)))
        paths = [run.offset[: len(s.time[s.inside])] for run, s in zip(drivers, segments, strict=True)]
        return paths if starts is None else [path - path[0] + a for path, a in zip(paths, starts, strict=True)]


def test_the_truth_itself_is_as_far_as_the_floor() -> None:
    one, other = halves(smooth_runs(120, 95.0), 3)
    half = make_half(one, other, np.random.default_rng(0))
    sampled = sample_half(_Truth(), half, np.random.default_rng(1))  # type: ignore[arg-type]
    for condition in half.conditions:
        if not condition.same_start and condition.seconds <= 30.0:
            base = floors(half, condition)
            rows = np.arange(len(half.features[condition.seconds]))
            found = differences(half.features[condition.seconds], sampled.features[condition][0], rows, rows)
            for family in ("metrics", "lane_keeping", "spectrum"):
                assert base[family] / 4 < found[family] < 3 * base[family], (condition.name, family)


def test_halves_share_no_vehicle_and_too_few_are_named() -> None:
    one, other = halves(smooth_runs(9, 20.0), 0)
    assert not {run.drive for run in one} & {run.drive for run in other}
    with pytest.raises(NotEnoughDataError, match="3 vehicles"):
        halves(smooth_runs(3, 20.0), 0)


def test_one_long_drive_is_split_into_blocks() -> None:
    run = smooth_runs(1, 1000.0)[0]
    pieces = units_of([run])
    assert len({piece.drive for piece in pieces}) == 9
    assert sum(map(len, pieces)) == len(run)
    np.testing.assert_array_equal(np.concatenate([piece.offset for piece in pieces]), run.offset)


def test_a_resample_takes_all_windows_of_the_vehicles_drawn() -> None:
    one, other = halves(smooth_runs(30, 65.0), 1)
    half = make_half(one, other, np.random.default_rng(0))
    rows = resampled_rows(half, np.random.default_rng(2))
    units, counts = np.unique(half.windows[10.0].group[rows[10.0]], return_counts=True)
    assert (counts % 6 == 0).all()  # six windows of 10 s in 65 s
    assert counts.sum() == 6 * 15 and len(units) < 15


def test_power_of_a_sine_lies_in_its_band() -> None:
    time = 0.2 * np.arange(301)
    power = band_power(np.sin(2 * np.pi * 0.2 * time)[None], 0.2)[0]
    assert power.argmax() == 6  # 0.173 to 0.232 Hz: the seventh of the bands, which go up from 0.03 Hz


def test_no_movement_is_a_number_too() -> None:
    rng = np.random.default_rng(0)
    real = features_of(0.2 * rng.standard_normal((50, 151)), np.full((50, 151), 3.75), 0.2)
    still = features_of(np.zeros((50, 151)), np.full((50, 151), 3.75), 0.2)
    found = differences(real, still, np.arange(50), np.arange(50))
    assert all(np.isfinite(value) for value in found.values())
    assert found["spectrum"] > 40.0


def test_ranks_and_tau() -> None:
    places = ranks({"a": np.array([1.0, 3.0]), "b": np.array([2.0, 1.0])})
    assert places["a"].tolist() == [1, 2] and places["b"].tolist() == [2, 1]
    assert kendall_tau([1, 2, 3, 4], [1, 2, 4, 3]) == pytest.approx(1 - 2 * 1 / 6)


def test_unknown_models_are_named() -> None:
    with pytest.raises(ValueError, match="no model 'magic'; there are lane-centre"):
        benchmark_realism([_flat()], models=["magic"])
    with pytest.raises(ValueError, match="'constant' is on the board twice"):
        benchmark_realism([_flat()], models=["constant", "constant"])


def _flat() -> Run:
    return made_run(np.zeros(60))


def test_models_that_resamples_swap_share_a_group() -> None:
    rng = np.random.default_rng(0)
    common, own = rng.normal(0.0, 0.5, 200), rng.normal(0.0, 0.05, (4, 200))
    score = {"b": 1.1, "a": 1.08, "c": 2.0, "d": 8.0}
    # All move together over the resamples by more than they lie apart: it is the pairs that count.
    drawn = {key: value * np.exp(common + noise) for (key, value), noise in zip(score.items(), own, strict=True)}
    apart = differing_pairs(score, drawn)
    assert [pair for pair, clear in apart.items() if not clear] == [("a", "b")]
    assert rank_groups(score, apart) == {"a": 1, "b": 1, "c": 2, "d": 3}
    halves_of = {"a": [1.2, 1.0], "b": [1.1, 1.1], "c": [2.0, 2.0], "d": [1.9, 9.0]}
    assert agreeing(apart, {key: np.array(values) for key, values in halves_of.items()}) == (5, 4)


def test_a_group_begins_with_who_is_told_from_its_best_only() -> None:
    apart = {("a", "b"): False, ("b", "c"): False, ("a", "c"): True}
    assert rank_groups({"a": 1.0, "b": 1.5, "c": 2.0}, apart) == {"a": 1, "b": 1, "c": 2}
