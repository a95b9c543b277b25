"""Columns that go with the place that different drives keep: found and sized between drives, and not by chance."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.drivers.fitting.fitting import fit_profile
from xosc_lateral.drivers.model.core.base import ModelKind
from xosc_lateral.drivers.model.effects import Linear
from xosc_lateral.extras.loop.close import close_loop
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.identify import usable_columns
from xosc_lateral.extras.loop.model import Outcome, fit_model
from xosc_lateral.extras.loop.selection import ERROR_BUDGET
from xosc_lateral.extras.loop.terms.between import USUAL_S, BetweenTerm
from xosc_lateral.extras.loop.timeline import Coarse, join_drives

STEP = 0.2


def drives(rng: np.random.Generator, number: int, *, size: float, seconds: float = 120.0) -> list[Drive]:
    """Drives that each keep a place of their own, farther left by `size` [m] for every 10 m/s; three idle columns."""
    made = []
    for index in range(number):
        n = round(seconds / STEP)
        usual = rng.uniform(22.0, 38.0)
        speed = usual + 0.5 * wander(rng, n, 20.0)
        place = 0.1 * rng.normal() + size * (usual - 30.0) / 10.0
        context = {"speed": speed, "grade": wander(rng, n, 30.0)}
        context |= {name: rng.normal() + 0.2 * wander(rng, n, 30.0) for name in ("load", "age")}
        made.append(
            Drive(
                name=f"drive-{index:02d}",
                time=STEP * np.arange(n),
                offset=place + 0.2 * wander(rng, n, 6.0),
                lane_width=np.full(n, 3.6),
                context=context,
                levels=frozenset(),
            )
        )
    return made


def wander(rng: np.random.Generator, n: int, time_constant: float) -> np.ndarray:
    keep = np.exp(-STEP / time_constant)
    noise = np.sqrt(1.0 - keep**2) * rng.normal(size=n)
    values = np.empty(n)
    last = rng.normal()
    for index in range(n):
        last = keep * last + noise[index]
        values[index] = last
    return values


def outcome_of(made: list[Drive], seed: int = 2) -> tuple[Coarse, Outcome | None]:
    coarse = Coarse.of(join_drives(made))
    search = Search.over(coarse, usable_columns(coarse.timeline).columns, np.random.SeedSequence(seed), ERROR_BUDGET)
    return coarse, BetweenTerm.test(search, fit_model(coarse, ()))


def test_what_goes_with_a_drives_place_is_found_and_sized() -> None:
    coarse, found = outcome_of(drives(np.random.default_rng(1), 40, size=0.4))
    assert found is not None
    assert found.columns == ("speed",)
    assert found.p_value < 1e-3
    linear = BetweenTerm.of(Linear(acts="location", column="speed", response_s=USUAL_S))  # type: ignore[arg-type]
    (effect,) = linear.estimate(fit_model(coarse, (linear,)))
    assert 10.0 * effect.coefficients[0] == pytest.approx(0.4, abs=3.0 * 10.0 * effect.errors[0])  # type: ignore[attr-defined]
    assert 10.0 * effect.errors[0] < 0.08  # type: ignore[attr-defined]


@pytest.mark.pages
def test_chance_finds_columns_between_drives_as_often_as_it_says() -> None:
    probabilities = []
    for seed in range(30):
        _, found = outcome_of(drives(np.random.default_rng([7, seed]), 24, size=0.0, seconds=40.0), seed)
        assert found is not None
        probabilities.append(found.p_value)
    assert min(probabilities) > 0.001
    assert 0.25 < float(np.mean(probabilities)) < 0.75


def test_few_drives_say_nothing_between_them() -> None:
    assert outcome_of(drives(np.random.default_rng(3), 12, size=0.3))[1] is None


@pytest.mark.pages
def test_the_loop_adds_it_and_comes_closer_on_drives_that_it_did_not_fit() -> None:
    own = drives(np.random.default_rng(5), 40, size=0.3, seconds=60.0)
    base = fit_profile(own, name="paper", model=ModelKind.TWO_LEVEL)  # which does not know what speed does
    result = close_loop(own, base, seed=1)
    finding = next(finding for finding in result.findings if finding.columns == ("speed",))
    assert finding.kind == "location"
    assert finding.error_after < 0.5 * finding.error_before
    again = close_loop(drives(np.random.default_rng(5), 40, size=0.3, seconds=60.0), result.refined, seed=1)
    assert not any(finding.columns == ("speed",) for finding in again.findings)
