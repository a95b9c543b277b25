"""SUMO run as a program: its road, its traffic, and the tracks that it writes."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.errors import XoscLateralError
from xosc_lateral.drivers.drives.drive import STEP

FloatArray = NDArray[np.float64]

LANES, SECONDS = 60, 600.0
"""Roads of one lane, one vehicle each, and how long it drives. [s]"""

SPEED = 30.0
"""Of vehicles and limit. [m/s]"""

LANE_WIDTH = 3.75
"""[m]"""

WARM = 60.0
"""Of each vehicle's drive, not used: it sets off in the lane's middle. [s]"""


class SumoMissingError(XoscLateralError):
    """The extra `sumo` is not installed."""


def simulate_sumo(sigma: float, seed: int, *, lanes: int = LANES, seconds: float = SECONDS) -> FloatArray:
    """Run SUMO and read each vehicle's lateral position on its lane.

    Raises
    ------
    SumoMissingError
        Without the extra `sumo`.
    """
    try:
        import sumo
    except ImportError as error:
        raise SumoMissingError("SUMO is not installed: pip install 'xosc-lateral[sumo]'") from error
    programs = Path(sumo.SUMO_HOME) / "bin"
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        _write_inputs(place, sigma, lanes, seconds)
        _run([programs / "netconvert", "-n", "road.nod.xml", "-e", "road.edg.xml", "-o", "road.net.xml"], place)
        words: list[str | Path] = [
            programs / "sumo",
            "-n",
            "road.net.xml",
            "-r",
            "road.rou.xml",
            "--step-length",
            f"{STEP:g}",
        ]
        words += [
            "--end",
            f"{seconds:g}",
            "--seed",
            f"{seed}",
            "--fcd-output",
            "tracks.xml",
            "--fcd-output.acceleration",
        ]
        words += ["--precision", "6", "--no-step-log", "--default.action-step-length", f"{STEP:g}"]
        _run(words, place)
        return _read_tracks(place / "tracks.xml")


def _run(words: Sequence[str | Path], folder: Path) -> None:
    done = subprocess.run([str(word) for word in words], cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise XoscLateralError(f"SUMO: {Path(words[0]).name} failed: {' '.join(done.stderr.split())[:300]}")


def _write_inputs(folder: Path, sigma: float, lanes: int, seconds: float) -> None:
    length = SPEED * (seconds + 60.0)
    nodes = [f'<node id="{e}{k}" x="{length * (e == "b")}" y="{50 * k}"/>' for k in range(lanes) for e in "ab"]
    edges = [
        f'<edge id="e{k}" from="a{k}" to="b{k}" numLanes="1" speed="{SPEED}" width="{LANE_WIDTH}"/>'
        for k in range(lanes)
    ]
    kind = f'<vType id="car" lcSigma="{sigma:.6f}" sigma="0" speedDev="0" maxSpeed="{SPEED}"/>'
    trips = [
        f'<vehicle id="v{k}" type="car" depart="0" departSpeed="max"><route edges="e{k}"/></vehicle>'
        for k in range(lanes)
    ]
    _write(folder / "road.nod.xml", "nodes", nodes)
    _write(folder / "road.edg.xml", "edges", edges)
    _write(folder / "road.rou.xml", "routes", [kind, *trips])


def _write(path: Path, root: str, lines: Sequence[str]) -> None:
    path.write_text(f"<{root}>\n" + "\n".join(lines) + f"\n</{root}>\n", encoding="utf-8")


def _read_tracks(path: Path) -> FloatArray:
    """Lateral position from y: every road runs along x, 50 m apart; travel is along +x, so +y is left."""
    from lxml import etree

    tracks: dict[str, list[float]] = {}
    for _, element in etree.iterparse(str(path), tag="vehicle"):
        tracks.setdefault(element.get("id"), []).append(float(element.get("y")))
        element.clear()
    skip = round(WARM / STEP)
    length = min(map(len, tracks.values()))
    rows = np.array([row[skip:length] for row in tracks.values()])
    number = np.array([int(name[1:]) for name in tracks])[:, None]
    return rows - 50.0 * number + 0.5 * LANE_WIDTH
