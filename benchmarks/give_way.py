"""Lateral gaps of vehicles side by side, beside those of any two vehicles of the two lanes: `enrich.give_way.GAPS`.

python -m benchmarks.give_way WHEEL
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from xosc_lateral.formats.importers import dlr_ht
from xosc_lateral.formats.importers.road_from_tracks import fit_reference_line

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


def main() -> None:
    """Print both distributions."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wheel", type=Path, metavar="WHEEL")
    pairs, rows = side_by_side(parser.parse_args().wheel)
    free = pairs["apart"] - 0.5 * (pairs["width"] + pairs["width_left"])
    real = free + pairs["offset_left"] - pairs["offset"]
    n = 20 * len(pairs)
    left, right = (
        rows.loc[rows["lane"] == lane, "offset"].sample(n, replace=True, random_state=lane) for lane in (1, 0)
    )
    drawn = np.tile(free, 20) + left.to_numpy() - right.to_numpy()
    encounters = real.groupby([pairs["vehicle"], pairs["vehicle_left"]]).min()
    print(f"{len(pairs)} s side by side, {len(encounters)} encounters; gap [m] at quantiles")
    print("| quantile | side by side | any two |\n|---|---|---|")
    for quantile in QUANTILES:
        print(f"| {quantile:g} | {real.quantile(quantile):.2f} | {np.quantile(drawn, quantile):.2f} |")


if __name__ == "__main__":
    main()
