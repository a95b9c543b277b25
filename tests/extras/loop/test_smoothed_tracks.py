"""Tables whose provider smoothed the tracks: almost nothing above 0.3 Hz, in no column of context."""

from dataclasses import replace

import numpy as np
import pytest

from tests.kit.planted import planted_drive
from xosc_lateral.drivers.fitting.bands import density_of
from xosc_lateral.drivers.model.core.base import ModelKind
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Linear
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.extras.loop.held_out import fit_refined
from xosc_lateral.extras.loop.model import fit_model
from xosc_lateral.extras.loop.terms.mean import MeanTerm
from xosc_lateral.files.profiles import read_profile

SIZE = 0.15  # [m], per standard deviation of the column


@pytest.mark.parametrize("seed", [811, 812, 813])
def test_an_effect_has_its_size_although_the_tracks_were_smoothed(seed: int) -> None:
    coarse = planted_drive(lambda column: SIZE * column["gust"], seed, smooth=7)
    term = MeanTerm.of(Linear(acts=Acts.LOCATION, column="gust", response_s=2.0))
    fitted = fit_model(coarse, (term,))
    assert fitted.sizes[0] == pytest.approx(SIZE, rel=0.12)
    assert abs(fitted.sizes[0] - SIZE) < 3.0 * np.sqrt(fitted.covariance[0, 0])


def _refined(valid_below: float | None, base: DriverProfile | None) -> DriverProfile:
    coarse = planted_drive(lambda column: SIZE * column["gust"], 814, smooth=15)
    coarse = replace(coarse, timeline=replace(coarse.timeline, valid_below=valid_below, resolution=0.01))
    fitted = fit_model(coarse, (MeanTerm.of(Linear(acts=Acts.LOCATION, column="gust", response_s=2.0)),))
    return fit_refined(fitted, ModelKind.AUTOREGRESSIVE, "refined", None, base)


def test_a_refined_profile_moves_above_the_band_as_the_one_that_it_began_with() -> None:
    base, at = read_profile("motorway"), np.array([0.3, 0.4, 0.5])
    smooth, refined = _refined(None, base), _refined(0.15, base)
    ratio = density_of(refined)(at) / density_of(base)(at)
    assert (density_of(smooth)(at) / density_of(base)(at) < 0.25).all()
    assert ((ratio > 0.7) & (ratio < 1.4)).all()
    assert ("gust",) in {effect.columns for effect in refined.effects if isinstance(effect, ColumnEffect)}


@pytest.mark.pages
def test_a_refined_profile_says_where_it_is_valid() -> None:
    low, high = _refined(0.15, read_profile("motorway")).validity.bands
    assert low.source == "1 drive"
    assert (low.high, high.low) == (0.15, pytest.approx(1.5 * 0.15))  # between them one passes into the other
    assert high.source == "profile motorway"
    alone = _refined(0.15, None).validity
    assert alone.highest_frequency is None or alone.highest_frequency <= 0.15
    assert alone.resolution == 0.01
    assert _refined(None, None).validity.bands == ()
