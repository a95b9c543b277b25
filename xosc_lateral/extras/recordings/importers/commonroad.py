"""CommonRoad scenarios [1]_ into the standard drive table, through commonroad-io (extra `commonroad`).

Recorded obstacles are placed between the bounds of their lanelets: the offset counts from the middle of the two bounds,
the lane width is their distance.

References
----------
.. [1] M. Althoff, M. Koschi, S. Manzinger, "CommonRoad: composable benchmarks for motion planning on roads", IV 2017.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.base.vehicle_classes import class_of
from xosc_lateral.extras.recordings.cuts import DEFAULT_CUTS, CutSettings
from xosc_lateral.extras.recordings.importers import ImportedDrives, import_each, importer, paths_of
from xosc_lateral.extras.recordings.importers.track_table import Tracks, tracks_of_rows
from xosc_lateral.extras.recordings.importers.tracks import (
    LaneShape,
    curvature_along,
    graph_of_shapes,
    import_placed,
    place_in_shapes,
    require_lanes,
)
from xosc_lateral.extras.recordings.lane_order import LaneGraph
from xosc_lateral.files.apart import apart
from xosc_lateral.files.tables import foreign_errors
from xosc_lateral.files.xml import read_xml, root_tag

LICENCE = "that of the CommonRoad scenario and of the recording that it was made from"


@importer
def import_commonroad(sources: Path | Sequence[Path], settings: CutSettings = DEFAULT_CUTS) -> ImportedDrives:
    """CommonRoad scenarios (extra `commonroad`): recorded obstacles between the bounds of their lanelets."""

    def read(path: Path, label: str) -> ImportedDrives:
        tracks, shapes, graph, version = read_obstacles(path, label)
        placed = place_in_shapes(tracks, shapes, graph.left)
        require_lanes(placed, "its lanelets", path)
        about = {"format": "commonroad", "version": version, "licence": LICENCE}
        return import_placed(placed, graph, settings, sources=[path], **about)

    return import_each(paths_of(sources), read)


@apart
def read_obstacles(path: Path, label: str) -> tuple[Tracks, list[_Lanelet], LaneGraph, str]:
    """All obstacles that move along a recorded trajectory, lanes, and the scenario's id."""
    scenario = _opened(path)
    lanelets = scenario.lanelet_network.lanelets
    numbers = {lanelet.lanelet_id: k for k, lanelet in enumerate(lanelets)}
    shapes = [_Lanelet(lanelet) for lanelet in lanelets]
    beside = [lanelet.adj_left if lanelet.adj_left_same_direction else None for lanelet in lanelets]
    left = np.array([numbers.get(name, -1) for name in beside], dtype=int)
    following = [[numbers[name] for name in lanelet.successor if name in numbers] for lanelet in lanelets]
    version = str(getattr(scenario, "scenario_id", "unknown"))
    return _tracks(scenario, path, label), shapes, graph_of_shapes(shapes, left, following), version


def _opened(path: Path) -> Any:
    if (tag := root_tag(path)) != "commonRoad":
        what = f"its root element is {tag!r}" if tag else "it is no XML"
        raise FormatError(f"not a CommonRoad scenario: {what}", path=path)
    try:
        from commonroad.common.file_reader import CommonRoadFileReader
    except ImportError as error:
        what = "reading CommonRoad needs commonroad-io: pip install 'xosc-lateral[commonroad]'"
        raise FormatError(what, path=path) from error
    except TypeError as error:  # what its generated code raises under another protobuf
        what = "commonroad-io needs protobuf 3.20, the extra `osi` a later one: use an environment for each"
        raise FormatError(what, path=path) from error
    read_xml(path)  # no entities, and no larger than ours may be
    with foreign_errors(path, "not a CommonRoad scenario that commonroad-io can read"):
        return CommonRoadFileReader(str(path)).open()[0]


def _tracks(scenario: Any, path: Path, label: str) -> Tracks:
    names: list[str] = []
    rows: list[tuple[float, ...]] = []
    lengths: list[float] = []
    kinds: list[str] = []
    for obstacle in scenario.dynamic_obstacles:
        trajectory = getattr(obstacle.prediction, "trajectory", None)
        if trajectory is None:
            continue
        for state in [obstacle.initial_state, *trajectory.state_list]:
            position = np.asarray(getattr(state, "position", np.nan), dtype=object)
            if position.shape == (2,):
                speed = getattr(state, "velocity", np.nan)
                rows.append((len(names), state.time_step, *position, getattr(state, "orientation", np.nan), speed))
        names.append(f"{label}:{obstacle.obstacle_id}")
        lengths.append(float(getattr(obstacle.obstacle_shape, "length", 4.6)))
        kinds.append(class_of(obstacle.obstacle_type.value) or "")
    if len(rows) < 2:
        raise NotEnoughDataError(f"{path}: no obstacle with a recorded trajectory")
    vehicle, step, x, y, heading, speed = np.array(rows, dtype=np.float64).T
    whose = vehicle.astype(np.int64)
    return tracks_of_rows(
        names, whose,
        {"time": float(scenario.dt) * step, "x": x, "y": y, "heading": heading, "speed": speed,
         "length": np.array(lengths)[whose], "kind": np.array(kinds)[whose]},
        path, step=float(scenario.dt),
    )[0]  # fmt: skip


class _Lanelet(LaneShape):
    """A lane whose bounds have as many points each, which face each other."""

    def __init__(self, lanelet: Any) -> None:
        left = np.asarray(lanelet.left_vertices, dtype=np.float64)[:, :2]
        right = np.asarray(lanelet.right_vertices, dtype=np.float64)[:, :2]
        super().__init__(0.5 * (left + right), [left, right])

    def place(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, ...]:
        """See `LaneShape`."""
        points = np.stack([x, y], axis=1)
        about = points[:, None] - self.centre[None, :-1]
        size2 = np.maximum(self.size**2, 1e-12)
        share = np.clip((about * self.step).sum(axis=2) / size2, 0.0, 1.0)
        away = ((about - share[:, :, None] * self.step) ** 2).sum(axis=2)
        k = away.argmin(axis=1)
        rows = np.arange(len(x))
        u = share[rows, k][:, None]
        left = self.left[k] + u * (self.left[k + 1] - self.left[k])
        right = self.right[k] + u * (self.right[k + 1] - self.right[k])
        direction = self.direction[k]
        normal = np.stack([-np.sin(direction), np.cos(direction)], axis=1)
        middle = 0.5 * (left + right)
        offset = ((points - middle) * normal).sum(axis=1)
        width = ((left - right) * normal).sum(axis=1)
        way = self.start[k] + u[:, 0] * self.size[k]
        before = (k == 0) & ((points - self.centre[0]) @ self.step[0] < 0)
        past = (k == len(self.size) - 1) & ((points - self.centre[-1]) @ self.step[-1] > 0)
        curvature = curvature_along(self.start, self.direction, way)
        return np.where(before | past, np.nan, way), offset, width, direction, curvature
