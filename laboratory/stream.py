"""One hour of `OffsetStream.step` at 100 Hz: time per call, memory, and equality with the batch call.

python -m laboratory.stream [PROFILE.json] [--seconds 3600] [--rate 100]
"""

from __future__ import annotations

import argparse
import gc
import json
import resource
import time
from typing import Any

import numpy as np

from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.fitting.models.two_level import fit_two_level
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import sample_offsets
from xosc_lateral.drivers.model.stream import OffsetStream
from xosc_lateral.files.profiles import read_profile

MODEL_STEP = 0.2


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("profile", nargs="?", help="name or path; without one a two-level model with five effects")
    arguments.add_argument("--seconds", type=float, default=3600.0)
    arguments.add_argument("--rate", type=float, default=100.0)
    options = arguments.parse_args()
    profile = read_profile(options.profile) if options.profile else made_profile()
    stream = OffsetStream(profile, 1, rate=options.rate)
    count = round(options.seconds * options.rate)
    ahead = stream.preview_steps
    columns = made_context(count + ahead, 1.0 / options.rate)
    contexts = [
        dict(zip(columns, values, strict=True))
        for values in zip(*map(np.ndarray.tolist, columns.values()), strict=True)
    ]
    for context in contexts[:ahead]:
        stream.look(context)

    took, offsets = np.empty(count, dtype=np.int64), np.empty(count)
    sizes = []
    gc.collect()
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for call in range(count):
        context = contexts[call + ahead]
        begin = time.perf_counter_ns()
        offsets[call] = stream.step(context)
        took[call] = time.perf_counter_ns() - begin
        if call % (count // 4) == count // 8:
            sizes.append(len(json.dumps(stream.to_dict())))
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory

    every = round(options.rate * MODEL_STEP)
    coarse = {name: values[::every] for name, values in columns.items()}
    times = np.arange(len(coarse["speed"])) * MODEL_STEP
    samples = sample_offsets(profile, Segment(times, coarse["lane_width"], coarse["speed"], coarse), 1)
    apart = np.abs(offsets[::every] - samples[: len(offsets[::every])]).max()

    median, slow, slowest = np.quantile(took, [0.5, 0.999, 1.0]) / 1000.0
    print(f"{count} steps at {options.rate:g} Hz, profile {profile.name} with {len(profile.effects)} effects")
    print(f"per step: median {median:.2f} us, 99.9 % {slow:.1f} us, slowest {slowest:.0f} us")
    print(f"memory grown by {grown} kB; saved state {sizes} characters")
    print(f"largest difference from the batch call at its samples: {apart:.2g} m")


def made_profile() -> DriverProfile:
    from xosc_lateral.drivers.model.effects import Acts, Drift, Linear, Nearness, Regimes

    rng = np.random.default_rng(5)
    run = np.convolve(rng.normal(size=20_000), np.ones(25) / 60.0, mode="same")
    look_ahead = {"lag_s": -1.2, "response_s": 2.0}
    effects = (
        Linear(column="curvature", acts=Acts.LOCATION, **fitted(80.0, 0.0), **look_ahead),
        Linear(column="speed", acts=Acts.FINE, **fitted(0.02, 30.0)),
        Nearness(column="lead_distance", scale=20.0, acts=Acts.SPREAD, **fitted(0.4, 0.1)),
        Drift(size=0.1, correlation_s=120.0),
        Regimes(factor=1.8, on_s=20.0, off_s=60.0),
    )
    return DriverProfile("made", fit_two_level([run]), effects)


def fitted(coefficient: float, reference: float) -> dict[str, Any]:
    return {"coefficients": (coefficient,), "errors": (0.0,), "reference": (reference,)}


def made_context(count: int, step: float) -> dict[str, np.ndarray]:
    time = np.arange(count) * step
    return {
        "speed": 30.0 + 4.0 * np.sin(time / 11.0),
        "lane_width": 3.5 + 0.2 * np.sin(time / 31.0),
        "curvature": 1e-3 * np.sin(time / 5.0),
        "lead_distance": 60.0 + 40.0 * np.sin(time / 7.0),
    }


if __name__ == "__main__":
    main()
