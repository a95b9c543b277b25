"""Range of vision: how often a vehicle's sensor sees the car before the car ahead, and how far along its lane."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IndexArray
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.texts import aligned
from xosc_lateral.extras.detect.scoring import INTERVAL_SHARES, RESAMPLES, plain
from xosc_lateral.extras.detect.sources import Source, checked
from xosc_lateral.extras.detect.tracks import STEP, LaneTrack, Rows, Scene
from xosc_lateral.files.pages.chart import color_of
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.files.pages.page import Page
from xosc_lateral.files.source import parsed_hashes
from xosc_lateral.workflows.result import PathLike, Result, write_page


# ---- what a ray meets first among boxes seen from above, how much of a box is seen past the others ----
class Boxes(NamedTuple):
    """Rectangles in the plane: centres, headings and sizes; shape (n,) each. [m], [rad]"""

    x: FloatArray
    y: FloatArray
    heading: FloatArray
    length: FloatArray
    width: FloatArray

    def at(self, rows: IndexArray | BoolArray) -> Boxes:
        """Some of them."""
        return Boxes(*(values[rows] for values in self))

    def corners(self) -> FloatArray:
        """Shape (n, 4, 2)."""
        along = 0.5 * self.length[:, None] * np.array([1.0, 1.0, -1.0, -1.0])
        left = 0.5 * self.width[:, None] * np.array([1.0, -1.0, -1.0, 1.0])
        cos, sin = np.cos(self.heading)[:, None], np.sin(self.heading)[:, None]
        return np.stack(
            [self.x[:, None] + along * cos - left * sin, self.y[:, None] + along * sin + left * cos], axis=-1
        )


def ray_distances(origin: FloatArray, bearings: FloatArray, boxes: Boxes) -> FloatArray:
    """From a point (2,) along m bearings to each of n boxes, shape (n, m); infinite where a ray misses. [m], [rad]"""
    dx, dy = origin[0] - boxes.x, origin[1] - boxes.y
    cos, sin = np.cos(boxes.heading), np.sin(boxes.heading)
    turned = bearings[None, :] - boxes.heading[:, None]
    start = np.stack([dx * cos + dy * sin, dy * cos - dx * sin])[:, :, None]
    way = np.stack([np.cos(turned), np.sin(turned)])
    half = 0.5 * np.stack([boxes.length, boxes.width])[:, :, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        lower, upper = (-half - start) / way, (half - start) / way
        enters = np.nanmax(np.minimum(lower, upper), axis=0)
        leaves = np.nanmin(np.maximum(lower, upper), axis=0)
    return np.where((enters <= leaves) & (enters > 0.0), enters, np.inf)


def visible_share(origin: FloatArray, boxes: Boxes, target: int) -> float:
    """Share of the angle that a box takes, seen from a point (2,), that no other box is before.

    Between the bearings of neighbouring corners one box is the nearest throughout: a ray between them tells which, so
    that the share is exact for boxes that do not overlap.
    """
    away = boxes.corners() - origin
    towards = np.arctan2(boxes.y[target] - origin[1], boxes.x[target] - origin[0])
    bearing = np.arctan2(away[..., 1], away[..., 0]) - towards
    bearing = (bearing + np.pi) % (2.0 * np.pi) - np.pi
    first, last = float(bearing[target].min()), float(bearing[target].max())
    inner = bearing[(bearing > first) & (bearing < last)]
    edges = np.unique(np.concatenate([[first], inner, [last]]))
    rays = 0.5 * (edges[1:] + edges[:-1])
    nearest = ray_distances(origin, towards + rays, boxes).argmin(axis=0)
    return float(np.diff(edges)[nearest == target].sum() / (last - first))


def points_seen(origin: FloatArray, points: FloatArray, boxes: Boxes) -> BoolArray:
    """Which of m points (m, 2) no box is before, seen from a point (2,); shape (m,)."""
    away = points - origin
    hits = ray_distances(origin, np.arctan2(away[:, 1], away[:, 0]), boxes).min(axis=0, initial=np.inf)
    return np.asarray(hits >= np.hypot(away[:, 0], away[:, 1]))


# ---- moments behind two cars ----
SENSORS: Mapping[str, tuple[float, float]] = {"LiDAR, 30 to 110 m": (30.0, 110.0), "camera, to 200 m": (0.0, 200.0)}
"""Distances from the observer's front to the second vehicle's rear at which a moment counts; both sensors are at the
middle of the observer's front. [m]"""
MOMENT_ROWS = round(1.0 / STEP)
"""Between moments that are looked at. [rows]"""
LANE_STEP = 1.0
"""Between points of the lane's centre. [m]"""
BAND = 20.0
"""Of the figure's distances. [m]"""
HEADINGS = ("source", "sensor", "moments", "second car seen", "its width seen", "lane seen [m]", "car ahead at [m]")


@dataclass(frozen=True, slots=True)
class SightMoment:
    """A vehicle behind two others in its lane."""

    cluster: str  # of the observer
    distance: float  # from its front to the second one's rear [m]
    gap: float  # to the first one's rear [m]
    share: float  # of the second one's width, as an angle, that is seen
    lane: float  # of the lane's centre up to the second one that is seen [m]


def moments_of(scene: Scene) -> Iterator[SightMoment]:
    """Of every vehicle, or of the ego alone, at every whole second."""
    if not all({"x", "line"} <= track.columns.keys() for track in scene.tracks):
        return
    first = min((track.first for track in scene.tracks), default=0)
    last = max((track.first + len(track) for track in scene.tracks), default=0)
    farthest = max(far for _, far in SENSORS.values())
    rows = Rows(scene) if len(scene.tracks) > 2 else None
    for instant in range(first + -first % MOMENT_ROWS, last, MOMENT_ROWS):
        there = [track for track in scene.tracks if track.first <= instant < track.first + len(track)]
        if rows is None or len(there) < 3:
            continue
        state = np.array([_state(track, instant - track.first) for track in there]).T
        boxes, x, y, heading, offset, along = Boxes(*state[:5]), *state[5:]
        row_of = [rows.begin[k] + instant - track.first for k, track in enumerate(scene.tracks) if track in there]
        for number, track in enumerate(there):
            if scene.ego not in (None, track.name):
                continue
            cos, sin = np.cos(heading[number]), np.sin(heading[number])
            dx, dy = boxes.x - boxes.x[number], boxes.y - boxes.y[number]
            ahead = dx * cos + dy * sin
            next_row = rows.ahead(row_of[number])
            second_row = rows.ahead(next_row) if next_row >= 0 else -1
            if second_row < 0:
                continue
            in_lane = np.array([row_of.index(next_row), row_of.index(second_row)])
            gap, distance = ahead[in_lane] - 0.5 * (boxes.length[in_lane] + boxes.length[number])
            if distance > farthest or gap <= 0.0:
                continue
            half = 0.5 * boxes.length[number]
            sensor = np.array([boxes.x[number] + half * cos, boxes.y[number] + half * sin])
            others = np.flatnonzero((np.arange(len(there)) != number) & (np.hypot(dx, dy) < farthest + 50.0))
            seen = boxes.at(others)
            share = visible_share(sensor, seen, int(np.searchsorted(others, in_lane[1])))
            centre = _lane_centre([number, *in_lane.tolist()], x, y, offset, along)
            centre = centre[(centre - sensor) @ np.array([cos, sin]) > 0.0]
            visible = points_seen(sensor, centre, seen)
            yield SightMoment(track.cluster, float(distance), float(gap), share, LANE_STEP * float(visible.sum()))


def _state(track: LaneTrack, row: int) -> list[float]:
    heading, box = float(track.heading[row]), track.box
    cos, sin = np.cos(heading), np.sin(heading)
    x, y = float(track.x[row]), float(track.y[row])
    relative = float(track.heading_relative[row]) if "heading_relative" in track.columns else 0.0
    middle = x + box.center_x * cos - box.center_y * sin, y + box.center_x * sin + box.center_y * cos
    along = heading - relative
    return [
        *middle, heading, box.length, box.width, x, y, heading, float(track.offset[row]), along,
    ]  # fmt: skip


def _lane_centre(
    rows: Sequence[int], x: FloatArray, y: FloatArray, offset: FloatArray, along: FloatArray
) -> FloatArray:
    """Points `LANE_STEP` apart from the first vehicle's lane centre to the last one's, shape (m, 2).

    Cubic Hermite pieces through the lane centres at the vehicles, in the lane's direction there.
    """
    pieces = []
    for row, other in pairwise(rows):
        ends = [
            np.array([x[k] + offset[k] * np.sin(along[k]), y[k] - offset[k] * np.cos(along[k])]) for k in (row, other)
        ]
        chord = float(np.hypot(*(ends[1] - ends[0])))
        ways = [chord * np.array([np.cos(along[k]), np.sin(along[k])]) for k in (row, other)]
        u = np.arange(0.0, chord, LANE_STEP)[:, None] / max(chord, LANE_STEP)
        pieces.append(
            (2 * u**3 - 3 * u**2 + 1) * ends[0] + (u**3 - 2 * u**2 + u) * ways[0]
            + (3 * u**2 - 2 * u**3) * ends[1] + (u**3 - u**2) * ways[1]
        )  # fmt: skip
    return np.concatenate(pieces)


@dataclass(frozen=True, eq=False, repr=False)
class Sight(Result):
    """What sensors see past the car ahead, by source."""

    usual_table = "detection.csv"
    moments: Mapping[str, Sequence[SightMoment]]  # label of the source -> moments
    origins: Sequence[Source]
    seed: int
    files: Sequence[Path]  # that must not be overwritten

    def headline(self) -> str:
        """See `Result`."""
        count = sum(map(len, self.moments.values()))
        return f"{count} moments behind two cars in {len(self.moments)} sources"

    def legend(self) -> list[str]:
        """What the numbers count."""
        return [
            "Every second of every vehicle that has two others ahead in its lane (with an ego: of the ego). Boxes seen "
            "from above, the sensor at the middle of the front. Second car seen: any part of it. Its width seen: share "
            "of its angle, mean. Lane seen: metres of the lane's centre up to the second car, median. Intervals: 95 %, "
            "by vehicles drawn anew."
        ]

    def __str__(self) -> str:
        return "\n".join([self.headline(), "", *aligned([HEADINGS, *map(_cells, self.rows())]), "", *self.legend()])

    def rows(self) -> list[dict[str, Any]]:
        """A row for each source and sensor. Shares, [m]"""
        return [
            {"source": source, "sensor": sensor, **_summary([one for one in moments if near <= one.distance <= far])}
            for source, moments in self.moments.items()
            for sensor, (near, far) in SENSORS.items()
        ]

    def bands(self) -> list[dict[str, Any]]:
        """Share of moments at which the second car is seen by its distance, for each source."""
        bands = []
        for source, moments in self.moments.items():
            number = np.array([one.distance // BAND for one in moments])
            seen = np.array([one.share > 0.0 for one in moments])
            for band in np.unique(number).tolist():
                inside = number == band
                bands.append({
                    "source": source, "from": BAND * band, "to": BAND * (band + 1.0), "moments": int(inside.sum()),
                    "second_seen": round(float(seen[inside].mean()), 6),
                })  # fmt: skip
        return bands

    def to_frame(self) -> pd.DataFrame:
        """One row per source and sensor."""
        return pd.DataFrame(self.rows())

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        sources = [{"label": one.label, "files": [path.name for path in one.files]} for one in self.origins]
        return {
            "sources": sources,
            "sight": plain(self.rows()),
            "bands": self.bands(),
            "provenance": self._provenance(),
        }

    def _provenance(self) -> dict[str, Any]:
        """Seed and hashes of all inputs."""
        files = [path for source in self.origins for path in source.files if path.is_file()]
        return {"seed": self.seed, "inputs": parsed_hashes(files)}

    def plot(self) -> Figure:
        """Share of moments at which the second car is seen, by its distance."""
        figure = Figure(1, 1, height=170.0, legend=True)
        panel = figure.row(0)[0]
        panel.x.label, panel.y.label = "distance to the car before the car ahead [m]", "moments at which it is seen [%]"
        panel.y.limits = (0.0, 100.0)
        bands = self.bands()
        for number, source in enumerate(self.moments):
            shown = [band for band in bands if band["source"] == source]
            middle = np.array([band["from"] + 0.5 * BAND for band in shown])
            panel.line(
                middle, np.array([100.0 * band["second_seen"] for band in shown]), color_of(number), label=source
            )
        return figure

    def write_report(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the HTML page: table and figure."""
        page = Page("Range of vision")
        page.lead(f"{self.headline()}.", *self.legend())
        page.section("Table")
        page.table([dict(zip(HEADINGS, _cells(row), strict=True)) for row in self.rows()], "In brackets 95 % intervals")
        page.section("By distance")
        page.figure(self.plot(), "How often any part of the car before the car ahead is seen")
        html = partial(page.html, self._provenance())
        return write_page(path, "detection.html", html, inputs=self.files, force=force)


def sight_of(sources: Sequence[Source], seed: int, files: Sequence[Path]) -> Sight:
    """Look at every source; raises `NotEnoughDataError` where none has a vehicle behind two others."""
    moments = {
        source.label: [moment for scene in checked(source) for moment in moments_of(scene)] for source in sources
    }
    if not any(moments.values()):
        names = ", ".join(moments)
        raise NotEnoughDataError(f"{names}: no vehicle has two others ahead in its lane, in places that are known")
    return Sight(moments, sources, seed, files)


def _summary(moments: Sequence[SightMoment]) -> dict[str, Any]:
    shares = np.array([one.share for one in moments])
    names, number = np.unique([one.cluster for one in moments], return_inverse=True)
    low = high = np.nan
    if len(names) > 1:
        count, seen = (np.bincount(number, weights=weights) for weights in (np.ones(len(shares)), shares > 0.0))
        k = len(names)
        drawn = np.random.default_rng(k).multinomial(k, np.full(k, 1.0 / k), size=RESAMPLES)
        low, high = np.quantile((drawn @ seen) / (drawn @ count), INTERVAL_SHARES)
    nothing = not len(shares)
    return {
        "vehicles": len(names), "moments": len(shares),
        "second_seen": np.nan if nothing else float((shares > 0.0).mean()),
        "second_seen_low": float(low), "second_seen_high": float(high),
        "width_seen": np.nan if nothing else float(shares.mean()),
        "lane_seen": np.nan if nothing else float(np.median([one.lane for one in moments])),
        "gap": np.nan if nothing else float(np.median([one.gap for one in moments])),
    }  # fmt: skip


def _cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    if not row["moments"]:
        return row["source"], row["sensor"], "0", "-", "-", "-", "-"
    low, high = row["second_seen_low"], row["second_seen_high"]
    between = "" if np.isnan(low) else f" ({low:.0%} to {high:.0%})"
    numbers = f"{row['second_seen']:.0%}{between}", f"{row['width_seen']:.0%}"
    return row["source"], row["sensor"], str(row["moments"]), *numbers, f"{row['lane_seen']:.0f}", f"{row['gap']:.0f}"
