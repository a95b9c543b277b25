"""The board's arithmetic: scores, resamples, ranks, halves, what is left out; made features whose truth is plain."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import rankdata

from laboratory.board import contestants as entries
from laboratory.board.benchmark import benchmark_realism
from laboratory.board.contestants import AS_IT_IS, contestants
from laboratory.board.half import Half, make_half, pooled
from laboratory.board.ranked import LONG, SHORT, ranked_numbers
from laboratory.board.ranking import all_rows, bootstrap, floor_of, kendall_tau, ranks, resampled_rows, score_rows
from laboratory.board.result import Board, ModelScore
from laboratory.board.sampled_half import SampledHalf, sample_half
from laboratory.board.units import halves, units_of
from tests.kit.profiles import simulated_profile
from tests.kit.runs import made_run, smooth_runs
from xosc_lateral.base.errors import NotEnoughDataError, XoscLateralError
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.evaluation.snippets import LAGS, autocorrelation_of, resolved_bands

RUNS = smooth_runs(24, 65.0)


def mirrored(runs: list[Run]) -> list[Run]:
    return [replace(run, offset=-run.offset) for run in runs]


@pytest.fixture(scope="module")
def half() -> Half:
    return make_half(*halves(RUNS, 1), np.random.default_rng(0))


class Echo:
    """Gives back what the measured drivers did, moved, or stretched about zero."""

    title, source, departures = "echo", "made", ""
    settings: dict[str, float] = {}  # noqa: RUF012

    def __init__(self, half: Half, shift: float = 0.0, stretch: float = 1.0) -> None:
        windows = [offset for own in half.windows.values() for offset in own.offset]
        self.known = {(len(offset), float(offset[0])): offset for offset in windows}
        self.paths = [run.offset for run in half.test]
        self.shift, self.stretch = shift, stretch

    def sample(self, segments, starts, rng):
        paths = self.paths
        if starts is not None:
            rows = [segment.lane_width[segment.inside].size for segment in segments]
            paths = [self.known[row, start] for row, start in zip(rows, starts.tolist(), strict=True)]
        return [self.stretch * path + self.shift for path in paths]


def echoed(half: Half, **how: float) -> SampledHalf:
    return sample_half(Echo(half, **how), half, np.random.default_rng(0))  # type: ignore[arg-type]


# ---- scores ----------------------------------------------------------------------------------------------------------
def test_a_model_that_does_what_was_measured_scores_as_near_to_nothing_as_numbers_go(half):
    """Every difference is zero; a logarithm needs a least one."""
    score = score_rows(half, echoed(half), floor_of(half), all_rows(half))
    assert score < 1e-3


def test_a_score_is_the_geometric_mean_of_values_over_floors(half):
    sampled = echoed(half, shift=0.3)
    base = floor_of(half)
    whole = score_rows(half, sampled, base, all_rows(half))
    assert score_rows(
        half, sampled, {key: 2.0 * value for key, value in base.items()}, all_rows(half)
    ) == pytest.approx(whole / 2.0)
    one = next(iter(base))
    other = score_rows(half, sampled, {**base, one: 32.0 * base[one]}, all_rows(half))
    assert other == pytest.approx(whole / 2.0)  # one of five: the fifth root of 32


def test_whoever_is_further_off_scores_worse_in_either_direction(half):
    base, rows = floor_of(half), all_rows(half)
    by_shift = [score_rows(half, echoed(half, shift=shift), base, rows) for shift in (0.05, 0.2, 0.8)]
    by_size = [score_rows(half, echoed(half, stretch=size), base, rows) for size in (1.1, 1.5, 3.0)]
    assert by_shift == sorted(by_shift) and by_size == sorted(by_size)


def test_in_a_mirror_the_floors_are_what_they_were(half):
    """Drivers who keep left are as hard to tell from one another as drivers who keep right."""
    one, other = halves(mirrored(RUNS), 1)
    there = floor_of(make_half(one, other, np.random.default_rng(0)))
    assert there == pytest.approx(floor_of(half), rel=1e-9)


def test_every_ranked_number_has_its_floor_and_long_windows_count_where_there_are_any(half):
    assert set(floor_of(half)) == set(ranked_numbers(half.windows))
    assert {condition.seconds for condition, _ in ranked_numbers(half.windows)} == {SHORT, LONG}
    assert {condition.seconds for condition, _ in ranked_numbers([SHORT])} == {SHORT}


# ---- resamples, ranks ------------------------------------------------------------------------------------------------
def test_resamples_of_vehicles_who_are_all_alike_do_not_spread():
    runs = [replace(run, drive=f"d{number}") for number, run in enumerate([RUNS[0]] * 12)]
    half = make_half(*halves(runs, 0), np.random.default_rng(0))
    parts = [(half, {"echo": echoed(half, shift=0.2)})]
    base = {condition: max(value, 0.1) for condition, value in floor_of(half).items()}
    rng = np.random.default_rng(1)
    values = [score_rows(half, parts[0][1]["echo"], base, resampled_rows(half, rng)) for _ in range(5)]
    assert values == pytest.approx([values[0]] * 5)


def test_a_bootstrap_shows_every_model_the_same_vehicles(half):
    """Two models that do the same have the same score in every resample, so that a tie stays one."""
    parts = [(half, {"a": echoed(half, shift=0.1), "b": echoed(half, shift=0.1), "c": echoed(half, shift=0.4)})]
    by_half, drawn = bootstrap(parts, np.random.default_rng(2), 8)
    assert (drawn["a"] == drawn["b"]).all() and np.ptp(drawn["a"]) > 0.0
    assert (drawn["c"] > drawn["a"]).all()
    assert by_half["a"] == pytest.approx([score_rows(half, parts[0][1]["a"], floor_of(half), all_rows(half))])


@given(st.lists(st.lists(st.floats(0.1, 10.0), min_size=3, max_size=3, unique=True), min_size=1, max_size=6))
def test_places_are_those_of_the_scores_in_each_resample(rows):
    scores = dict(zip("abc", np.array(rows).T, strict=True))
    expected = np.array([rankdata(row) for row in rows]).T
    assert np.array_equal(np.array(list(ranks(scores).values())), expected)


@given(st.permutations(range(7)))
def test_kendalls_tau_counts_pairs_in_the_same_order(order):
    same = sum((order[j] > order[i]) - (order[j] < order[i]) for i, j in combinations(range(7), 2))
    assert kendall_tau(range(7), order) == pytest.approx(same / 21)


def test_means_over_the_halves_are_of_what_both_have():
    assert pooled([{"a": 1.0, "b": 3.0}, {"a": 2.0, "c": 9.0}]) == {"a": 1.5}


# ---- units -----------------------------------------------------------------------------------------------------------
@given(st.integers(6, 15), st.integers(0, 5))
def test_halves_are_halves_of_the_vehicles_and_nobody_is_lost(vehicles, seed):
    runs = [made_run(np.zeros(5), drive=f"v{k % vehicles}") for k in range(2 * vehicles)]
    one, other = halves(runs, seed)
    assert len({run.drive for run in one}) == vehicles // 2
    assert len(one) + len(other) == len(runs)
    assert {run.drive for run in one}.isdisjoint({run.drive for run in other})


def test_runs_of_one_block_stay_together_and_blocks_begin_at_even_times():
    """A break within two minutes: both sides of it are one unit, since they know of each other."""
    first, second = made_run(np.zeros(200)), made_run(np.zeros(700))
    runs = [first, replace(second, time=second.time + 60.0, index=1)]
    pieces = units_of(runs)
    assert [(piece.drive, len(piece)) for piece in pieces] == [("d 0", 200), ("d 0", 300), ("d 1", 400)]
    assert pieces[2].time[0] == pytest.approx(120.0)


# ---- the whole board -------------------------------------------------------------------------------------------------
class Refuses:
    """A model whose fit always fails."""

    title, source, departures = "refuses", "made", ""

    @classmethod
    def fit(cls, runs):
        raise XoscLateralError("needs a program that is not here")


@pytest.fixture(scope="module")
def board() -> tuple[Board, list[tuple[float, str]]]:
    said: list[tuple[float, str]] = []
    patch = pytest.MonkeyPatch()
    patch.setattr(entries, "MODELS", {**entries.MODELS, "refuses": Refuses})
    made = benchmark_realism(
        RUNS,
        models=["refuses", "lane-centre", "constant"],
        profiles=[simulated_profile()],
        resamples=6,
        classify=False,
        progress=lambda share, what: said.append((share, what)),
    )
    patch.undo()
    return made, said


def test_who_could_not_be_fitted_is_named_with_the_reason_and_the_rest_is_ranked(board):
    made, said = board
    assert made.absent == {"refuses": "needs a program that is not here"}
    assert sorted(row.rank for row in made.rows) == [1, 2, 3]
    assert {row.key for row in made.rows} == {"lane-centre", "constant", f"profile {simulated_profile().name}"}
    assert [share for share, _ in said] == [0.0, 0.25, 0.5, 0.75]


def test_what_was_measured_is_counted_as_it_is(board):
    made, _ = board
    assert (made.vehicles, made.runs, made.unit) == (24, 24, "vehicle")
    assert made.hours == pytest.approx(24 * len(RUNS[0]) * 0.2 / 3600.0)
    assert made.windows["10 s, same start"] == 24 * (len(RUNS[0]) // 51)
    everything = [run.offset[: 151 * (len(run) // 151)].reshape(-1, 151) for run in RUNS if len(run) >= 151]
    assert len(made.lags) == len(made.real_autocorrelation) == sum(lag <= 15.0 for lag in LAGS)
    low, high = np.array(resolved_bands(30.2)).T
    assert made.frequency == pytest.approx(np.sqrt(low * high))
    assert len(everything) == 24


def test_a_profile_is_scored_as_it_is_and_says_so(board):
    made, _ = board
    (row,) = [row for row in made.rows if row.key.startswith("profile ")]
    assert row.departures == AS_IT_IS
    assert row.title == f"profile {simulated_profile().name}"


def test_scores_are_the_geometric_means_of_their_halves_and_lie_in_their_intervals(board):
    made, _ = board
    for row in made.rows:
        assert row.score == pytest.approx(np.sqrt(np.prod(row.scores_by_half)))
        assert row.low <= row.score <= row.high
        assert row.best_rank <= row.rank <= row.worst_rank
    assert [row.score for row in made.rows] == sorted(row.score for row in made.rows)


def test_no_movement_has_no_variance_and_remembers_everything(board):
    made, _ = board
    (centre,) = [row for row in made.rows if row.key == "lane-centre"]
    assert not centre.example.any() and not centre.spectrum.any()
    assert (centre.autocorrelation == 1.0).all()
    assert len(centre.example) == len(made.real_example)


def test_the_order_of_names_on_the_command_line_does_not_matter_for_who_is_known():
    found = contestants(["constant", "lane-centre"], [simulated_profile()])
    assert [one.key for one in found] == ["constant", "lane-centre", f"profile {simulated_profile().name}"]
    with pytest.raises(ValueError, match="twice"):
        contestants([], [simulated_profile(), simulated_profile()])


def test_windows_that_are_too_few_are_named():
    with pytest.raises(NotEnoughDataError, match="fewer than 20 windows of 10 s"):
        benchmark_realism(smooth_runs(12, 22.0), models=["lane-centre"], classify=False)


def test_a_number_without_a_floor_has_no_ratio():
    assert ModelScore("auc", "-", 0.7, 0.5).ratio == pytest.approx(1.4)
    assert np.isnan(ModelScore("x", "-", 0.7, 0.0).ratio)


def test_memory_of_white_noise_and_of_a_constant_are_the_two_ends(half):
    features = half.features[LONG]
    noise = replace(
        features, products=np.zeros_like(features.products), moments=np.tile([0.0, 0.04], (len(features), 1))
    )
    rows = np.arange(len(features))
    assert not autocorrelation_of(noise, rows).any()
    same = replace(noise, products=np.full_like(features.products, 0.04))
    assert autocorrelation_of(same, rows) == pytest.approx(np.ones(features.products.shape[1]))
