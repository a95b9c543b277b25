"""Two readings of the paper's bins: of width 1 / n_c, as its chain has them, or 2 / n_c, as it says once of rounding.

    python -m laboratory.paper_readings TABLE [--seed 1]

Both are fitted to all drives of TABLE; snippets of 10 s from the measured starts beside the measured ones: distance of
each metric in standard deviations of the measured.
"""

from __future__ import annotations

import argparse

import numpy as np

from tests.kit.snippet_distances import snippet_distances
from xosc_lateral.drivers.drives.drive import all_runs
from xosc_lateral.drivers.fitting.models.two_level import fit_two_level, split_levels
from xosc_lateral.drivers.model.core.base import Start
from xosc_lateral.drivers.model.core.two_level.model import TwoLevelSettings
from xosc_lateral.files.drives import read_drives

SNIPPET = 51


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    runs = [run.rel_offset for run in all_runs(read_drives(args.table)) if len(run) >= SNIPPET]
    real = np.concatenate([run[: len(run) // SNIPPET * SNIPPET].reshape(-1, SNIPPET) for run in runs])
    for name, bins in (("1 / n_c", 20), ("2 / n_c", 10)):
        settings = TwoLevelSettings(n_bins=bins)
        model = fit_two_level(runs, settings)
        stream = model.stream(np.random.SeedSequence(args.seed), Start(real[:, 0]), drivers=len(real))
        made = np.ascontiguousarray(sum(stream.take(SNIPPET)).T)
        found = snippet_distances(real, made)
        capped = np.mean([np.mean(np.abs(split_levels(run, settings)[1]) >= settings.fine_cap) for run in runs])
        parts = ", ".join(f"{metric} {value:.2f}" for metric, value in found.by_metric.items())
        print(f"{name}: mean distance {found.mean:.3f}, {100.0 * capped:.0f} % of fine values capped; {parts}")


if __name__ == "__main__":
    main()
