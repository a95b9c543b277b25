"""What conversions add to nominal movement, before anything is smoothed: lateral acceleration and jerk.

    python -m benchmarks.added_strain [FOLDER ...] [--seeds 20] [--first 0] [--profile motorway motorway-refined]

Scenarios are the shipped templates, dense traffic among them, and those of the folders. Acceleration and jerk are
differences of the sampled offsets at the model's 0.2 s. A row names the scenarios whose paths the filter against
undriveable movement would act on.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import xosc_lateral.enrich.enrich as conversion
from xosc_lateral.api.templates import list_templates, write_template
from xosc_lateral.driver.drivability import Bound, drivable
from xosc_lateral.enrich.seen import SAMPLE_STEP
from xosc_lateral.errors import XoscLateralError
from xosc_lateral.pipeline.drivers import choose_drivers
from xosc_lateral.pipeline.load import Played, play_scenario
from xosc_lateral.pipeline.settings import ConvertSettings

FloatArray = NDArray[np.float64]


def main() -> None:
    """Print a row per profile, and what stands out."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="*")
    parser.add_argument("--profile", nargs="+", default=["motorway", "motorway-refined"])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    args = parser.parse_args()
    print("| profile | paths | smoothed | |a| at 99.9 % | largest | jerk at 99.9 % | largest |")
    print("|---|---|---|---|---|---|---|")
    seeds = range(args.first, args.first + args.seeds)
    with tempfile.TemporaryDirectory() as folder:
        played = list(_all_played(args.folder, Path(folder)))
    for profile in args.profile:
        _row(profile, played, seeds)


def _all_played(folders: list[Path], made: Path) -> Iterator[tuple[str, Played]]:
    for name in list_templates().names:
        write_template(name, made / name)
    files = [path for folder in (made, *folders) for path in sorted(folder.rglob("*.xosc"))]
    for path in files:
        try:
            yield path.name, play_scenario(path)
        except XoscLateralError:
            continue  # a catalog, or what can't be played


def _row(profile: str, played: list[tuple[str, Played]], seeds: range) -> None:
    paths: list[FloatArray] = []
    smoothed = 0
    notes = list[str]()

    def seen(offset: FloatArray, step: float, speed: FloatArray) -> tuple[FloatArray, Bound | None]:
        nonlocal smoothed
        paths.append(offset)
        _, bound = drivable(offset, step, speed)
        smoothed += bound is not None
        return offset, None

    conversion.drivable = seen  # type: ignore[attr-defined]
    worst = list[tuple[float, float, str]]()
    for name, one in played:
        try:
            drivers = choose_drivers(one.scenario, ConvertSettings(profile=profile))
        except XoscLateralError:
            continue
        for seed in seeds:
            first = len(paths)
            before = smoothed
            conversion.enrich(one.motion, one.network, drivers, seed=seed)
            own = paths[first:]
            if own:
                a, j = _differences(own)
                worst.append((float(a.max(initial=0)), float(j.max(initial=0)), f"{name} seed {seed}"))
            if smoothed > before:
                notes.append(f"{name} seed {seed}")
    a, j = _differences(paths)
    row = [f"{np.quantile(a, 0.999):.3f}", f"{a.max():.2f}", f"{np.quantile(j, 0.999):.2f}", f"{j.max():.1f}"]
    print(f"| `{profile}` | {len(paths)} | {smoothed} | {' | '.join(row)} |", flush=True)
    for acceleration, jerk, name in sorted(worst, reverse=True)[:12]:
        print(f"  {name}: {acceleration:.2f} m/s2, {jerk:.1f} m/s3")
    print("  smoothed:", "; ".join(notes[:12]))


def _differences(paths: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Sizes of all accelerations [m/s2] and jerks [m/s3]."""
    found = [np.concatenate([np.abs(np.diff(path, order)) / SAMPLE_STEP**order for path in paths]) for order in (2, 3)]
    return found[0], found[1]


if __name__ == "__main__":
    main()
