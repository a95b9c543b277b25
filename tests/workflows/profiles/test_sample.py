"""`sample` under a context, and the same drive from a stream."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import xosc_lateral as xl


@pytest.mark.parametrize("number", [0, 1])
def test_a_stream_has_the_offsets_of_the_drive_that_sample_gives(number: int) -> None:
    context = pd.DataFrame({"time": 0.2 * np.arange(300), "speed": 30.0, "curvature": 1e-3, "lane_width": 3.6})
    profile = xl.read_profile("motorway")
    frame = xl.sample(profile, context=[context] * 2, seed=5).to_frame()
    wanted = frame[frame["drive"] == frame["drive"].unique()[number]]["offset"].to_numpy()
    stream, seen = xl.OffsetStream(profile, 5, drive=number), {"speed": 30.0, "curvature": 1e-3, "lane_width": 3.6}
    for _ in range(stream.preview_steps):
        stream.look(seen)
    steps = [stream.step(seen) for _ in range(len(wanted) - stream.preview_steps)]
    np.testing.assert_allclose(steps, wanted[: len(steps)], rtol=0, atol=1e-9)
