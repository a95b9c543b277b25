"""Contacts that lifelike movement brings into the dense template: conversions without resampling.

    python -m laboratory.contacts [--profile NAME...] [--count 1000]
        [--write PAGE.md]

A contact counts if the nominal scenario lacks it, a departure if a reference point leaves the lane that it keeps
nominally.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

from laboratory.markers import show
from xosc_lateral.workflows.conversion.enrich import SegmentedRun, enrich
from xosc_lateral.workflows.conversion.load import play_scenario
from xosc_lateral.workflows.conversion.plan import choose_drivers
from xosc_lateral.workflows.conversion.settings import ConvertSettings
from xosc_lateral.workflows.playing.templates import write_template

QUANTILES = (0.0, 0.01, 0.1, 0.5)


def main() -> None:
    """Print a row per profile."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--profile", nargs="+", default=["auto"])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--write", type=Path, metavar="PAGE.md", help="page with the markers")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        written = write_template("dense-traffic", Path(folder))
        played = play_scenario(next(path for path in written if path.suffix == ".xosc"))
    lines = [
        "| profile | conversions | with contacts | with departures | smallest gap at quantiles 0, 1, 10, 50 % [m] |",
        "|---|---|---|---|---|",
    ]
    for profile in args.profile:
        drivers = choose_drivers(played.scenario, ConvertSettings(profile=profile))
        contacts, departures, gaps = 0, 0, []
        for seed in range(args.count):
            made = enrich(SegmentedRun(played.motion, played.network), drivers, seed=seed)
            contacts += bool(made.new_contacts)
            departures += bool(made.departures)
            gaps.append(min(gap.distance for gap in made.gaps_after))
        told = ", ".join(f"{value:.2f}" for value in np.quantile(gaps, QUANTILES))
        lines.append(f"| `{profile}` | {args.count} | {contacts} | {departures} | {told} |")
    show("\n".join(lines), args.write, "contacts")


if __name__ == "__main__":
    main()
