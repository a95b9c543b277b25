"""The maneuver law of the public motorway recording: fitted, tried on vehicles that it was not fitted to, written.

    python -m laboratory.maneuver_law tasi-0.15.4-py3-none-any.whl [--write driver_profiles/motorway.json]

Prints the law, quantiles of durations that halves of the vehicles give over those of the other halves
(docs/scenarios.md), and how many lane changes end before somebody near. `--write` puts the law into a profile.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.model.profile import Maneuvers
from xosc_lateral.extras.recordings.lane_order import RoadLanes, vehicle_next
from xosc_lateral.extras.recordings.reconstruct import changes_of, law_of
from xosc_lateral.extras.recordings.recorded import place_tracks
from xosc_lateral.extras.recordings.recordings import read_recording
from xosc_lateral.files.profiles import read_profile, write_profile

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
HALVES = 20
NEAR = 1.0
"""Headway of a follower who is near. [s]"""


def quantile_ratios(law: Maneuvers, duration: FloatArray, gap: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Quantiles of what a law draws behind gaps over those of durations, shape (5,). [-]"""
    drawn = [law.duration(rng.standard_normal(50), one) for one in gap.tolist()]
    return np.asarray(np.quantile(np.concatenate(drawn), QUANTILES) / np.quantile(duration, QUANTILES))


def main(argv: Sequence[str] | None = None) -> None:
    """Print, and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wheel", type=Path)
    parser.add_argument("--write", type=Path, metavar="PROFILE", help="profile that gets the law")
    args = parser.parse_args(argv)
    traffic = read_recording(args.wheel)
    vehicles = place_tracks(traffic.tracks, traffic.network, *traffic.span).vehicles
    lanes = RoadLanes(traffic.network)
    found = changes_of(vehicles, vehicles, lanes)
    law = law_of(found, traffic.name)
    print(law.in_words())
    if args.write is not None:
        write_profile(replace(read_profile(args.write), maneuvers=law), args.write)
    rng = np.random.default_rng(0)
    ratios = []
    for _ in range(HALVES):
        order = rng.permutation(len(found))
        half, other = ([found[k] for k in part] for part in np.array_split(order, 2))
        held_out = np.array([one for vehicle in other for one in vehicle.changes])
        ratios.append(quantile_ratios(law_of(half, ""), held_out[:, 0], held_out[:, 1], rng))
    for share, column in zip(QUANTILES, np.array(ratios).T, strict=True):
        print(
            f"{share:.0%} of durations, half over other half: {column.mean():.3f} "
            f"({column.min():.3f} to {column.max():.3f})"
        )
    behind = [
        vehicle_next(vehicle.motion, row, vehicles, lanes, ahead=False) for vehicle in found for row in vehicle.crossing
    ]
    near = [one for one in behind if one.headway < NEAR]
    closing = sum(one.closing > 0.0 for one in near)
    print(f"{len(behind)} lane changes, {len(near)} before a follower within {NEAR:g} s, {closing} of these closing")


if __name__ == "__main__":
    main()
