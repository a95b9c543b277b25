"""Base models of fewer simulated snippets, for tests of what is done with them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from xosc_lateral.drivers.fitting.models import autoregressive_fit


@contextmanager
def coarse_fits() -> Iterator[None]:
    """Within it a fit simulates an eighth of the snippets: chance moves its spreads by 2 %."""
    with pytest.MonkeyPatch.context() as patched:
        for name in ("SIMULATED_DRIVERS", "FOR_EACH"):
            patched.setattr(autoregressive_fit, name, getattr(autoregressive_fit, name) // 8)
        yield
