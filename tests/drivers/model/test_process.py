"""One drive, whole and in blocks of any length."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest
from msgspec.structs import replace

from tests.kit.certified import FOLDER, MODELS, SEED
from xosc_lateral.drivers.model.effects import Acts, Cycle, Drift, EffectTerms, Linear, Population, Regimes
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.records import plain
from xosc_lateral.drivers.model.sampling import DriveProcess, combine
from xosc_lateral.files.profiles import read_profile

HIDDEN = (
    Drift(size=0.15, correlation_s=60.0),
    Cycle(amplitude=0.1, period_s=9.0, coherence_s=200.0),
    Regimes(factor=1.6, fine_factor=1.2, on_s=15.0, off_s=30.0),
    Population(shift=0.12, log_spread=0.2),
)
N = 700
WIDTH = 3.5 + 0.1 * np.sin(np.arange(N) / 50.0)


@pytest.fixture(params=MODELS)
def profile(request: pytest.FixtureRequest) -> DriverProfile:
    return replace(read_profile(FOLDER / f"{request.param}-bare.json"), effects=HIDDEN)


def offsets(process: DriveProcess, blocks: list[int], rate: np.ndarray | None = None) -> np.ndarray:
    """A drive in blocks of so many rows."""
    process.begin_at(0.0)
    taken, row = [], 0
    for n in blocks:
        rows = np.arange(row, row + n)
        terms = process.hidden_terms_at(rows)
        terms = terms if rate is None else combine([terms, EffectTerms(rate=rate[rows])])
        taken.append(process.take(terms, WIDTH[rows], 0.2 if row == 0 else None))
        row += n
    return np.concatenate(taken)


@pytest.mark.parametrize("blocks", [[1] * 200, [3, 77, 1, 119], [64, 64, 72]], ids=["singles", "odd", "even"])
def test_blocks_of_any_length_give_the_whole_drive_bit_by_bit(profile: DriverProfile, blocks: list[int]) -> None:
    whole = offsets(DriveProcess(profile, np.random.SeedSequence(SEED)), [200])
    pieces = offsets(DriveProcess(profile, np.random.SeedSequence(SEED)), blocks)
    np.testing.assert_array_equal(pieces, whole)
    assert whole[0] == pytest.approx(0.2, abs=1e-12)


def test_blocks_agree_at_a_varying_rate_of_mean_reversion_too(profile: DriverProfile) -> None:
    rate = 1.0 + 0.5 * np.sin(np.arange(N) / 20.0)
    whole = offsets(DriveProcess(profile, np.random.SeedSequence(1)), [300], rate)
    np.testing.assert_array_equal(offsets(DriveProcess(profile, np.random.SeedSequence(1)), [1] * 300, rate), whole)


def test_a_copy_goes_on_by_itself_and_a_saved_state_where_it_was(profile: DriverProfile) -> None:
    process = DriveProcess(profile, np.random.SeedSequence(3))
    offsets(process, [100])
    other = deepcopy(process)
    saved = plain(process.state)
    rows = np.arange(100, 180)
    expected = process.take(process.hidden_terms_at(rows), WIDTH[rows])
    np.testing.assert_array_equal(other.take(other.hidden_terms_at(rows), WIDTH[rows]), expected)
    again = DriveProcess(profile, np.random.SeedSequence(3))
    again.restore(saved, "state")
    np.testing.assert_array_equal(again.take(again.hidden_terms_at(rows), WIDTH[rows]), expected)


def test_a_drive_can_not_go_back_nor_start_twice(profile: DriverProfile) -> None:
    process = DriveProcess(profile, np.random.SeedSequence(3))
    offsets(process, [50])
    with pytest.raises(ValueError, match="row 10 of a drive that has gone on to row 49"):
        process.hidden_terms_at(np.arange(10, 20))
    with pytest.raises(ValueError, match="has no start"):
        process.take(EffectTerms(), WIDTH[:1], 0.1)


def test_a_gap_between_segments_leaves_hidden_effects_at_their_own_time(profile: DriverProfile) -> None:
    whole = DriveProcess(profile, np.random.SeedSequence(5))
    whole.begin_at(0.0)
    terms = whole.hidden_terms_at(np.arange(300))
    parted = DriveProcess(profile, np.random.SeedSequence(5))
    parted.begin_at(0.0)
    parted.hidden_terms_at(np.arange(50))
    later = parted.hidden_terms_at(np.arange(200, 300))
    np.testing.assert_array_equal(later.location, terms.location[200:])  # type: ignore[index]
    np.testing.assert_array_equal(later.spread, terms.spread[200:])  # type: ignore[index]


def test_random_slopes_are_drawn_once_per_drive_with_the_spread_stated() -> None:
    base = read_profile(FOLDER / "two-level-bare.json")
    slope = Linear(
        acts=Acts.LOCATION, column="curvature", coefficients=(100.0,), errors=(1.0,), reference=(0.0,),
        between_drivers=(30.0,),
    )  # fmt: skip
    profile = replace(base, effects=(slope,))
    drawn = [DriveProcess(profile, np.random.SeedSequence(seed)).columned[0].coefficients[0] for seed in range(400)]
    # Standard errors of mean and standard deviation of 400 normal values: 30 / 20 and 30 / sqrt(800).
    assert np.mean(drawn) == pytest.approx(100.0, abs=4 * 1.5)
    assert np.std(drawn) == pytest.approx(30.0, abs=4 * 1.06)
    again = DriveProcess(profile, np.random.SeedSequence(7)).columned[0].coefficients
    assert again == DriveProcess(profile, np.random.SeedSequence(7)).columned[0].coefficients
    assert DriverProfile.from_dict(profile.to_dict()).effects == (slope,)
