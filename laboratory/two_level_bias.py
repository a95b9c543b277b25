"""What the paper's way of fitting does to its own model: drives sampled from a two-level profile, and fitted again.

    python -m laboratory.two_level_bias TABLE [--drives N] [--minutes M]

The profile is fitted to TABLE; then N drives of M minutes are sampled from it and fitted in the same way.
"""

from __future__ import annotations

import argparse

import numpy as np

from xosc_lateral.drivers.fitting.models.two_level import correct_two_level
from xosc_lateral.drivers.model.core.registry import model_named
from xosc_lateral.drivers.model.core.two_level.model import TwoLevelModel
from xosc_lateral.workflows.profiles.fit import fit


def figures(model: TwoLevelModel) -> dict[str, float]:
    """Rate at which bins are left, per step [-]; spread of bins [-]; damping's rms [lane widths]."""
    chain = model.chain
    stays = np.diag(model.counts) / np.maximum(model.counts.sum(axis=1), 1)
    spread = float(np.sqrt(chain.stationary @ (chain.centres - chain.mean) ** 2))
    found = {"leaving rate": 1.0 - float(chain.stationary @ stays), "spread of bins": spread}
    return found | {f"damping, knot {k}": float(value) for k, value in enumerate(model.damping)}


def main() -> None:
    """Print a row per figure: truth, and how far it is off when fitted again, as published and corrected."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table")
    parser.add_argument("--drives", type=int, default=10)
    parser.add_argument("--minutes", type=float, default=50.0)
    args = parser.parse_args()
    truth = fit(args.table, name="truth", model="two-level").model
    assert isinstance(truth, TwoLevelModel)
    seeds = np.random.SeedSequence(1).spawn(args.drives)
    n = round(60.0 * args.minutes / truth.step)
    series = [np.sum(truth.stream(seed).take(n), axis=0) for seed in seeds]
    again = model_named("two-level").fit(series, [str(k) for k in range(len(series))])
    assert isinstance(again, TwoLevelModel)
    published, corrected = figures(again), figures(correct_two_level(again))
    for name, value in figures(truth).items():
        changes = (f"{100.0 * (found[name] / value - 1.0):+.1f} %" for found in (published, corrected))
        print(f"{name}: {value:.4g}; fitted again {', corrected '.join(changes)}")


if __name__ == "__main__":
    main()
