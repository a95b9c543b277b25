"""What cut-in detectors do on nominal, lifelike and real traffic; the shortcut test.

    python -m laboratory.detectors WHEEL --alks FOLDER --openacc FILE... [--variants 3] [--write PAGE.md]
        [--figure FIGURE.svg]

WHEEL is `tasi-0.15.4-py3-none-any.whl`; FOLDER has the concrete scenarios of openMSL/sl-3-1-osc-alks-scenarios; FILEs
are runs of OpenACC's AstaZero campaign, or drive tables made from them. States `docs/validation/detectors.md`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from zlib import crc32

import xosc_lateral as xl
from laboratory.detector_table import Pool, alarm_figure, alarm_lines, default_lines, trained_lines, tuned_lines
from laboratory.markers import show
from laboratory.shortcut import shortcut_lines
from xosc_lateral.base.shipped import shipped_folder
from xosc_lateral.workflows.conversion.settings import ConvertSettings
from xosc_lateral.workflows.detection.detectors import RULES, LateralSpeed
from xosc_lateral.workflows.detection.logistic import Logistic, train
from xosc_lateral.workflows.detection.observation import PERFECT, USUAL_SENSOR, Sensor, View, views_of
from xosc_lateral.workflows.detection.sources import SourceSettings, checked, drive_scenes, sources_of
from xosc_lateral.workflows.detection.tracks import Scene

Views = list[tuple[Scene, list[View]]]

SEED = 55
SPEEDS = (0.10, 0.15, 0.20, 0.25)
"""Thresholds of lateral speed. [m/s]"""


@dataclass(frozen=True)
class Given:
    """What the study is made from."""

    wheel: Path
    alks: Path
    runs: Sequence[Path]
    templates: Path
    variants: int


def half_of(scenes: Iterable[Scene], half: int) -> Iterator[Scene]:
    """Every other vehicle of each scene, by a hash of its name."""
    for scene in scenes:
        tracks = tuple(track for track in scene.tracks if crc32(track.name.encode()) % 2 == half)
        if tracks:
            yield replace(scene, tracks=tracks)


def seen(scenes: Iterable[Scene], sensor: Sensor = PERFECT) -> Views:
    return [(scene, views_of(scene, sensor, SEED)) for scene in scenes]


def scenes_of(paths: Sequence[Path], profile: str = "", variants: int = 0, ego: str | None = "none") -> Iterator[Scene]:
    """Scenes of scenarios as written; with a profile, of their lifelike variants."""
    settings = SourceSettings(ConvertSettings.of(seed=SEED), variants, (profile,) if profile else (), ego)
    for path in paths:
        written, *lifelike = sources_of(path, settings)
        for source in lifelike or [written]:
            yield from checked(source)


def recorded(path: Path) -> list[Scene]:
    (source,) = sources_of(path, SourceSettings())
    return list(checked(source))


def run_scenes(path: Path) -> list[Scene]:
    """Of a drive table, or of a file of OpenACC."""
    if path.name.endswith(".parquet"):
        return list(drive_scenes(xl.read_drives(path)))
    with TemporaryDirectory() as folder:
        table = xl.import_drives("openacc", path).write(f"{folder}/{path.name.split('.')[0]}.parquet")
        return list(drive_scenes(xl.read_drives(table)))


def pools(given: Given, folder: Path) -> dict[str, Views]:
    """Traffic by what it is: nominal, lifelike by profile, the paper's model, real."""
    scenarios = [given.templates, given.alks]
    table = xl.import_drives("dlr-ht", given.wheel).write(folder / "dlr.parquet")
    paper = xl.write_profile(xl.fit(table, name="paper", model="two-level"), folder / "paper.json")
    shipped = [profile.stem for profile in sorted(shipped_folder("driver_profiles").glob("*.json"))]
    found = {"nominal": seen(scenes_of(scenarios))}
    for profile in (*shipped, str(paper)):
        name = Path(profile).stem
        found[f"lifelike: {name}"] = seen(scenes_of(scenarios, profile, given.variants))
        print(name, flush=True)
    found["real: motorway recording"] = seen(recorded(given.wheel))
    for path in given.runs:
        for scene in run_scenes(path):
            found[f"real: RTK, {scene.name.removeprefix('ASta_')}"] = seen([scene])
    return found


# ---- trained on one, tested on another -------------------------------------------------------------------------------
def trained(given: Given, folder: Path, sensor: Sensor) -> tuple[dict[str, Logistic], Views, Views]:
    """`logistic` by what it was trained on; held-out vehicles of the recording; the RTK runs."""
    scenes = recorded(given.wheel)
    table = xl.import_drives("dlr-ht", given.wheel).to_frame()
    fitted = table[[crc32(name.rsplit("-", 1)[-1].encode()) % 2 == 0 for name in table["drive"]]]
    half = str(xl.write_profile(xl.fit(fitted, name="half"), folder / "half.json"))
    scenarios = [given.templates, given.alks]
    rural = "rural" if (shipped_folder("driver_profiles") / "rural.json").exists() else None
    sources: dict[str, Iterable[Scene]] = {
        "nominal": scenes_of(scenarios),
        "lifelike: half of the recording": scenes_of(scenarios, half, 4 * given.variants),
        "real: half of the recording": half_of(scenes, 0),
    }
    if rural:
        sources["lifelike: rural"] = scenes_of(scenarios, rural, 4 * given.variants)
    detectors = {
        name: train((view for _, views in seen(each, sensor) for view in views), 0.5, name)
        for name, each in sources.items()
    }
    runs = [scene for path in given.runs for scene in run_scenes(path)]
    return detectors, seen(half_of(scenes, 1), sensor), seen(runs, sensor)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wheel", type=Path)
    parser.add_argument("--alks", type=Path, required=True)
    parser.add_argument("--openacc", type=Path, nargs="+", required=True, metavar="FILE")
    parser.add_argument("--variants", type=int, default=3)
    parser.add_argument("--part", choices=("alarms", "trained", "shortcut"), nargs="+", help="default: all")
    parser.add_argument("--write", type=Path, help="page with the markers")
    parser.add_argument("--figure", type=Path, help="false alarms by lateral speed (.svg)")
    args = parser.parse_args()
    given = Given(args.wheel, args.alks, args.openacc, shipped_folder("templates"), args.variants)
    parts = args.part or ("alarms", "trained", "shortcut")
    with TemporaryDirectory() as name:
        folder = Path(name)
        if "alarms" in parts:
            traffic = pools(given, folder)
            by_speed = [LateralSpeed(threshold=speed) for speed in SPEEDS]
            alarms = [Pool.of(name, views, by_speed) for name, views in traffic.items()]
            show(alarm_lines(alarms), args.write, "alarms")
            rules = [rule() for rule in RULES.values()]
            every = [Pool.of(name, views, rules) for name, views in traffic.items()]
            show(default_lines(every), args.write, "defaults")
            show(tuned_lines(every), args.write, "tuned")
            if args.figure is not None:
                alarm_figure(alarms).save(args.figure)
        if "trained" in parts:
            lines = []
            for sensor in (PERFECT, USUAL_SENSOR):
                lines += trained_lines(*trained(given, folder, sensor), "perfect" if sensor is PERFECT else "usual")
            show("\n".join(lines), args.write, "trained")
        if "shortcut" in parts:
            replays = seen(scenes_of([given.templates, given.alks], "motorway", 8 * given.variants))
            reactive = seen(scenes_of([given.templates, given.alks], "motorway", 8 * given.variants, ego=None))
            nominal = seen(scenes_of([given.templates, given.alks]))
            show(shortcut_lines(replays, reactive, nominal, seen(recorded(given.wheel))), args.write, "shortcut")


if __name__ == "__main__":
    main()
