"""Range of vision in the motorway recording: with its own lateral positions, on lane centres, and as a profile samples.

    python -m laboratory.sight WHEEL [--profile motorway] [--write PAGE.md] [--figure FIGURE.svg]

Everything but the lateral position within the lane is the recording's in all three; only in the recorded one are lane
changes seen in it.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

import xosc_lateral as xl
from laboratory.detectors import recorded
from laboratory.markers import show
from xosc_lateral.extras.detect.sight import Sight, moments_of
from xosc_lateral.extras.detect.tracks import LaneTrack, Scene


def moved(track: LaneTrack, offset: np.ndarray) -> LaneTrack:
    """With other offsets from its lane's centre."""
    along, by = track.heading - track.heading_relative, offset - track.offset
    return track.having(offset=offset, x=track.x - by * np.sin(along), y=track.y + by * np.cos(along))


def sampled(scene: Scene, profile: str) -> Scene:
    tracks = []
    for seed, track in enumerate(scene.tracks):
        speed = float(np.nanmedian(track.speed))
        made = xl.sample(
            profile, duration=float(track.time[-1] - track.time[0]) + 1.0, speed=speed, seed=seed
        ).to_frame()
        tracks.append(moved(track, np.interp(track.time - track.time[0], made["time"], made["offset"])))
    return replace(scene, tracks=tuple(tracks))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wheel", type=Path)
    parser.add_argument("--profile", default="motorway")
    parser.add_argument("--write", type=Path, help="page with the markers")
    parser.add_argument("--figure", type=Path)
    args = parser.parse_args()
    (real,) = recorded(args.wheel)
    nominal = replace(real, tracks=tuple(moved(track, np.zeros(len(track))) for track in real.tracks))
    scenes = {
        "on lane centres": nominal, f"lifelike: {args.profile}": sampled(real, args.profile), "as recorded": real,
    }  # fmt: skip
    result = Sight({name: list(moments_of(scene)) for name, scene in scenes.items()}, (), 0, ())
    lines = ["| traffic | sensor | moments | second car seen | its width seen | lane seen |", "|---" * 6 + "|"]
    for row in result.rows():
        low, high = row["second_seen_low"], row["second_seen_high"]
        cells = row["source"], row["sensor"], row["moments"], f"{row['second_seen']:.0%} ({low:.0%} to {high:.0%})"
        lines.append("| {} | {} | {} | {} |".format(*cells) + f" {row['width_seen']:.0%} | {row['lane_seen']:.0f} m |")
    show("\n".join(lines), args.write, "sight")
    if args.figure is not None:
        result.plot().save(args.figure)


if __name__ == "__main__":
    main()
