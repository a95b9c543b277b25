"""Fitting our model. First what can be read off the data, then a few rounds of simulating and comparing.

1. Mean of all.
2. Coarse movement and the variance between drivers (`fit_coarse`).
3. Fine noise: what the coarse movement lacks of the offset's power spectrum, geometric mean over windows.
4. Volatility: how much more, and for how long, the power in short windows varies than it would in steady movement.
5. Rounds of simulating: snippets of the model from the measured snippets' starts must show the same moments of log
   standard deviation, of the offset and of its differences. What differs corrects the scales, the volatilities and
   their correlation, and windows of both the spectrum of either part (indirect inference: Gourieroux, Monfort, Renault
   1993).

Everything is deterministic: the simulations draw from a fixed seed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.models.autoregressive.filters import split_bands
from xosc_lateral.driver.models.autoregressive.fit_coarse import fit_coarse
from xosc_lateral.driver.models.autoregressive.fit_matching import matched, with_volatility
from xosc_lateral.driver.models.autoregressive.fit_settings import DEFAULT_SETTINGS, FitSettings
from xosc_lateral.driver.models.autoregressive.fit_spectrum import fit_spectrum
from xosc_lateral.driver.models.autoregressive.model import AutoregressiveModel
from xosc_lateral.driver.models.autoregressive.rounding import rounded
from xosc_lateral.driver.models.autoregressive.volatility import Volatility
from xosc_lateral.errors import NotEnoughDataError

FloatArray = NDArray[np.float64]


def fit_autoregressive(
    rel_offsets: Sequence[FloatArray], drives: Sequence[str], settings: FitSettings = DEFAULT_SETTINGS
) -> AutoregressiveModel:
    """Fit to relative offsets [-], one array of shape (n_i,) per run at 5 Hz; runs of one drive are of one driver.

    Raises `NotEnoughDataError` when no run lasts one snippet, or the offset never moves.
    """
    runs = [np.asarray(run, dtype=np.float64) for run in rel_offsets]
    longest = max(map(len, runs), default=0)
    if longest < round(settings.snippet / settings.step) + 1:
        raise NotEnoughDataError(
            f"the longest run lasts {longest * settings.step:.1f} s, the fit needs {settings.snippet:g} s"
        )
    everything = np.concatenate(runs)
    if everything.std() < 1e-7:
        raise NotEnoughDataError(f"the offset never moves: standard deviation {everything.std():.2g} lane widths")
    mean = float(everything.mean())
    bands = [split_bands(run, settings.step) for run in runs]
    coarse, between = fit_coarse([slow - mean for slow, _ in bands], drives, settings)
    coarse, fine = fit_spectrum(runs, coarse, settings)
    low, high = max(-0.5, float(everything.min())), min(0.5, float(everything.max()))
    model = AutoregressiveModel(
        mean=mean,
        between_drivers=float(np.sqrt(between)),
        coarse=coarse,
        fine=fine,
        coarse_volatility=Volatility(),
        fine_volatility=Volatility(),
        correlation=0.0,
        limits=(min(low, mean - 1e-3), max(high, mean + 1e-3)),
        step=settings.step,
    )
    model = with_volatility(model, bands, len(set(drives)) > 1, settings)
    return rounded(matched(model, runs, settings))
