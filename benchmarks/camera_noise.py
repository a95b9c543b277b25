"""Where a recording's fast lateral movement belongs to the place and not to the drivers: zones of camera noise.

    python -m benchmarks.camera_noise tasi-0.15.4-py3-none-any.whl [--write PAGE.md]

The offsets' movement between 0.3 and 1 Hz, root mean square over all vehicles in every 100 m of the road, beside the
median of all such pieces of the carriageway. Drivers don't steer faster at one place than everywhere else on a straight
motorway, and cameras do see worse at some.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.dlr_stretches import Recording
from benchmarks.markers import show
from xosc_lateral.formats.importers.dlr_ht import STEP

FloatArray = NDArray[np.float64]

BAND = (0.3, 1.0)  # [Hz]
PIECE = 100.0  # [m]
LONGEST_EDGE = 2.0  # [s]; left out at either end of a stretch, where the filter settles
LEAST = 15.0  # [s]; shorter stretches are left out
LOUD = 1.75  # times the carriageway's median
FEW = 20  # vehicles; a piece with fewer says nothing


def fast_movement(source: Path) -> tuple[FloatArray, NDArray[np.bool_], NDArray[np.intp], FloatArray]:
    """Place along the road [m], direction (True: north), vehicle, and filtered offset [m] of every usable row."""
    from scipy.signal import butter, sosfiltfilt

    recording = Recording.read(source)
    offset = recording.table["offset"].to_numpy()
    band = butter(2, BAND, "bandpass", fs=1.0 / STEP, output="sos")
    edge, parts = round(LONGEST_EDGE / STEP), []
    for part in recording.stretches(LEAST):
        inside = slice(part.start + edge, part.stop - edge)
        fast = sosfiltfilt(band, offset[part])[edge:-edge]
        parts.append((recording.place[inside], recording.north[inside], recording.vehicle[inside], fast))
    columns = zip(*parts, strict=True)
    return tuple(np.concatenate(column) for column in columns)  # type: ignore[return-value]


def loud_pieces(source: Path) -> str:
    """Table of the pieces that are louder than the rest of their carriageway."""
    place, north, vehicle, fast = fast_movement(source)
    rows = [
        "| carriageway | from [km] | to [km] | 0.3 to 1 Hz [mm] | times the median | vehicles |",
        "|---|---|---|---|---|---|",
    ]
    for name, mine in (("northbound", north), ("southbound", ~north)):
        piece = (place[mine] // PIECE).astype(int)
        loudness = np.sqrt(np.bincount(piece, fast[mine] ** 2) / np.maximum(np.bincount(piece), 1))
        seen = [len(np.unique(vehicle[mine][piece == k])) for k in range(piece.max() + 1)]
        usual = float(np.median(loudness[np.array(seen) >= FEW]))
        for k in np.flatnonzero((loudness > LOUD * usual) & (np.array(seen) >= FEW)):
            where = f"{PIECE * k / 1000:.1f} | {PIECE * (k + 1) / 1000:.1f}"
            rows.append(f"| {name} | {where} | {1000 * loudness[k]:.1f} | {loudness[k] / usual:.1f} | {seen[k]} |")
    return "\n".join(rows)


def main() -> None:
    """Print the table, or write it into a page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=Path)
    parser.add_argument("--write", type=Path, metavar="PAGE.md")
    args = parser.parse_args()
    show(loud_pieces(args.source), args.write, "camera-noise")


if __name__ == "__main__":
    main()
