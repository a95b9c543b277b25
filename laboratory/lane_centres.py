"""Why lane centres are estimated as they are: error on vehicles that were not used, and what bridging a gap costs.

python -m laboratory.lane_centres tasi-0.15.4-py3-none-any.whl [--write PAGE.md]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from laboratory.markers import show
from xosc_lateral.extras.recordings.cuts import KEPT_ROWS
from xosc_lateral.extras.recordings.importers import dlr_ht
from xosc_lateral.extras.recordings.lines_from_tracks import fit_lane_centre, fit_reference_line

FloatArray = NDArray[np.float64]
SPACINGS = (25.0, 50.0, 100.0, 150.0, 250.0, 400.0)  # [m]
GAPS = (0.5, 1.0, 1.5, 2.0, 3.0, 5.0)  # [s]
FOLDS = 5


class Lane:
    """Rows of one lane, one a second, and which vehicle each is of."""

    def __init__(self, s: FloatArray, d: FloatArray, height: FloatArray, vehicle: FloatArray, row: FloatArray) -> None:
        stretch = np.cumsum(np.r_[True, np.diff(row) != 1])
        second = dlr_ht._each(stretch, round(1 / dlr_ht.STEP))
        self.s, self.d, self.height = s[second], d[second], height[second]
        self.vehicle, self.stretch = vehicle[second], stretch[second]

    def held_out(self, spacing: float, tilt: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Squared residual, squared change of it in 1 s, and the latter of tall vehicles, on vehicles not used."""
        fold = np.random.default_rng(0).permutation(int(self.vehicle.max()) + 1) % FOLDS
        height = self.height if tilt else np.full(len(self.height), 1.5)
        found: list[list[FloatArray]] = [[], [], []]
        for k in range(FOLDS):
            use = fold[self.vehicle] != k
            lane = fit_lane_centre(self.s[use], self.d[use], height[use], self.stretch[use], knot_spacing=spacing)
            residual = self.d[~use] - lane.at(self.s[~use], height[~use])
            change = np.where(np.diff(self.stretch[~use]) == 0, np.diff(residual), np.nan)
            tall = self.height[~use][1:] > 2.5
            for values, into in zip((residual, change, change[tall]), found, strict=True):
                into.append(values[np.isfinite(values)] ** 2)
        return tuple(np.concatenate(part) for part in found)


def lanes_of(source: Path) -> tuple[list[Lane], list[FloatArray]]:
    """Every lane's rows, and the offsets of all kept stretches."""
    tracks = dlr_ht.read_tracks(source)
    table = dlr_ht.import_dlr_ht(source, keep_cut=True).table
    forward = dlr_ht.travels_north(tracks)
    line, s, d = fit_reference_line(tracks[["center_easting", "center_northing"]].to_numpy(), forward)
    s, d = np.where(forward, s, line.length - s), np.where(forward, d, -d)
    kept = (table["state"] == KEPT_ROWS).to_numpy()
    lane, vehicle = table["lane_index"].to_numpy(), tracks["vehicle"].to_numpy()
    height = tracks["dimension_height"].to_numpy()
    lanes = []
    for way in (True, False):
        for index in range(dlr_ht.LANE_COUNT):
            rows = np.flatnonzero(kept & (forward == way) & (lane == index))
            lanes.append(Lane(s[rows], d[rows], height[rows], vehicle[rows], rows))
    measured = np.flatnonzero(kept & ~tracks["interpolated"].to_numpy())
    cuts = np.flatnonzero((np.diff(measured) != 1) | (np.diff(vehicle[measured]) != 0)) + 1
    return lanes, np.split(table["offset"].to_numpy()[measured], cuts)


def knots_table(lanes: list[Lane]) -> list[str]:
    rms = lambda parts: float(np.sqrt(np.concatenate(parts).mean()))  # noqa: E731
    lines = ["| knots every | offset [m] | its change in 1 s [m] | the same, tall vehicles [m] |", "|---|---|---|---|"]
    for spacing, tilt in [(one, True) for one in SPACINGS] + [(50.0, False)]:
        offset, change, tall = zip(*(lane.held_out(spacing, tilt) for lane in lanes), strict=True)
        name = f"{spacing:.0f} m" + ("" if tilt else ", no tilt")
        lines.append(f"| {name} | {rms(offset):.4f} | {rms(change):.4f} | {rms(tall):.4f} |")
    return lines


def gaps_table(stretches: list[FloatArray]) -> list[str]:
    """Error in the middle of a straight bridge, on stretches without one."""
    lines = ["| bridge | error in its middle [m] |", "|---|---|"]
    for gap in GAPS:
        n = 2 * round(gap / dlr_ht.STEP / 2)
        errors = [x[n // 2 : -n // 2] - 0.5 * (x[n:] + x[:-n]) for x in stretches if len(x) > n]
        lines.append(f"| {gap:.1f} s | {np.sqrt((np.concatenate(errors) ** 2).mean()):.4f} |")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=Path)
    parser.add_argument("--write", type=Path, help="document with the markers")
    args = parser.parse_args()
    lanes, stretches = lanes_of(args.source)
    show("\n".join([*knots_table(lanes), "", *gaps_table(stretches)]), args.write, "lane-centres")


if __name__ == "__main__":
    main()
