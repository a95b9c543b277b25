"""Lateral gaps of vehicles side by side, beside those of any two of the two lanes: for `give_way.GAP_QUANTILES`.

    python -m laboratory.give_way WHEEL [--profile NAME...] [--seeds 12] [--write PAGE.md]

Then those that profiles leave which are sampled under the context of the same vehicles, nobody giving way
(`RESPONDING_GAPS`, of `motorway`), and with the law by which `convert` makes them.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from laboratory.markers import show
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampled_offsets import sample_context
from xosc_lateral.extras.recordings.importers import dlr_ht
from xosc_lateral.extras.recordings.lines_from_tracks import fit_reference_line
from xosc_lateral.files.drives import drives_of_table
from xosc_lateral.files.profiles import read_profile
from xosc_lateral.workflows.conversion.driver_context import NEIGHBOURS
from xosc_lateral.world.surroundings.give_way import wider

FloatArray = NDArray[np.float64]

QUANTILES = (0.0, 0.001, 0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.99)
EVERY = 20  # rows: 1 s


def side_by_side(source: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Pairs that overlap lengthwise, right and left lane, and all rows that they come from; once a second."""
    table = dlr_ht.import_dlr_ht(source, keep_cut=True).table
    dlr_ht.COLUMNS = (*dlr_ht.COLUMNS, "dimension_width")
    tracks = dlr_ht.read_tracks(source)
    north = dlr_ht.travels_north(tracks)
    _, s, _ = fit_reference_line(tracks[["center_easting", "center_northing"]].to_numpy(), north)
    rows = pd.DataFrame(
        {
            "frame": np.round(tracks["time"] / 0.05).astype(int) * 2 + north,
            "vehicle": tracks["vehicle"],
            "s": s,
            "length": tracks["dimension_length"],
            "width": tracks["dimension_width"],
            "lane": table["lane_index"],
            "offset": table["offset"],
            "apart": table["lane_width"],
        }
    )
    kept = table["state"].isin(["kept", "edge", "short"]) & (rows["lane"] >= 0) & (rows["frame"] // 2 % EVERY == 0)
    rows = rows[kept]
    pairs = rows[rows["lane"] == 0].merge(rows[rows["lane"] == 1], on="frame", suffixes=("", "_left"))
    beside = (pairs["s"] - pairs["s_left"]).abs() <= 0.5 * (pairs["length"] + pairs["length_left"])
    return pairs[beside], rows


def sampled_gaps(profile: DriverProfile, source: Path, pairs: pd.DataFrame, seeds: int) -> FloatArray:
    """The same gaps with both vehicles sampled from a profile, each under its own context, shape (seeds, n). [m]"""
    imported = dlr_ht.import_dlr_ht(source, keep_cut=True).table
    tracks = dlr_ht.read_tracks(source)
    by_vehicle = imported.assign(late=tracks["time"] - imported["time"]).groupby(tracks["vehicle"])[["drive", "late"]]
    known = by_vehicle.first()
    whole = imported.assign(following_run=0).drop(columns=["state", "vehicle_class"])  # an import knows its units
    drives = drives_of_table(whole, {})
    time = pairs["frame"].to_numpy() // 2 * 0.05

    def at(vehicle: pd.Series, made: dict[str, tuple[FloatArray, FloatArray]]) -> FloatArray:
        rows = zip(known.loc[vehicle, "drive"], time - known.loc[vehicle, "late"].to_numpy(), strict=True)
        return np.array([np.interp(moment, *made[name]) for name, moment in rows])

    found = []
    for seed in range(seeds):
        made = {one.drive: (one.time, one.offset) for one in sample_context(profile, drives, seed)}
        found.append(free_gap(pairs) + at(pairs["vehicle_left"], made) - at(pairs["vehicle"], made))
    return np.array(found)


def free_gap(pairs: pd.DataFrame) -> FloatArray:
    """With both in their lane's middle, shape (n,). [m]"""
    return np.asarray(pairs["apart"] - 0.5 * (pairs["width"] + pairs["width_left"]))


def main() -> None:
    """Print all distributions."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wheel", type=Path, metavar="WHEEL")
    parser.add_argument("--profile", nargs="*", default=["motorway"])
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    pairs, rows = side_by_side(args.wheel)
    free = free_gap(pairs)
    real = free + pairs["offset_left"] - pairs["offset"]
    n = 20 * len(pairs)
    left, right = (
        rows.loc[rows["lane"] == lane, "offset"].sample(n, replace=True, random_state=lane) for lane in (1, 0)
    )
    columns = {"side by side": real.to_numpy(), "any two": np.tile(free, 20) + left.to_numpy() - right.to_numpy()}
    for name in args.profile:
        profile = read_profile(name)
        gaps = sampled_gaps(profile, args.wheel, pairs, args.seeds).ravel()
        responding = bool(NEIGHBOURS & set(profile.columns))
        columns |= {
            f"`{profile.name}`": gaps,
            f"`{profile.name}`, giving way": gaps + wider(gaps, responding=responding),
        }
    encounters = real.groupby([pairs["vehicle"], pairs["vehicle_left"]]).min()
    lines = [f"| quantile | {' | '.join(columns)} |", "|---" * (1 + len(columns)) + "|"]
    for quantile in QUANTILES:
        values = " | ".join(f"{np.quantile(gaps, quantile):.2f}" for gaps in columns.values())
        lines.append(f"| {100 * quantile:g} % | {values} |")
    lines.append(f"| mean | {' | '.join(f'{gaps.mean():.2f}' for gaps in columns.values())} |")
    show(
        "\n".join([*lines, "", f"{len(pairs)} s side by side, {len(encounters)} encounters; {args.seeds} seeds."]),
        args.write,
        "gaps",
    )


if __name__ == "__main__":
    main()
