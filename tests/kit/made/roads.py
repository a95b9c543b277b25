"""Roads of many shapes: two lanes or three each way, up to three roads one after another, a junction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tests.kit.made.xml import element

LENGTH = 900.0
"""Of a road that is alone. [m]"""


@dataclass
class Map:
    """A road network and what a scenario has to know of it."""

    roads: list[str]
    lanes: int
    left_hand: bool = False
    length: float = LENGTH  # of road 1 [m]
    ways: tuple[tuple[str, ...], ...] = (("1",),)  # ids of roads that a vehicle can go along from the start

    def xml(self) -> str:
        """The OpenDRIVE file."""
        header = element("header", revMajor=1, revMinor=6, name="made", version="1.00")
        return f'<?xml version="1.0"?>\n<OpenDRIVE>{header}{"".join(self.roads)}</OpenDRIVE>'

    @property
    def along(self) -> int:
        """Sign of the lanes that are driven along s."""
        return 1 if self.left_hand else -1


Pose = tuple[float, float, float]
Piece = tuple[str, float, float, float]  # kind, length, curvature at the beginning and at the end


def plan_view(pieces: list[Piece], start: Pose) -> tuple[str, float, Pose]:
    """Geometry records, their length, and where they end."""
    (x, y, heading), s, written = start, 0.0, []
    for kind, length, first, last in pieces:
        shape = {
            "line": element("line"),
            "arc": element("arc", curvature=f"{first:.9g}"),
            "spiral": element("spiral", curvStart=f"{first:.9g}", curvEnd=f"{last:.9g}"),
        }[kind]
        place = {"s": f"{s:.9g}", "x": f"{x:.12g}", "y": f"{y:.12g}", "hdg": f"{heading:.12g}"}
        written.append(element("geometry", shape, **place, length=f"{length:.9g}"))
        x, y, heading = _end((x, y, heading), length, first, last)
        s += length
    return element("planView", *written), s, (x, y, heading)


def _end(pose: Pose, length: float, first: float, last: float) -> Pose:
    """End of a piece whose curvature is linear (Simpson's rule on 2000 intervals)."""
    x, y, heading = pose
    s = np.linspace(0.0, length, 2001)
    h = heading + first * s + 0.5 * (last - first) / length * s * s
    weights = np.ones(2001)
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    weights *= length / 2000 / 3
    return x + float(weights @ np.cos(h)), y + float(weights @ np.sin(h)), float(h[-1])


def road(
    name: str,
    view: str,
    length: float,
    lanes: int,
    *,
    link: str = "",
    widths: tuple[str, ...] = ('<width sOffset="0" a="3.5" b="0" c="0" d="0"/>',),
    elevation: str = "",
    lateral: str = "",
    offset: str = "",
    rule: str = "RHT",
    junction: str = "-1",
    left: bool = True,
) -> str:
    """A road with lanes both ways, or on its right side alone."""

    def lane(number: int) -> str:
        own = element("link", element("predecessor", id=number), element("successor", id=number))
        return f'<lane id="{number}" type="driving" level="false">{own}{"".join(widths)}</lane>'

    section = (
        f'<laneSection s="0">{element("left", *map(lane, range(lanes, 0, -1))) if left else ""}'
        '<center><lane id="0" type="none" level="false"/></center>'
        f"{element('right', *(lane(-k) for k in range(1, lanes + 1)))}</laneSection>"
    )
    profile = f"<elevationProfile>{elevation}</elevationProfile><lateralProfile>{lateral}</lateralProfile>"
    return (
        f'<road id="{name}" name="{name}" length="{length:.9g}" junction="{junction}" rule="{rule}"><link>{link}</link>'
        f"{view}{profile}<lanes>{offset}{section}</lanes></road>"
    )


def _alone(lanes: int, pieces: list[Piece], **how: object) -> Map:
    view, length, _ = plan_view(pieces, (10.0, -20.0, 0.3))
    left_hand = how.get("rule") == "LHT"
    return Map([road("1", view, length, lanes, **how)], lanes, left_hand, length)  # type: ignore[arg-type]


def _straight(rng: np.random.Generator, lanes: int) -> Map:
    return _alone(lanes, [("line", LENGTH, 0, 0)])


def _left_hand(rng: np.random.Generator, lanes: int) -> Map:
    return _alone(lanes, [("line", LENGTH, 0, 0)], rule="LHT")


def _arc(rng: np.random.Generator, lanes: int) -> Map:
    bend = float(rng.choice([-1, 1]) / rng.uniform(250, 900))
    return _alone(lanes, [("arc", LENGTH, bend, bend)])


def _bends(rng: np.random.Generator, lanes: int) -> Map:
    one, two = (float(side / rng.uniform(150, 600)) for side in (1, -1))
    pieces = [("line", 120, 0, 0), ("spiral", 80, 0, one), ("arc", 150, one, one), ("spiral", 120, one, two)]
    return _alone(lanes, [*pieces, ("arc", 200, two, two), ("spiral", 80, two, 0), ("line", 200, 0, 0)])  # type: ignore[list-item]


def _crest(rng: np.random.Generator, lanes: int) -> Map:
    height = float(rng.uniform(2, 8))
    up, down = (element("elevation", s=s, a=a, b=b, c=c, d=d) for s, a, b, c, d in _hill(height))
    return _alone(lanes, [("line", LENGTH, 0, 0)], elevation=up + down)


def _hill(height: float) -> list[tuple[float, float, float, float, float]]:
    half = 450.0
    c, d = 3 * height / half**2, -2 * height / half**3
    return [(0.0, 0.0, 0.0, _nine(c), _nine(d)), (half, height, 0.0, _nine(-c), _nine(-d))]  # type: ignore[list-item]


def _nine(value: float) -> str:
    return f"{value:.12g}"


def _banked(rng: np.random.Generator, lanes: int) -> Map:
    bend = float(1 / rng.uniform(300, 900))
    tilt = element("superelevation", s=0, a=float(rng.uniform(0.02, 0.08)), b=0, c=0, d=0)
    return _alone(lanes, [("arc", LENGTH, bend, bend)], lateral=tilt)


def _widening(rng: np.random.Generator, lanes: int) -> Map:
    widths = ('<width sOffset="0" a="3" b="0" c="0" d="0"/>', '<width sOffset="150" a="3" b="0.0025" c="0" d="0"/>')
    return _alone(lanes, [("line", LENGTH, 0, 0)], widths=widths)


def _shifted(rng: np.random.Generator, lanes: int) -> Map:
    slope = float(rng.uniform(-0.004, 0.004))
    return _alone(lanes, [("line", LENGTH, 0, 0)], offset=element("laneOffset", s=0, a=0.5, b=slope, c=0, d=0))


def _short(rng: np.random.Generator, lanes: int) -> Map:
    return _alone(lanes, [("line", 330, 0, 0)])


def _ending(rng: np.random.Generator, lanes: int) -> Map:
    """The outermost lane narrows to nothing on the right side, in a lane section of its own."""

    def lane(number: int, *, narrows: bool = False, last: bool = False) -> str:
        width = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'
        if narrows:
            width = '<width sOffset="0" a="3.5" b="0" c="-0.00105" d="0.000007"/>'
        links = "" if last else element("link", element("predecessor", id=number), element("successor", id=number))
        return f'<lane id="{number}" type="driving" level="false">{links}{width}</lane>'

    def section(s: float, right: list[str]) -> str:
        left = element("left", *(lane(k) for k in range(lanes, 0, -1)))
        middle = '<center><lane id="0" type="none" level="false"/></center>'
        return f'<laneSection s="{s}">{left}{middle}{element("right", *right)}</laneSection>'

    inner = [lane(-k) for k in range(1, lanes)]
    sections = section(0, [*inner, lane(-lanes)]) + section(300, [*inner, lane(-lanes, narrows=True, last=True)])
    sections += section(400, inner)
    view, length, _ = plan_view([("line", LENGTH, 0, 0)], (10.0, -20.0, 0.3))
    whole = element("road", "<link/>", view, element("lanes", sections), id=1, length=length, junction=-1, rule="RHT")
    return Map([whole], lanes, False, length)


def _chain(rng: np.random.Generator, lanes: int) -> Map:
    """Three roads one after another; the second is drawn against the way."""
    bend = float(rng.choice([-1, 1]) / rng.uniform(200, 600))
    first, one, end = plan_view([("line", 300, 0, 0)], (10.0, -20.0, 0.3))
    second, two, third_start = plan_view([("arc", 260, bend, bend)], end)
    third, three, _ = plan_view([("line", 400, 0, 0)], third_start)
    roads = [
        road("1", first, one, lanes, link=_link("successor", "2", "start")),
        road("2", second, two, lanes, link=_link("predecessor", "1", "end") + _link("successor", "3", "start")),
        road("3", third, three, lanes, link=_link("predecessor", "2", "end")),
    ]
    return Map(roads, lanes, False, one, (("1", "2", "3"),))


def _link(tag: str, name: str, point: str) -> str:
    return element(tag, elementType="road", elementId=name, contactPoint=point)


def _junction(rng: np.random.Generator, lanes: int) -> Map:
    """Road 1 leads to a junction, from where road 2 goes straight on and road 3 turns off."""
    start = (10.0, -20.0, 0.3)
    first, one, end = plan_view([("line", 250, 0, 0)], start)
    ahead, ahead_length, ahead_end = plan_view([("line", 40, 0, 0)], end)
    bend = float(rng.choice([-1, 1]) / rng.uniform(60, 120))
    aside, aside_length, aside_end = plan_view([("arc", 60, bend, bend)], end)
    second, two, _ = plan_view([("line", 400, 0, 0)], ahead_end)
    third, three, _ = plan_view([("line", 400, 0, 0)], aside_end)
    junction = element("predecessor", elementType="junction", elementId=100)

    def through(name: str, view: str, length: float, to: str) -> str:
        link = _link("predecessor", "1", "end") + _link("successor", to, "start")
        return road(name, view, length, lanes, link=link, junction="100", left=False)

    def connection(number: int, name: str) -> str:
        links = (element("laneLink", **{"from": -k, "to": -k}) for k in range(1, lanes + 1))
        return element("connection", *links, id=number, incomingRoad="1", connectingRoad=name, contactPoint="start")

    roads = [
        road("1", first, one, lanes, link=element("successor", elementType="junction", elementId=100)),
        road("2", second, two, lanes, link=junction),
        road("3", third, three, lanes, link=junction),
        through("4", ahead, ahead_length, "2"),
        through("5", aside, aside_length, "3"),
        element("junction", connection(0, "4"), connection(1, "5"), id=100, name="fork"),
    ]
    return Map(roads, lanes, False, one, (("1", "2"), ("1", "3")))


ROADS: dict[str, Callable[[np.random.Generator, int], Map]] = {
    "straight": _straight,
    "arc": _arc,
    "bends": _bends,
    "crest": _crest,
    "banked": _banked,
    "widening": _widening,
    "shifted": _shifted,
    "short": _short,
    "ending lane": _ending,
    "chain": _chain,
    "junction": _junction,
    "left hand": _left_hand,
}
