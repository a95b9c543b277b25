"""Base models of fewer simulated snippets, for tests of what is done with them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from xosc_lateral.drivers.fitting.models import autoregressive_fit

# An eighth of what a fit simulates, however many packages of tests ask for it at once.
COARSE_COUNTS = {name: getattr(autoregressive_fit, name) // 8 for name in ("SIMULATED_DRIVERS", "FOR_EACH")}


@contextmanager
def coarse_fits() -> Iterator[None]:
    """Within it a fit simulates an eighth of the snippets: chance moves its spreads by 2 %."""
    with pytest.MonkeyPatch.context() as patched:
        for name, number in COARSE_COUNTS.items():
            patched.setattr(autoregressive_fit, name, number)
        yield
