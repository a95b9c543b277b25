"""What cut-in detectors do on nominal, lifelike and real traffic; the shortcut test.

    python -m laboratory.detectors WHEEL --alks FOLDER --openacc FILE... [--variants 2] [--write PAGE.md]
        [--figure FIGURE.svg]

WHEEL is `tasi-0.15.4-py3-none-any.whl`; FOLDER has the concrete scenarios of openMSL/sl-3-1-osc-alks-scenarios; FILEs
are runs of OpenACC's AstaZero campaign, or drive tables made from them. States `docs/validation/detectors.md`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from zlib import crc32

import pandas as pd

import xosc_lateral as xl
from laboratory.detector_table import Pool, alarm_figure, alarm_lines
from laboratory.markers import show
from laboratory.shortcut import played_variants, shortcut_lines
from xosc_lateral.base.plugins import shipped_folder
from xosc_lateral.extras.detect.detectors import LateralSpeed
from xosc_lateral.extras.detect.observation import PERFECT_SENSOR, Sensor, View, views_of
from xosc_lateral.extras.detect.sources import SourceSettings, checked, drive_scenes, sources_of
from xosc_lateral.extras.detect.tracks import Scene
from xosc_lateral.workflows.conversion.settings import ConvertSettings

Views = list[tuple[Scene, list[View]]]

SEED = 55
SWERVES = ("_4_1_2_", "_4_6_2_")
"""ALKS scenarios with a vehicle that moves sideways in its lane as written: no lane keeping, and left out."""
SHORTCUT_VARIANTS = 8
"""Of each scenario for the shortcut test, times --variants: six scenarios have eight lane changes."""
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

    @property
    def scenarios(self) -> list[Path]:
        """Our templates and the ALKS scenarios."""
        return [
            self.templates,
            *(path for path in sorted(self.alks.glob("*.xosc")) if not any(map(path.name.count, SWERVES))),
        ]


def half_of(scenes: Iterable[Scene], half: int) -> Iterator[Scene]:
    """Every other vehicle of each scene, by a hash of its name."""
    for scene in scenes:
        tracks = tuple(track for track in scene.tracks if in_half(track.name, half))
        if tracks:
            yield replace(scene, tracks=tracks)


def in_half(name: str, half: int) -> bool:
    """Of a vehicle of the recording, whose drive's name ends with the track's."""
    return crc32(name[-10:].encode()) % 2 == half


def seen(scenes: Iterable[Scene], sensor: Sensor = PERFECT_SENSOR) -> Views:
    return [(scene, views_of(scene, sensor, SEED)) for scene in scenes]


def scenes_of(
    paths: Sequence[Path], profile: str = "", variants: int = 0, lane_changes: str = "written"
) -> Iterator[Scene]:
    """Scenes of scenarios as written; with a profile, of their lifelike variants."""
    convert = ConvertSettings.of(seed=SEED, lane_changes=lane_changes)
    settings = SourceSettings(convert, variants, (profile,) if profile else (), "none")
    for path in paths:
        written, *lifelike = sources_of(path, settings)
        for source in lifelike or [written]:
            yield from checked(source)


@cache
def recorded(path: Path) -> tuple[Scene, ...]:
    (source,) = sources_of(path, SourceSettings())
    return tuple(checked(source))


@cache
def drive_table(path: Path) -> pd.DataFrame:
    """Of the motorway recording, without the one vehicle beyond 50 m/s that `fit` refuses."""
    table = xl.import_drives("dlr-ht", path).to_frame()
    return table[table.groupby("drive")["speed"].transform("median") <= 50.0]


def run_scenes(path: Path) -> list[Scene]:
    """Of a drive table, or of a file of OpenACC."""
    table = path if path.name.endswith(".parquet") else xl.import_drives("openacc", path).to_frame()
    return list(drive_scenes(xl.read_drives(table)))


def pools(given: Given, folder: Path) -> dict[str, Views]:
    """Traffic by what it is: nominal, lifelike by profile, the paper's model, real."""
    scenarios = given.scenarios
    paper = xl.write_profile(xl.fit(drive_table(given.wheel), name="paper", model="two-level"), folder / "paper.json")
    shipped = [profile.stem for profile in sorted(shipped_folder("driver_profiles").glob("*.json"))]
    found = {"nominal": seen(scenes_of(scenarios))}
    for profile in shipped:
        found[f"lifelike: {profile}"] = seen(scenes_of(scenarios, profile, given.variants))
    found["lifelike: the paper's model"] = seen(scenes_of(scenarios, str(paper), given.variants))
    found["real: motorway recording"] = seen(recorded(given.wheel))
    for path in given.runs:
        for scene in run_scenes(path):
            found[f"real: RTK, {scene.name.removeprefix('ASta_')}"] = seen([scene])
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wheel", type=Path)
    parser.add_argument("--alks", type=Path, required=True)
    parser.add_argument("--openacc", type=Path, nargs="+", required=True, metavar="FILE")
    parser.add_argument("--variants", type=int, default=2)
    parser.add_argument("--part", choices=("alarms", "shortcut"), nargs="+", help="default: all")
    parser.add_argument("--write", type=Path, help="page with the markers")
    parser.add_argument("--figure", type=Path, help="false alarms by lateral speed (.svg)")
    args = parser.parse_args()
    given = Given(args.wheel, args.alks, args.openacc, shipped_folder("templates"), args.variants)
    parts = args.part or ("alarms", "shortcut")
    with TemporaryDirectory() as name:
        folder = Path(name)
        if "alarms" in parts:
            traffic = pools(given, folder)
            by_speed = [LateralSpeed(threshold=speed) for speed in SPEEDS]
            alarms = [Pool.of(name, views, by_speed) for name, views in traffic.items()]
            show(alarm_lines(alarms), args.write, "alarms")
            if args.figure is not None:
                alarm_figure(alarms).save(args.figure)
        if "shortcut" in parts:
            scenarios = [given.templates / f"{name}.xosc" for name in ("cut-in", "dense-traffic")]
            scenarios += sorted(given.alks.glob("*_4_4_*.xosc")) + sorted(given.alks.glob("*_4_5_*.xosc"))
            count = SHORTCUT_VARIANTS * given.variants
            replays = seen(played_variants(scenarios, "none", count))
            reactive = seen(played_variants(scenarios, "Ego", count))
            lines = shortcut_lines(replays, reactive, seen(scenes_of(scenarios)), seen(recorded(given.wheel)))
            show(lines, args.write, "shortcut")


if __name__ == "__main__":
    main()
