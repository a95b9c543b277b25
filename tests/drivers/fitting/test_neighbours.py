"""Whether a driver answers to neighbours: measured, also of size zero, or unknown."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.kit.motion import LANE_WIDTH, drive, entity, together, two_roads
from tests.kit.profiles import simulated_profile
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.fitting.context_effects import FADING_DISTANCE, measure_beside, response_to
from xosc_lateral.drivers.fitting.fitting import fit_population
from xosc_lateral.drivers.model.effects import Acts, Proximity
from xosc_lateral.drivers.model.profile import Basis, Beside
from xosc_lateral.workflows.conversion.enrich import SegmentedRun, enrich
from xosc_lateral.workflows.conversion.result import Neighbours

BESIDE = response_to("right_distance")


def runs_beside(shift: float, *, drives: int = 3, minutes: float = 10.0, seed: int = 0) -> list[Run]:
    """Drives that have somebody on the right half of the time, 20 s at once, and move by `shift` beside him."""
    rng, n = np.random.default_rng(seed), round(minutes * 300)
    made = []
    for k in range(drives):
        there = np.repeat(rng.random(n // 100 + 1) < 0.5, 100)[:n]
        noise = rng.normal(size=n)
        own = np.zeros(n)
        for i in range(1, n):
            own[i] = 0.98 * own[i - 1] + 0.02 * noise[i]
        distance = np.where(there, 0.0, np.inf)
        context = {"right_distance": distance, "left_distance": np.full(n, np.nan), "speed": np.full(n, 30.0)}
        near = BESIDE.response(0.2, context)[:, 0]
        width = np.full(n, LANE_WIDTH)
        time = 0.2 * np.arange(n)
        made.append(
            Run(drive=f"d{k}", index=0, time=time, offset=own + shift * near, lane_width=width, context=context)
        )
    return made


@pytest.mark.parametrize("shift", [0.0, 0.25])
@pytest.mark.parametrize("seed", range(3))
def test_three_drives_say_how_far_a_driver_moves_and_that_he_does_not(shift: float, seed: int) -> None:
    runs = runs_beside(shift, seed=seed)
    known = measure_beside(runs)
    assert set(known) == {"right"}, "nobody was ever on the left"
    assert known["right"].basis is Basis.MEASURED
    assert known["right"].shift == pytest.approx(shift, abs=3 * known["right"].error)
    profile = fit_population(runs, name="one")
    assert profile.basis_of("right") is Basis.MEASURED
    assert profile.basis_of("left") is Basis.UNKNOWN
    sizes = [effect.coefficients[0] for effect in profile.effects if isinstance(effect, Proximity)]
    assert sizes == ([pytest.approx(shift, abs=0.05)] if shift else [])


def test_too_few_seconds_leave_it_unknown() -> None:
    runs = runs_beside(0.25, drives=1, minutes=1.5)
    assert measure_beside(runs) == {}
    assert fit_population(runs, name="one").effects == ()


def test_a_measured_shift_that_no_effect_makes_is_as_good_as_unknown() -> None:
    from msgspec.structs import replace

    known = {"right": Beside(Basis.MEASURED, 600.0, 0.2, 0.02)}
    assert replace(simulated_profile(), beside=known).basis_of("right") is Basis.UNKNOWN


@pytest.mark.parametrize(
    ("right", "neighbours", "moves"),
    [
        (None, Neighbours.BORROW, True),
        (Beside(Basis.MEASURED, 600.0, 0.01, 0.02), Neighbours.BORROW, False),
        (Beside(Basis.DECLARED), Neighbours.BORROW, False),
        (Beside(Basis.POPULATION), Neighbours.BORROW, True),
        (None, Neighbours.PROFILE, False),
    ],
)
def test_the_law_moves_only_whose_answer_is_unknown(
    tmp_path: Path, right: Beside | None, neighbours: Neighbours, moves: bool
) -> None:
    """The overtaking one has somebody on his right; the other's answer is declared to be none."""
    from msgspec.structs import replace

    network = two_roads(tmp_path)
    cars = [drive(network, entity(name), lane=lane, start=100.0) for name, lane in (("slow", -2), ("fast", -1))]
    base = simulated_profile()
    drivers = {
        "slow": replace(base, beside={"left": Beside(Basis.DECLARED)}),
        "fast": base if right is None else replace(base, beside={"right": right}),
    }
    shifts = []
    for seed in range(8):
        found = enrich(SegmentedRun(together(*cars), network, neighbours=neighbours), drivers, seed=seed)
        alone = enrich(SegmentedRun(together(*cars), network, neighbours=Neighbours.PROFILE), drivers, seed=seed)
        np.testing.assert_array_equal(found.entity("slow").deviation, alone.entity("slow").deviation)
        shifts.append(np.abs(found.entity("fast").deviation - alone.entity("fast").deviation).max())
    assert (max(shifts) > 0.05) == moves
    assert moves or max(shifts) == 0.0


def test_with_no_neighbours_not_even_a_profile_s_own_effect_answers(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    cars = [drive(network, entity(name), lane=lane, start=100.0) for name, lane in (("slow", -2), ("fast", -1))]
    base = simulated_profile()
    shy = base.with_effects(
        Proximity(
            acts=Acts.LOCATION,
            column="right_distance",
            scale=FADING_DISTANCE,
            coefficients=(0.3,),
            errors=(0.01,),
            reference=(0.0,),
        )
    )
    answer = {}
    for which in (Neighbours.NONE, Neighbours.PROFILE):
        moved, still = (
            enrich(SegmentedRun(together(*cars), network, neighbours=which), {"fast": one}, seed=1)
            .entity("fast")
            .deviation
            for one in (shy, base)
        )
        answer[which] = np.abs(moved - still).max()
    assert answer[Neighbours.NONE] == 0.0
    assert answer[Neighbours.PROFILE] > 0.2
