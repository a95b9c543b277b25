"""What is sampled and fitted again comes back as it was; the full table is `laboratory.round_trips --acceptance`."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from xosc_lateral.drivers.fitting.models.autoregressive_fit import fit_autoregressive
from xosc_lateral.drivers.model.core.autoregressive.model import AutoregressiveModel
from xosc_lateral.files.profiles import find_profile, read_profile

STEP = 0.2


def sample(model: AutoregressiveModel, drivers: int, seconds: float, seed: int) -> np.ndarray:
    stream = model.stream(np.random.SeedSequence(seed), drivers=drivers)
    return np.ascontiguousarray(sum(stream.take(round(seconds / STEP))).T)


def wander(runs: np.ndarray, seconds: float) -> float:
    """Deviation of means of a third of a drive within the drive."""
    size = round(seconds / 3.0 / STEP)
    return float(np.sqrt(runs[:, : 3 * size].reshape(len(runs), 3, size).mean(axis=2).var(axis=1, ddof=1).mean()))


@pytest.mark.parametrize(("name", "apart"), [("rural", 1.0), ("rural", 4.0), ("motorway", 1.0)])
def test_nine_drivers_come_back_as_they_were(name: str, apart: float) -> None:
    """Wander within a drive is theirs, however far apart their means are, and so are these."""
    model = read_profile(find_profile(name)).model
    assert isinstance(model, AutoregressiveModel)
    planted = replace(model, between_drivers=apart * model.between_drivers)
    runs = sample(planted, 9, 300.0, 1)
    back = sample(fit_autoregressive(list(runs), list("abcdefghi")), 300, 300.0, 2)
    # Of 18 differences a wander is known to 1 / sqrt(36), a sixth; how far nine are apart, to a quarter.
    assert wander(back, 300.0) / wander(runs, 300.0) == pytest.approx(1.0, abs=0.4)
    assert np.sqrt(back.var(axis=1).mean() / runs.var(axis=1).mean()) == pytest.approx(1.0, abs=0.08)
    assert back.mean(axis=1).std() / runs.mean(axis=1).std(ddof=1) == pytest.approx(1.0, abs=0.25)
