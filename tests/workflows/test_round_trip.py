"""Drivers that were converted with, played, imported as noisy tracks in pieces and fitted are what they were."""

from __future__ import annotations

import numpy as np
import pytest

from laboratory import converted_round_trips
from laboratory.converted_round_trips import there_and_back


def test_through_convert_tracks_and_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Eight of two minutes, 3 cm of noise, pieces of 40 s; the tables of many are the laboratory's."""
    monkeypatch.setattr(converted_round_trips, "DRIVERS", 100)
    _, within, between, *bands, mean = there_and_back("rural", 8, 124.0, 0.03, True, 1, None)
    # Spreads of 16 runs and of 8 drivers are known to 1 / sqrt(2 n), two errors; of 2 min, slow bands as badly.
    assert within == pytest.approx(1.0, abs=0.15)
    assert between == pytest.approx(1.0, abs=0.25)
    assert np.array(bands[1:3]) == pytest.approx(1.0, abs=0.2)
    assert abs(mean) < 0.08
