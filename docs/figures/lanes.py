"""The picture of docs/playing.md: where lanes lead. `python docs/figures/lanes.py docs/figures/lanes.svg`."""

from __future__ import annotations

import sys

import numpy as np

from xosc_lateral.files.opendrive.reader import parse_opendrive
from xosc_lateral.files.pages.chart import BLUE, MUTED, ORANGE, Panel
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.world.road.lanes import DRIVING
from xosc_lateral.world.road.network import RoadNetwork

WIDTH = 3.5


def lane(number: int, *, kind: str = "driving", closes: bool = False, leads_to: int = 0, comes_from: int = 0) -> str:
    """A lane of 3.5 m; one that closes does so over 100 m."""
    links = f'<predecessor id="{comes_from}"/>' if comes_from else ""
    links += f'<successor id="{leads_to}"/>' if leads_to else ""
    slope = -WIDTH / 100.0 if closes else 0.0
    width = f'<width sOffset="0" a="{WIDTH}" b="{slope}" c="0" d="0"/>'
    return f'<lane id="{number}" type="{kind}"><link>{links}</link>{width}</lane>'


def section(s: float, *lanes: str) -> str:
    """Lanes to the right of the reference line, from s on."""
    return f'<laneSection s="{s}"><center><lane id="0"/></center><right>{"".join(lanes)}</right></laneSection>'


def road(
    name: str, sections: str, link: str, x: float, length: float, *, inside: str = "-1", aside: float = 0.0
) -> str:
    """Along x, by so much aside."""
    across = f'aV="0" bV="0" cV="{3 * aside}" dV="{-2 * aside}"'
    curve = f'<paramPoly3 pRange="normalized" aU="0" bU="{length}" cU="0" dU="0" {across}/>'
    plan = f'<geometry s="0" x="{x}" y="0" hdg="0" length="{length}">{curve}</geometry>'
    about = f'<road id="{name}" length="{length}" junction="{inside}"><link>{link}</link>'
    return f"{about}<planView>{plan}</planView><lanes>{sections}</lanes></road>"


def network(*roads: str) -> RoadNetwork:
    """Of roads and junctions."""
    return parse_opendrive(f'<OpenDRIVE><header revMajor="1" revMinor="6"/>{"".join(roads)}</OpenDRIVE>'.encode(), "")


def entry() -> RoadNetwork:
    """A lane closes, and the shoulder outside of it takes its id."""
    before = section(0.0, lane(-1, leads_to=-1), lane(-2, closes=True), lane(-3, kind="shoulder", leads_to=-2))
    beyond = section(100.0, lane(-1, comes_from=-1), lane(-2, kind="shoulder", comes_from=-3))
    return network(road("1", before + beyond, "", 0.0, 160.0))


def split() -> RoadNetwork:
    """A lane parts into two."""
    one, ends = lane(-1), '<predecessor elementType="road" elementId="1" contactPoint="end"/>'
    ends += '<successor elementType="road" elementId="2" contactPoint="start"/>'
    connections = "".join(
        f'<connection id="{k}" incomingRoad="1" connectingRoad="{k}" contactPoint="start">'
        '<laneLink from="-1" to="-1"/></connection>'
        for k in (10, 11)
    )
    return network(
        road("1", section(0.0, one), '<successor elementType="junction" elementId="9"/>', 0.0, 60.0),
        road("10", section(0.0, lane(-1, comes_from=-1, leads_to=-1)), ends, 60.0, 50.0, inside="9"),
        road("11", section(0.0, lane(-1, comes_from=-1, leads_to=-2)), ends, 60.0, 50.0, inside="9", aside=-WIDTH),
        road("2", section(0.0, one, lane(-2)), '<predecessor elementType="junction" elementId="9"/>', 110.0, 50.0),
        f'<junction id="9" name="">{connections}</junction>',
    )


def draw_lanes(panel: Panel, roads: RoadNetwork) -> None:
    """Their edges."""
    for index, each in enumerate(roads.roads):
        for part in each.sections:
            s = np.linspace(part.start, np.nextafter(part.end, 0.0), 60)
            for one in (*part.lanes, part.centre):
                half = -0.5 * roads.lane_width(index, one.id, s)
                edge = roads.lane_to_world(index, one.id, s, half)
                panel.line(edge.x, edge.y, MUTED, width=0.8)


def picture(path: str) -> None:
    """Left: an entry lane beside a shoulder; right: two routes whose waypoints differ by their lane."""
    figure = Figure(2, height=110.0, legend=True)
    ramp, parting = entry(), split()
    for panel, roads in zip(figure.panels, (ramp, parting), strict=True):
        draw_lanes(panel, roads)
        panel.x.label, panel.y.label = "x [m]", "y [m]"
    onto = ramp.beyond_end(0, 0, -2, 1, -WIDTH, DRIVING)
    assert onto is not None
    parts = [(np.linspace(0.0, 99.9, 60), -2), (np.linspace(onto.s, 160.0, 30), onto.lane)]
    ways = [ramp.lane_to_world(0, number, s, np.zeros(len(s))) for s, number in parts]
    x, y = (np.concatenate([getattr(way, axis) for way in ways]) for axis in ("x", "y"))
    figure.panels[0].line(x, y, ORANGE, width=2.0, label="a car in the entry lane")
    for wanted, colour in ((-1, BLUE), (-2, ORANGE)):
        route = parting.route((0, -1, 5.0), (3, wanted, 45.0))
        assert route is not None
        number, pieces = -1, []
        for step in route:
            number = step.links[0].lane if step.links else number
            s = np.linspace(step.s_start, step.s_end, 40)
            pieces.append(parting.lane_to_world(step.road, number, s, np.zeros(len(s))))
        x, y = (np.concatenate([getattr(piece, axis) for piece in pieces]) for axis in ("x", "y"))
        figure.panels[1].line(x, y, colour, width=2.0, label=f"waypoint in lane {wanted}")
    figure.save(path)


if __name__ == "__main__":
    picture(sys.argv[1])
