"""What each part of our model is worth: it left out, the rest fitted anew, on held-out drives.

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python -m laboratory.model_choice dlr.parquet [--splits 8] [--classifier] [--write PAGE.md]

Half of the drives is fitted, snippets of the other half are sampled from their starts; a ratio is the mean (or worst)
over the ten metrics of the Wasserstein distance, divided by that between the two real halves.
"""

from __future__ import annotations

import argparse
import dataclasses
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from tests.kit.snippet_distances import snippet_distances
from xosc_lateral.drivers.drives.drive import Run, all_runs
from xosc_lateral.drivers.evaluation.classifier import classifier_two_sample_test
from xosc_lateral.drivers.evaluation.metrics import METRICS, split_groups
from xosc_lateral.drivers.fitting.models.autoregressive_coarse import DEFAULT_SETTINGS
from xosc_lateral.drivers.fitting.models.autoregressive_fit import fit_autoregressive, matched, simulate
from xosc_lateral.drivers.fitting.models.two_level import fit_two_level
from xosc_lateral.drivers.model.core.autoregressive.model import AutoregressiveModel
from xosc_lateral.drivers.model.core.autoregressive.parameters import Volatility
from xosc_lateral.drivers.model.core.base import Start
from xosc_lateral.files.drives import read_drives

FloatArray = NDArray[np.float64]
Sampler = Callable[[FloatArray, int, np.random.Generator], FloatArray]
LENGTHS = {"10 s": 51, "60 s": 301}
MARKER = "model-choice"


def autoregressive(runs: Sequence[Run], **settings: object) -> AutoregressiveModel:
    return fit_autoregressive(
        [run.rel_offset for run in runs], [run.drive for run in runs], dataclasses.replace(DEFAULT_SETTINGS, **settings)
    )


def batch(model: AutoregressiveModel) -> Sampler:
    return lambda starts, n, rng: simulate(model, n, int(rng.integers(1 << 62)), drivers=len(starts), starts=starts)


def rematched(runs: Sequence[Run], **parts: object) -> Sampler:
    """Our model with parts replaced, its scales matched anew."""
    model = replace(autoregressive(runs), **parts)
    return batch(matched(model, [run.rel_offset for run in runs], DEFAULT_SETTINGS))


def two_level(runs: Sequence[Run]) -> Sampler:
    model = fit_two_level([run.rel_offset for run in runs])

    def sample(starts: FloatArray, n: int, rng: np.random.Generator) -> FloatArray:
        seeds = [np.random.SeedSequence(int(seed)) for seed in rng.integers(1 << 62, size=len(starts))]
        return np.array(
            [sum(model.stream(seed, Start(float(x))).take(n)) for seed, x in zip(seeds, starts, strict=True)]
        )

    return sample


def keeps(part: Volatility) -> Volatility:
    return replace(part, within=0.0, slow=0.0)


def one_driver(runs: Sequence[Run]) -> Sampler:
    return batch(fit_autoregressive([run.rel_offset for run in runs], ["all"] * len(runs)))


def steady_drivers(runs: Sequence[Run]) -> Sampler:
    model = autoregressive(runs)
    parts = {"coarse_volatility": keeps(model.coarse_volatility), "fine_volatility": keeps(model.fine_volatility)}
    return rematched(runs, **parts)


VARIANTS: dict[str, Callable[[Sequence[Run]], Sampler]] = {
    "two levels (the paper)": two_level,
    "**autoregressive**": lambda runs: batch(autoregressive(runs)),
    "all drivers are one": one_driver,
    "drivers differ, but never change": steady_drivers,
    "no volatility at all": lambda runs: rematched(
        runs, coarse_volatility=Volatility(), fine_volatility=Volatility(), correlation=0.0
    ),
    "coarse and fine volatility apart": lambda runs: batch(replace(autoregressive(runs), correlation=0.0)),
    "memory of 2 s": lambda runs: batch(autoregressive(runs, order=2)),
    "memory of 4 s": lambda runs: batch(autoregressive(runs, order=4)),
    "memory of 8 s": lambda runs: batch(autoregressive(runs, order=8)),
    "memory of 24 s": lambda runs: batch(autoregressive(runs, order=24)),
}


def snippets(runs: Sequence[Run], length: int) -> tuple[FloatArray, NDArray[np.str_]]:
    """Relative offsets, shape (n, length), and whose they are."""
    rows = [
        (run.rel_offset[k : k + length], run.drive) for run in runs for k in range(0, len(run) - length + 1, length)
    ]
    return np.array([row for row, _ in rows]), np.array([drive for _, drive in rows])


def score(runs: Sequence[Run], fit: Callable[[Sequence[Run]], Sampler], splits: int, classify: bool) -> list[str]:
    """Ratios for both snippet lengths, and the classifier's area under the curve on the first split."""
    rng = np.random.default_rng(20261121)
    drives = np.array([run.drive for run in runs])
    model = {name: np.zeros(len(METRICS)) for name in LENGTHS}
    floor = {name: np.zeros(len(METRICS)) for name in LENGTHS}
    auc = None
    for split in range(splits):
        chosen = split_groups(drives, rng)
        train = [run for run, taken in zip(runs, chosen, strict=True) if taken]
        test = [run for run, taken in zip(runs, chosen, strict=True) if not taken]
        sample = fit(train)
        for name, length in LENGTHS.items():
            real, whose = snippets(test, length)
            made = sample(real[:, 0], length, np.random.default_rng(split))
            model[name] += list(snippet_distances(real, made).by_metric.values())
            floor[name] += list(snippet_distances(real, snippets(train, length)[0]).by_metric.values())
            if classify and not split and length == LENGTHS["10 s"]:
                auc = classifier_two_sample_test(real, made, whose, whose)
    cells = []
    for name in LENGTHS:
        ratio = model[name] / floor[name]
        worst = int(np.argmax(ratio))
        cells += [f"{model[name].mean() / floor[name].mean():.2f}", f"{ratio[worst]:.2f} ({METRICS[worst]})"]
    return [*cells, "" if auc is None else f"{auc.auc:.3f}"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, nargs="+")
    parser.add_argument("--splits", type=int, default=8)
    parser.add_argument("--classifier", action="store_true", help="also train a classifier (20 s a variant)")
    parser.add_argument("--write", type=Path, help="put the table between the markers of this page")
    args = parser.parse_args()
    runs = all_runs(read_drives(args.table))
    lines = ["| variant | mean, 10 s | worst | mean, 60 s | worst | AUC |", "|---|---|---|---|---|---|"]
    for name, fit in VARIANTS.items():
        lines.append("| " + " | ".join([name, *score(runs, fit, args.splits, args.classifier)]) + " |")
        print(lines[-1], flush=True)
    if args.write:
        page = args.write.read_text(encoding="utf-8")
        table = "\n".join(lines)
        pattern = rf"(<!-- {MARKER}: begin -->\n).*?(<!-- {MARKER}: end -->)"
        args.write.write_text(re.sub(pattern, rf"\g<1>{table}\n\g<2>", page, flags=re.DOTALL), encoding="utf-8")


if __name__ == "__main__":
    main()
