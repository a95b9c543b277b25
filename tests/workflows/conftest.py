"""Fits are quick; `tests/drivers/fitting` and README's walk look at what comes out of them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.kit.fits import coarse_fits


@pytest.fixture(scope="package", autouse=True)
def _coarse_fits() -> Iterator[None]:
    with coarse_fits():
        yield
