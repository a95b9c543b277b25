"""The chain of the coarse movement."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.base.errors import DriverProfileError, NotEnoughDataError
from xosc_lateral.drivers.fitting.models.two_level import fit_markov_chain
from xosc_lateral.drivers.model.core.two_level.model import AliasTable, MarkovChain, bin_of, open_traps, walk


def made_chain(n: int = 20) -> np.ndarray:
    """Transition matrix of a walk that is drawn to the middle."""
    matrix = np.zeros((n, n))
    for i in range(n):
        up = 0.15 * (n - 1 - i) / (n - 1) if i < n - 1 else 0.0
        down = 0.15 * i / (n - 1) if i else 0.0
        matrix[i, min(i + 1, n - 1)] += up
        matrix[i, max(i - 1, 0)] += down
        matrix[i, i] += 1.0 - up - down
    return matrix


def sampled(matrix: np.ndarray, n: int, seed: int) -> np.ndarray:
    """States drawn the plain way, row by row from the cumulative distribution."""
    uniform = np.random.default_rng(seed).random(n)
    rows, state, states = np.cumsum(matrix, axis=1), 10, []
    for u in uniform:
        state = int(np.searchsorted(rows[state], u, side="right"))
        states.append(state)
    return np.array(states)


@pytest.mark.parametrize("seed", range(5))
def test_fit_recovers_the_chain_it_was_sampled_from(seed: int) -> None:
    matrix = made_chain()
    states = sampled(matrix, 200_000, seed)
    chain = fit_markov_chain([(states + 0.5) / 20 - 0.5])
    visits = chain.counts.sum(axis=1)
    error = np.sqrt(matrix * (1 - matrix) / np.maximum(visits, 1)[:, None])
    often = visits > 50
    assert (np.abs(chain.transition - matrix) <= 5 * error + 1e-9)[often].all()


@pytest.mark.parametrize("seed", range(3))
def test_sampled_transitions_have_the_chains_probabilities(seed: int) -> None:
    matrix = made_chain()
    states = walk(AliasTable.of(matrix), np.array([10]), np.random.default_rng(seed).random((300_000, 1)))[:, 0]
    counts = np.zeros_like(matrix)
    np.add.at(counts, (states[:-1], states[1:]), 1)
    visits = counts.sum(axis=1, keepdims=True)
    assert (counts[matrix == 0] == 0).all()
    error = np.sqrt(matrix * (1 - matrix) * np.maximum(visits, 1))
    assert (np.abs(counts - visits * matrix) <= 5 * error + 1e-9).all()


def test_alias_tables_hold_the_probabilities_exactly() -> None:
    matrix = np.random.default_rng(0).dirichlet(np.full(20, 0.1), size=20)
    matrix[3] = np.eye(20)[7]
    table = AliasTable.of(matrix)
    keep, other = table.keep.reshape(20, 20), table.other.reshape(20, 20)
    back = keep / 20
    for i in range(20):
        np.add.at(back[i], other[i], (1 - keep[i]) / 20)
    assert np.allclose(back, matrix, atol=1e-14)


def test_nothing_is_counted_across_runs() -> None:
    chain = fit_markov_chain([np.array([-0.38, -0.38]), np.array([0.42, 0.42])])
    assert chain.counts.sum() == 2
    assert chain.counts[2, 2] == chain.counts[18, 18] == 1


def test_offsets_beyond_the_markings_count_in_the_outermost_bins() -> None:
    assert bin_of(np.array([-0.9, -0.5, -0.001, 0.0, 0.4999, 0.7])).tolist() == [0, 0, 9, 10, 19, 19]


def test_every_bin_leads_back_to_the_data_and_none_outside_is_entered() -> None:
    counts = np.zeros((20, 20), dtype=int)
    counts[8, 8], counts[8, 9], counts[9, 8], counts[9, 9] = 50, 10, 9, 40
    counts[9, 10] = 1  # the end of a run: never left
    counts[8, 4], counts[4, 4] = 1, 30  # a trap: entered, never left
    chain = MarkovChain(counts)
    transition, support = chain.transition, chain.support
    assert np.allclose(transition.sum(axis=1), 1.0)
    assert np.flatnonzero(support).tolist() == [4, 8, 9, 10]
    assert not transition[np.ix_(support, ~support)].any()
    reach = np.linalg.matrix_power(transition + np.eye(20), 40)
    assert (reach[:, 8] > 0).all()  # from everywhere
    assert open_traps(counts)[4, 8] == 1
    assert (open_traps(counts)[0], open_traps(counts)[19])[0][1] == 1  # unvisited: one bin inwards
    assert open_traps(counts)[19, 18] == 1
    states = walk(AliasTable.of(transition), np.array([8]), np.random.default_rng(0).random((50_000, 1)))[:, 0]
    assert set(states) == {4, 8, 9, 10}
    assert (states == 8).mean() > 0.1


def test_stationary_share_is_where_a_long_walk_spends_its_time() -> None:
    matrix = made_chain()
    chain = fit_markov_chain([(sampled(matrix, 100_000, 4) + 0.5) / 20 - 0.5])
    assert np.allclose(chain.stationary @ chain.transition, chain.stationary, atol=1e-10)
    # The made chain is Ehrenfest's urn: binomial.
    from math import comb

    binomial = np.array([comb(19, k) for k in range(20)]) / 2**19
    assert np.abs(chain.stationary - binomial).max() < 0.03


def test_a_drive_that_never_leaves_one_bin_can_be_fitted() -> None:
    chain = fit_markov_chain([np.full(100, 0.01)])
    assert chain.stationary[10] == pytest.approx(1.0)


def test_contradictions_are_refused() -> None:
    with pytest.raises(NotEnoughDataError, match="2 runs"):
        fit_markov_chain([np.array([0.1]), np.array([])])
    with pytest.raises(DriverProfileError, match="smallest count -1"):
        MarkovChain(np.array([[1, -1], [0, 1]]))
    with pytest.raises(DriverProfileError, match="shape"):
        MarkovChain(np.ones((2, 3), dtype=int))
