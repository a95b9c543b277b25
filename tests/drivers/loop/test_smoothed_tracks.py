"""Tables whose provider smoothed the tracks: almost nothing above 0.3 Hz, in no column of context."""

import numpy as np
import pytest

from tests.kit.planted import planted_drive
from xosc_lateral.drivers.loop.regression import fit_model
from xosc_lateral.drivers.loop.terms.mean import MeanTerm
from xosc_lateral.drivers.model.effects import Acts, Linear

SIZE = 0.15  # [m], per standard deviation of the column


@pytest.mark.parametrize("seed", [811, 812, 813])
def test_an_effect_has_its_size_although_the_tracks_were_smoothed(seed: int) -> None:
    coarse = planted_drive(lambda column: SIZE * column["gust"], seed, smooth=7)
    term = MeanTerm.of(Linear(acts=Acts.LOCATION, column="gust", response_s=2.0))
    fitted = fit_model(coarse, (term,))
    assert fitted.sizes[0] == pytest.approx(SIZE, rel=0.12)
    assert abs(fitted.sizes[0] - SIZE) < 3.0 * np.sqrt(fitted.covariance[0, 0])
