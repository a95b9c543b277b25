"""`lcSigma` as a SUMO that is really run has it."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.baselines.lc_sigma import LcSigma
from xosc_lateral.drives.drive import Run
from xosc_lateral.drives.resampling import STEP
from xosc_lateral.errors import XoscLateralError
from xosc_lateral.segment import Segment

FloatArray = NDArray[np.float64]

LANES, SECONDS = 60, 600.0
"""Roads of one lane, one vehicle each, and how long it drives. [s]"""
SPEED = 30.0
"""Of vehicles and limit. [m/s]"""
LANE_WIDTH = 3.75
"""[m]"""
WARM = 60.0
"""Of each vehicle's drive, not used: it sets off in the lane's middle. [s]"""
NEAREST = 20
"""A window begins at one of so many moments whose offset is nearest to the start."""


class SumoMissingError(XoscLateralError):
    """The extra `sumo` is not installed."""


@dataclass(frozen=True, eq=False)
class SumoRun:
    """Stretches of a SUMO simulation's tracks: vehicles alone on their lanes, steps of 0.2 s.

    Parameters
    ----------
    sigma : float
        `lcSigma`. [-]
    seed : int
        SUMO's own.
    """

    sigma: float
    seed: int = 1
    _tracks: list[FloatArray] = field(default_factory=list, repr=False)

    title: ClassVar[str] = "lcSigma (SUMO run)"
    source: ClassVar[str] = "Eclipse SUMO, package eclipse-sumo on PyPI, run with --step-length 0.2"
    departures: ClassVar[str] = "lcSigma is fitted by its formula; stretches are moved to their start by centimetres"

    @classmethod
    def fit(cls, runs: Sequence[Run]) -> Self:
        """The formula's best `lcSigma`."""
        return cls(LcSigma.fit(runs).sigma)

    @cached_property
    def tracks(self) -> FloatArray:
        """Offsets of the simulated vehicles, shape (vehicles, steps), positive left. [m]"""
        return simulate_sumo(self.sigma, self.seed)

    def sample(
        self, segments: Sequence[Segment], starts: FloatArray | None, rng: np.random.Generator
    ) -> list[FloatArray]:
        """See `LateralModel.sample`."""
        tracks, found = self.tracks, []
        for number, segment in enumerate(segments):
            length = segment.lane_width[segment.inside].size
            first = tracks[:, : max(tracks.shape[1] - length, 1)]
            if starts is None:
                place = int(rng.integers(first.size))
            else:
                gaps = np.abs(first - starts[number]).ravel()
                place = int(rng.choice(np.argpartition(gaps, NEAREST)[:NEAREST]))
            vehicle, row = np.unravel_index(place, first.shape)
            path = _repeated(tracks[vehicle, row:], length)
            found.append(path if starts is None else path - path[0] + starts[number])
        return found

    @property
    def settings(self) -> Mapping[str, float]:
        """The fitted number. [-]"""
        return {"sigma": self.sigma}


def _repeated(path: FloatArray, length: int) -> FloatArray:
    """A path as long as wanted: what is beyond its end goes back the way it came."""
    while len(path) < length:
        path = np.concatenate([path, path[-2::-1]])
    return path[:length]


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
