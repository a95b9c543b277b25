"""What an effect does in a scenario is measured there: planted shifts come back, with their side."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

import xosc_lateral as xl
from xosc_lateral.drivers.model.effects import Acts, Linear, Proximity
from xosc_lateral.workflows.conversion.proof import proofs_of

KEEPS_AWAY = Proximity(
    acts=Acts.LOCATION,
    column="right_distance",
    scale=40.0,
    lag_s=-1.0,
    response_s=1.0,
    response_order=2,
    coefficients=(0.3,),
    errors=(0.01,),
    reference=(0.0,),
)


@pytest.mark.parametrize("size", [0.3, -0.3])
def test_a_planted_shift_beside_a_truck_is_measured_in_the_conversion(size: float) -> None:
    effect = replace(KEEPS_AWAY, coefficients=(size,))
    profile = replace(xl.read_profile("motorway-vehicle-1"), effects=(effect,))
    (found,) = proofs_of(profile)
    # over a stretch with at least half of the largest shift, which is all of it where somebody is alongside
    assert 0.5 < found.shift / size <= 1.0
    assert found.end - found.start > 2.0 and found.columns == ("right_distance",)
    assert ("further left" if size > 0 else "further right") in str(found)


def test_what_acts_in_no_scenario_or_moves_nobody_proves_nothing() -> None:
    profile = xl.read_profile("motorway-vehicle-1")
    rain = Linear(acts=Acts.LOCATION, column="rain", coefficients=(0.1,), errors=(0.01,), reference=(0.0,))
    faint = replace(KEEPS_AWAY, coefficients=(0.005,))
    fine = replace(KEEPS_AWAY, acts=Acts.FINE)
    assert proofs_of(replace(profile, effects=(rain, faint, fine))) == []
    assert proofs_of(replace(profile, effects=())) == []
