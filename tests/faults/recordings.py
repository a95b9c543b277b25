"""Recordings under attack: what importers read."""

from __future__ import annotations

import zipfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd

from tests.extras.recordings.test_importers_tracks import commonroad_scenario, driven, two_lanes_each_way
from tests.faults.reader import Reader, sane_table


def _levelx_files(folder: Path) -> Iterable[Path]:
    from tests.extras.recordings.test_importers import _exid, _highd

    _highd(folder, 0.4, -0.3)
    _exid(folder, True)
    return sorted(folder.glob("*.csv"))


def _use_levelx(path: Path) -> None:
    from xosc_lateral.extras.recordings.importers.levelx import import_levelx

    sane_table(import_levelx(path.with_name(f"{path.name.split('_')[0]}_tracks.csv")).table)


def _dlr_files(folder: Path) -> Iterable[Path]:
    from tests.extras.recordings.test_importers import _dlr_recording

    tracks, _ = _dlr_recording(11, per_lane=14)
    tracks.to_csv(folder / "trajectories_1.csv", index=False, float_format="%.3f")
    with zipfile.ZipFile(folder / "t.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(folder / "trajectories_1.csv", "x/trajectories/trajectories_1.csv")
    return [folder / "trajectories_1.csv", folder / "t.zip"]


def _use_dlr(path: Path) -> None:
    from xosc_lateral.extras.recordings.importers.dlr_ht import import_dlr_ht

    sane_table(import_dlr_ht(path).table)


MF4_MAP = ("distance_left=LnLeft:cm", "distance_right=LnRight:cm", "speed=VehSpd:km/h")


def _mf4_files(folder: Path) -> Iterable[Path]:
    import asammdf

    fast = np.arange(0, 30, 0.04)
    sway = 0.3 * np.sin(2 * np.pi * fast / 10)
    for compression in (0, 2):
        with asammdf.MDF(version="4.10") as mdf:
            left, right = 100 * (1.8 - sway), 100 * (1.8 + sway)
            mdf.append([asammdf.Signal(left, fast, name="LnLeft"), asammdf.Signal(right, fast, name="LnRight")])
            mdf.append([asammdf.Signal(np.full(len(fast), 108.0), fast, name="VehSpd")])
            yield Path(mdf.save(folder / f"d{compression}.mf4", overwrite=True, compression=compression))


def _use_mf4(path: Path) -> None:
    from xosc_lateral.extras.recordings.importers.mf4 import import_mf4

    sane_table(import_mf4(path, MF4_MAP).table)


def _tracks_files(folder: Path) -> Iterable[Path]:
    table = pd.concat(
        [driven("a", 1, 100.0, 30.0, sway=0.3), driven("b", 2, 105.0, 30.0), driven("c", -2, 1900.0, 30.0)]
    )
    road = two_lanes_each_way(folder)
    table.iloc[::5].round(3).to_csv(folder / "tracks.csv", index=False)
    return [folder / "tracks.csv", road]


def _use_tracks(path: Path) -> None:
    from xosc_lateral.extras.recordings.importers.tracks import import_tracks

    source, road = path.with_name("tracks.csv"), path.with_name("road.xodr")
    sane_table(import_tracks(source, road=road, columns=("heading=psi:deg",)).table)


def _commonroad_files(folder: Path) -> Iterable[Path]:
    return [commonroad_scenario(folder)]


def _use_commonroad(path: Path) -> None:
    from xosc_lateral.extras.recordings.importers.commonroad import import_commonroad

    sane_table(import_commonroad(path).table)


def _osi_files(folder: Path) -> Iterable[Path]:
    from tests.extras.recordings.test_osi_read import drives, saved

    return [saved(folder / "trace.mcap", drives()[:200]), saved(folder / "trace_gt.osi", drives()[:200])]


def _use_osi(path: Path) -> None:
    from xosc_lateral.extras.recordings.importers.osi import import_osi

    sane_table(import_osi(path).table)


RECORDINGS = (
    Reader("levelx", _levelx_files, _use_levelx),
    Reader("dlr", _dlr_files, _use_dlr, 0.1),
    Reader("mf4", _mf4_files, _use_mf4, needs="asammdf"),
    Reader("tracks", _tracks_files, _use_tracks),
    Reader("commonroad", _commonroad_files, _use_commonroad, 0.3, needs="commonroad"),
    Reader("osi", _osi_files, _use_osi, 0.3, needs="osi_utilities"),
)
