"""What was found, in numbers: errors before and after are those of the group that shows it."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.base.arrays import NORMAL_95
from xosc_lateral.drivers.model.effects import Step
from xosc_lateral.extras.loop.close import _finding, agreeing, describe_finding
from xosc_lateral.extras.loop.core_model import TIMES_S, DriverVariance, SpectrumShape
from xosc_lateral.extras.loop.held_out import HeldOut
from xosc_lateral.extras.loop.model import Description
from xosc_lateral.extras.loop.selection import Accepted
from xosc_lateral.extras.loop.terms.time import StepTerm

REAL = {"mean by effect: step 0": np.array([0.1, -0.1]), "movement by band": np.array([0.2, 0.1, np.nan])}
BEFORE = {"mean by effect: step 0": np.array([0.0, 0.0]), "movement by band": np.array([0.2, 0.4, 0.3])}
AFTER = {name: values.copy() for name, values in REAL.items()}
COMPARED = HeldOut(None, REAL, BEFORE, AFTER, np.zeros(0), np.zeros(0), [])  # type: ignore[arg-type]


def test_an_accepted_term_is_told_with_its_errors_on_held_out_rows() -> None:
    accepted = Accepted(StepTerm(at=300), 1e-6)
    effects = (Step(size=0.2, size_error=0.02, at_s=285.0),)
    found = describe_finding(accepted, "step 0", effects, None, COMPARED)  # type: ignore[arg-type]
    assert (found.effect, found.kind, found.shape) == ("step", "step", "at 285 s")
    assert (found.size_m, found.size_error, found.p_value) == (0.2, 0.02, 1e-6)
    assert (found.error_before, found.error_after) == pytest.approx((0.1, 0.0))
    assert (found.alike, found.effects, found.gain) == ((), effects, None)


def test_a_group_that_nobody_described_has_no_error() -> None:
    found = describe_finding(Accepted(StepTerm(at=300), 1e-6), "step 7", (Step(size=0.2),), None, COMPARED)  # type: ignore[arg-type]
    assert (found.error_before, found.error_after) == (0.0, 0.0)


@pytest.mark.parametrize(("ratio", "worst"), [((1.0, 1.1, 0.5, 1.0, 1.0), 2), ((1.0, 3.0, 0.5, 1.0, 1.0), 1)])
def test_memory_is_told_by_the_band_that_is_farthest_off_either_way(ratio: tuple[float, ...], worst: int) -> None:
    lack = SpectrumShape(TIMES_S, np.array(ratio), 1e-5)
    found = _finding(lack.described(), COMPARED, kind=lack.KIND, p_value=lack.p_value)
    assert found.size_m == ratio[worst]
    assert f"within {TIMES_S[worst]:g} s is {ratio[worst]:.2f} times" in found.shape
    # 0.3 off in one of two cells that both know; the third was never measured
    assert found.error_before == pytest.approx(np.sqrt(0.3**2 / 2.0))
    assert (found.kind, found.columns, found.effects) == ("memory", (), ())


def test_drivers_that_differ_are_told_with_the_error_of_their_spread() -> None:
    lack = DriverVariance(50, 0.15, 0.2, 1e-4)
    found = _finding(lack.described(), COMPARED, kind=lack.KIND, p_value=lack.p_value)
    assert found.size_m == 0.15
    assert found.size_error == pytest.approx(0.15 / np.sqrt(100.0))
    assert found.shape == "50 drives; their spreads scatter by a factor of 1.22"
    assert (found.kind, found.error_before) == ("population", 0.0)


@pytest.mark.parametrize(("kind", "size", "none"), [("location", 0.2, 0.0), ("scale", 1.4, 1.0), ("scale", 0.7, 1.0)])
def test_no_interval_is_across_no_effect_beside_a_certain_p_value(kind: str, size: float, none: float) -> None:
    wide = Description("x", "linear", size, 0.5, "")
    about = NORMAL_95 * agreeing(wide, kind, 1e-4).size_error
    assert 0.0 < about < abs(size - none)
    assert agreeing(wide, kind, 0.01) == wide
    narrow = Description("x", "linear", size, 0.01, "")
    assert agreeing(narrow, kind, 1e-4) == narrow
