"""What roads answer, how scenarios play and are written, kept from when other tests had shown that they are right.

Closed forms and other packages say where things ought to be, each for what it covers. Here stands all at once, so that
no line of roads, player or writer changes its meaning unnoticed. After a change that was meant,
`python -m tests.kit.kept` writes the numbers anew, and their difference belongs into the commit.
"""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from math import isclose
from pathlib import Path
from typing import Any

import numpy as np

from tests.kit.made.scenario import made
from tests.kit.places import VALID, hand_written, random_places
from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.files.openscenario.write.draft import target
from xosc_lateral.files.openscenario.write.fit import write_converted
from xosc_lateral.workflows.conversion.load import play_scenario
from xosc_lateral.world.motion.nominal import EntityMotion
from xosc_lateral.world.road.network import RoadNetwork

FOLDER = Path(__file__).parents[1] / "data" / "kept"

ROADS = tuple(sorted(path.stem for path in VALID.glob("*.xodr")))
SEEDS = tuple(range(200, 280))
WRITTEN = SEEDS[:24]

TOLERANCE = 2e-6
"""Of numbers that are kept with six digits. [m], [rad], [s]"""


def road_answers(name: str) -> dict[str, Any]:
    """Of a hand-written road: places there and back, what lies beside, where lanes lead."""
    network, rng = hand_written(name), np.random.default_rng(7)
    places = random_places(network, rng, 3, driving=False)
    some = rng.permutation(len(places[0]))[:24]
    road, lane, s, offset = (values[some] for values in places)
    poses, along = network.lane_to_world(road, lane, s, offset), network.road_to_world(road, s, offset)
    aside = 1.7 * offset + 0.3
    back = network.world_to_lane(poses.x - aside * np.sin(poses.heading), poses.y + aside * np.cos(poses.heading),
                                 poses.z, poses.heading)  # fmt: skip
    return {
        "asked": _rows(road, lane, s, offset),
        "poses": _rows(*poses),
        "along": _rows(*along),
        "found": _rows(*back),
        "across": _rows(network.offset_to_t(road, lane, s, offset),
                        network.travel_directions(road, lane) * (offset - network.lane_centre_t(road, lane, s)),
                        network.lane_centre_t(road, lane, s), network.lane_width(road, lane, s)),
        "beside": _rows(*network.lane_index(road, lane, s), network.speed_limit(road, lane, s)),
        "shape": _rows(network.curvature(road, s), network.lane_curvature(road, lane, s, offset),
                       *network.lean(road, lane, s)),
        "sections": [_plain(network.section_at(int(r), float(at))) for r, at in zip(road, s, strict=True)],
        "lanes": [[info.id for info in network.lanes_at(int(r), float(at))] for r, at in zip(road, s, strict=True)],
        "links": list(_links(network)),
        "ways": list(_ways(network, np.stack([road, lane], axis=1).tolist(), s.tolist())),
    }  # fmt: skip


def _links(network: RoadNetwork) -> Iterator[list[Any]]:
    for road, described in enumerate(network.roads):
        for way, section in ((1, described.sections[-1]), (-1, described.sections[0])):
            for lane in section.lanes:
                yield [road, lane.id, way, _plain(network.next_lanes(road, lane.id, way))]


def _ways(network: RoadNetwork, lanes: list[list[int]], s: list[float]) -> Iterator[list[Any]]:
    for number, ((road, lane), at) in enumerate(zip(lanes, s, strict=True)):
        (other, other_lane), there = lanes[number - 1], s[number - 1]
        for way in (1, -1):
            path = network.path_between((road, at), (other, there), direction=way)
            yield [None if path is None else [path.is_turned, *_plain(path)]]
        if lane and other_lane:
            steps = network.route((road, lane, at), (other, other_lane, there))
            yield [None if steps is None else [_plain(step[:4]) for step in steps]]
        for distance in (35.0, -60.0, 400.0):
            if lane:
                yield [_plain(network.advance(road, lane, at, distance))]


@contextmanager
def made_file(seed: int) -> Iterator[Path]:
    """A scenario that is made for the purpose, beside its road."""
    _, road, scenario = made(seed)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "road.xodr").write_text(road, encoding="utf-8")
        (Path(folder) / "made.xosc").write_text(scenario, encoding="utf-8")
        yield Path(folder) / "made.xosc"


def played(seed: int) -> dict[str, Any]:
    """Of a made scenario: where everybody is every three seconds, and when which action ran."""
    with made_file(seed) as path:
        motion = play_scenario(path).motion
    names = ("x", "y", "z", "heading", "pitch", "roll", "speed", "road", "lane", "s", "offset", "heading_relative")
    every = max(1, round(3.0 / motion.step))
    return {
        "entities": {
            one.entity.name: _rows(*(getattr(one, name)[::every] for name in names), one.activity[::every])
            for one in motion.entities
        },
        "actions": [_plain([action.path, action.actor, action.start, action.end]) for action in motion.actions],
    }


def outputs(seed: int) -> dict[str, str]:
    """Of a made scenario whose vehicles swerve: hash of what is written and noted for a target, or why nothing is."""
    hashes = {}
    with made_file(seed) as path:
        scenario, motion = read_scenario(path), play_scenario(path).motion
        swerving = {one.entity.name: _swerving(one) for one in motion.entities}
        ego = {name: swerving[name] for name in list(swerving)[:1]}
        for version in (None, "1.0", "1.1", "1.2", "esmini", "carla"):
            player, number = (version, None) if version in ("esmini", "carla") else ("standard", version)
            words = {"provenance": {}, "summary": "kept", "save": False, "target": target(player, number)}
            for what, paths in (("all", swerving), ("one", ego)):
                try:
                    if what == "all":
                        result = write_converted(scenario, motion, paths, path.with_name("o.xosc"), **words)
                    else:
                        result = write_converted(
                            scenario,
                            motion,
                            paths,
                            path.with_name("o.xosc"),
                            paths=(),
                            **words,
                        )
                except FormatError as error:
                    hashes[f"{version} {what}"] = error.what
                else:
                    noted = "\n".join(map(str, result.notes)).encode()
                    hashes[f"{version} {what}"] = hashlib.sha256(result.data + noted).hexdigest()[:20]
    return hashes


def _swerving(motion: EntityMotion) -> EntityMotion:
    aside = 0.3 * np.sin(motion.time)
    return motion.having(x=motion.x - aside * np.sin(motion.heading), y=motion.y + aside * np.cos(motion.heading))


def _rows(*columns: Any) -> list[list[float | None]]:
    return [[_plain(value) for value in row] for row in np.stack(np.broadcast_arrays(*columns), axis=-1).tolist()]


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return round(value, 6) if np.isfinite(value) else None
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, str | int | None):
        return value
    return [_plain(part) for part in value]


def difference(now: Any, kept: Any, place: str = "") -> str:
    """Where the first number is that is another now; empty: none."""
    if isinstance(now, dict) and isinstance(kept, dict) and now.keys() == kept.keys():
        return next(filter(None, (difference(now[key], kept[key], f"{place}/{key}") for key in now)), "")
    if isinstance(now, list | tuple) and isinstance(kept, list) and len(now) == len(kept):
        pairs = enumerate(zip(now, kept, strict=True))
        return next(filter(None, (difference(*pair, f"{place}/{k}") for k, pair in pairs)), "")
    numbers = all(isinstance(value, int | float) for value in (now, kept))
    same = isclose(now, kept, rel_tol=1e-9, abs_tol=TOLERANCE) if numbers else now == kept
    return "" if same else f"{place}: {now}, kept {kept}"


def kept(name: str) -> dict[str, Any]:
    """Numbers by road or seed."""
    values: dict[str, Any] = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    return values


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    for name, values in (
        ("roads", {road: road_answers(road) for road in ROADS}),
        ("played", {str(seed): played(seed) for seed in SEEDS}),
        ("written", {str(seed): outputs(seed) for seed in WRITTEN}),
    ):
        lines = (f"{json.dumps(key)}: {json.dumps(value, separators=(',', ':'))}" for key, value in values.items())
        (FOLDER / f"{name}.json").write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
