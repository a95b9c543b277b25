"""The corrected fit of the two-level model finds what drives were sampled from; the published one does not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from tests.kit.coarse import movement
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.fitting.models.two_level import correct_two_level, fit_two_level, leaving_rate
from xosc_lateral.workflows.profiles.fit import fit


def test_what_drives_were_sampled_from_is_found() -> None:
    truth = fit_two_level([gaussian_filter1d(movement(np.random.default_rng(3), 3000.0), 5.0) * 3.0 / 3.6])
    drives = [np.sum(truth.stream(seed).take(20_000), axis=0) for seed in np.random.SeedSequence(5).spawn(5)]
    published = fit_two_level(drives)
    corrected = correct_two_level(published)
    rate = leaving_rate(truth.counts)
    assert leaving_rate(published.counts) < 0.9 * rate
    assert leaving_rate(corrected.counts) == pytest.approx(rate, rel=0.06)
    assert np.array_equal(correct_two_level(published).counts, corrected.counts)


def test_other_models_have_no_corrected_fit() -> None:
    with pytest.raises(DriverProfileError, match="two-level"):
        fit([], name="mine", corrected=True)
