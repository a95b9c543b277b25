"""Roads as OpenDRIVE text, with the ways on which vehicles are put.

A road is `{"kind": name, ...numbers}`; `build` makes `(text, ways, is_junction)`. A way is a list of stretches
`(road, lanes from the inside, +1 with s or -1 against it, from s, length)`: what a car that just drives goes along.
"""

from __future__ import annotations

import math

KINDS = {}
ARM = 120.0  # of crossings and roundabouts: short, so that their cars get there [m]


def kind(function):
    KINDS[function.__name__] = function
    return function


def lane(number, width, link="", more=""):
    widths = more or f'<width sOffset="0" a="{width}" b="0" c="0" d="0"/>'
    mark = '<roadMark sOffset="0" type="broken" weight="standard" color="standard" width="0.12"/>'
    return f'<lane id="{number}" type="driving" level="false"><link>{link}</link>{widths}{mark}</lane>'


def links(before=None, after=None):
    ends = (("predecessor", before), ("successor", after))
    return "".join(f'<{name} id="{number}"/>' for name, number in ends if number is not None)


def section(s, left, right):
    sides = (
        "<left>" + "".join(left) + "</left>" if left else "",
        "<right>" + "".join(right) + "</right>" if right else "",
    )
    return (
        f'<laneSection s="{s}">{sides[0]}<center><lane id="0" type="none" level="false"/></center>'
        f"{sides[1]}</laneSection>"
    )


def arcs(start, parts):
    """Geometry of (length, curvature) parts, and where it ends."""
    x, y, h = start
    text, s = "", 0.0
    for length, c in parts:
        shape = f'<arc curvature="{c}"/>' if c else "<line/>"
        text += f'<geometry s="{s}" x="{x:.9f}" y="{y:.9f}" hdg="{h:.12f}" length="{length}">{shape}</geometry>'
        if c:
            x, y, h = (
                x + (math.sin(h + c * length) - math.sin(h)) / c,
                y + (math.cos(h) - math.cos(h + c * length)) / c,
                h + c * length,
            )
        else:
            x, y = x + length * math.cos(h), y + length * math.sin(h)
        s += length
    return text, s, (x, y, h)


def bezier(p0, h0, p1, h1):
    """A smooth way from one pose to another."""
    dx, dy = p1[0] - p0[0], p1[1] - p0[1]
    m = math.hypot(dx, dy) * 1.1
    u, v, a = dx * math.cos(h0) + dy * math.sin(h0), dy * math.cos(h0) - dx * math.sin(h0), h1 - h0
    U, V = (
        (0, t0, 3 * e - 2 * t0 - t1, t0 + t1 - 2 * e)
        for e, t0, t1 in ((u, m, m * math.cos(a)), (v, 0, m * math.sin(a)))
    )
    n = 2000
    length = (
        sum(
            math.hypot(*(c[1] + 2 * c[2] * p + 3 * c[3] * p * p for c in (U, V)))
            for p in ((k + 0.5) / n for k in range(n))
        )
        / n
    )
    numbers = " ".join(
        f'{x}{axis}="{value:.12g}"' for axis, c in (("U", U), ("V", V)) for x, value in zip("abcd", c, strict=True)
    )
    shape = f'<paramPoly3 pRange="normalized" {numbers}/>'
    return (
        f'<geometry s="0" x="{p0[0]:.9f}" y="{p0[1]:.9f}" hdg="{h0:.12f}" length="{length:.9f}">{shape}</geometry>',
        length,
    )


def road(number, geometry, length, sections, link="", junction=-1, rule="RHT", elevation="", lateral=""):
    return (
        f'<road name="r{number}" length="{length:.9f}" id="{number}" junction="{junction}" rule="{rule}">'
        f"<link>{link}</link>"
        f"<planView>{geometry}</planView><elevationProfile>{elevation}</elevationProfile><lateralProfile>"
        f"{lateral}</lateralProfile>"
        f"<lanes>{sections}</lanes></road>"
    )


def end(what, to, number, contact=""):
    point = f' contactPoint="{contact}"' if contact else ""
    return f'<{what} elementType="{to}" elementId="{number}"{point}/>'


def whole(parts):
    header = '<header revMajor="1" revMinor="6" name="" version="1" date="2026" north="0" south="0" east="0" west="0"/>'
    return f'<?xml version="1.0" encoding="UTF-8"?><OpenDRIVE>{header}{"".join(parts)}</OpenDRIVE>'


def both_ways(number, length, n, left):
    """Ways of a road with n lanes each way, in right-hand or left-hand traffic."""
    one, other = list(range(-1, -n - 1, -1)), list(range(1, n + 1))
    return [[(number, other if left else one, 1, 0.0, length)], [(number, one if left else other, -1, 0.0, length)]]


@kind
def plain(r):
    """Straight, or with bends of `radius`, up and down by `slope`, tilted, in left-hand traffic."""
    n, w, radius, slope, left = r["lanes"], r["width"], r.get("radius"), r.get("slope"), r.get("left", False)
    parts = (
        [(3000.0, 0)] if not radius else [(150.0, 0)] + [(200.0, (-1) ** k / radius) for k in range(6)] + [(1500.0, 0)]
    )
    geometry, length, _ = arcs((0, 0, 0), parts)
    elevation, z, before = "", 0.0, 0.0
    for k in range(10 if slope else 0):
        after = slope if k % 2 == 0 else -slope
        c = (after - before) / 600.0
        elevation += f'<elevation s="{300 * k}" a="{z}" b="{before}" c="{c}" d="0"/>'
        z, before = z + before * 300 + c * 90000, after
    tilt = f'<superelevation s="0" a="{r["tilt"]}" b="0" c="0" d="0"/>' if r.get("tilt") else ""
    lanes = section(0, [lane(i, w) for i in range(n, 0, -1)], [lane(-i, w) for i in range(1, n + 1)])
    rule = "LHT" if left else "RHT"
    return (
        whole([road(0, geometry, length, lanes, rule=rule, elevation=elevation, lateral=tilt)]),
        both_ways(0, length, n, left),
        False,
    )


@kind
def opposite(r):
    """Three roads in a row; s of the middle one runs against the others."""
    n, w, L = r["lanes"], r["width"], r["length"]
    ids = list(range(1, n + 1))

    def lanes(before, after):
        return section(
            0,
            [lane(i, w, links(before and before * i, after and after * i)) for i in ids[::-1]],
            [lane(-i, w, links(before and -before * i, after and -after * i)) for i in ids],
        )

    first, middle, last = (
        arcs((0, 0, 0), [(L, 0)]),
        arcs((2 * L, 0, math.pi), [(L, 0)]),
        arcs((2 * L, 0, 0), [(2500.0, 0)]),
    )
    parts = [
        road(0, *first[:2], lanes(None, -1), end("successor", "road", 1, "end")),
        road(
            1, *middle[:2], lanes(-1, -1), end("predecessor", "road", 2, "start") + end("successor", "road", 0, "end")
        ),
        road(2, *last[:2], lanes(-1, None), end("predecessor", "road", 1, "start")),
    ]
    down = [-i for i in ids]
    return (
        whole(parts),
        [
            [(0, down, 1, 0.0, L), (1, ids, -1, 0.0, L), (2, down, 1, 0.0, 2500.0)],
            [(2, ids, -1, 0.0, 2500.0), (1, down, 1, 0.0, L), (0, ids, -1, 0.0, L)],
        ],
        False,
    )


@kind
def taper(r):
    """The outermost lane begins, or ends, at `at`; or both (a ramp)."""
    n, w, at, long = r["lanes"], r["width"], r["at"], 100.0
    gone = f'<width sOffset="0" a="{w}" b="0" c="{-3 * w / long**2}" d="{2 * w / long**3}"/>'
    come = f'<width sOffset="0" a="0" b="0" c="{3 * w / long**2}" d="{-2 * w / long**3}"/>'
    steps = {
        "drop": [n, (n, gone), n - 1],
        "add": [n - 1, (n, come), n],
        "ramp": [n - 1, (n, come), n, (n, gone), n - 1],
    }[r["what"]]
    counts = [s if isinstance(s, int) else s[0] for s in steps]
    begins = {3: [0, at, at + long], 5: [0, at, at + long, at + 350, at + 350 + long]}[len(steps)]
    text = ""
    for k, (s, count) in enumerate(zip(begins, counts, strict=True)):
        before, after = counts[k - 1] if k else 0, counts[k + 1] if k + 1 < len(counts) else 0
        text += section(
            s,
            [],
            [
                lane(
                    -i,
                    w,
                    links(-i if i <= before else None, -i if i <= after else None),
                    steps[k][1] if i == n and not isinstance(steps[k], int) else "",
                )
                for i in range(1, count + 1)
            ],
        )
    geometry, length, _ = arcs((0, 0, 0), [(3000.0, 0)])
    return (
        whole([road(0, geometry, length, text)]),
        [
            [
                (
                    0,
                    list(range(-1, -counts[0] - 1, -1)),
                    1,
                    0.0,
                    at + (long if counts[0] < n else 0) if r["what"] == "drop" else length,
                )
            ]
        ],
        False,
    )


@kind
def crossing(r):
    """Four arms of two lanes; from each one goes on, or turns."""
    w, gap, L = r["width"], r["gap"], ARM
    parts, lines, ways, number = [], "", [], 10
    for k in range(4):
        h = k * math.pi / 2
        geometry, _, _ = arcs((gap * math.cos(h), gap * math.sin(h), h), [(L, 0)])
        parts.append(road(k, geometry, L, section(0, [lane(1, w)], [lane(-1, w)]), end("predecessor", "junction", 100)))
    for a in range(4):
        for turn in (1, 2, 3):
            b, ha = (a + turn) % 4, a * math.pi / 2
            hb = ha + turn * math.pi / 2
            p0, p1 = ((gap * math.cos(h), gap * math.sin(h)) for h in (ha, hb))
            angle = ha + math.pi + {1: -math.pi / 2, 2: 0.0, 3: math.pi / 2}[turn]
            geometry, length = bezier(p0, ha + math.pi, p1, angle)
            parts.append(
                road(
                    number,
                    geometry,
                    length,
                    section(0, [], [lane(-1, w, links(1, -1))]),
                    end("predecessor", "road", a, "start") + end("successor", "road", b, "start"),
                    100,
                )
            )
            lines += (
                f'<connection id="{number}" incomingRoad="{a}" connectingRoad="{number}" contactPoint="start">'
                '<laneLink from="1" to="-1"/></connection>'
            )
            ways.append([(a, [1], -1, 0.0, L), (number, [-1], 1, 0.0, length), (b, [-1], 1, 0.0, L)])
            number += 1
    order = {2: 0, 1: 1, 3: 2}
    ways = sorted(ways, key=lambda way: (way[0][0], order[(way[2][0] - way[0][0]) % 4]))
    return whole([*parts, f'<junction id="100" name="j">{lines}</junction>']), ways, True


@kind
def roundabout(r):
    """A ring with arms on two sides."""
    R, w = r["radius"], 3.5

    def ring(number, a0, a1, junction, before, after):
        a, h = math.radians(a0), math.radians(a0 + 90)
        geometry, length, _ = arcs((R * math.cos(a), R * math.sin(a), h), [(R * math.radians(a1 - a0), 1 / R)])
        return road(
            number, geometry, length, section(0, [], [lane(-1, w, links(-1, -1))]), before + after, junction
        ), length

    def link(number, p0, h0, p1, h1, junction, before, after, l0, l1):
        geometry, length = bezier(p0, math.radians(h0), p1, math.radians(h1))
        return road(
            number, geometry, length, section(0, [], [lane(-1, w, links(l0, l1))]), before + after, junction
        ), length

    at = lambda a: (R * math.cos(math.radians(a)), R * math.sin(math.radians(a)))  # noqa: E731
    P, S = (lambda *x: end("predecessor", *x)), (lambda *x: end("successor", *x))
    arm = section(0, [lane(1, w)], [lane(-1, w)])
    east, west = arcs((2 * R, 0, 0), [(ARM, 0)]), arcs((-2 * R - ARM, 0, 0), [(ARM, 0)])
    made = {
        3: ring(3, 200, 340, -1, P("junction", 100), S("junction", 101)),
        4: ring(4, 20, 160, -1, P("junction", 101), S("junction", 100)),
        10: ring(10, 160, 200, 100, P("road", 4, "end"), S("road", 3, "start")),
        13: ring(13, -20, 20, 101, P("road", 3, "end"), S("road", 4, "start")),
        11: link(11, (-2 * R, 0), 0, at(200), -70, 100, P("road", 1, "end"), S("road", 3, "start"), -1, -1),
        12: link(12, at(160), 250, (-2 * R, 0), 180, 100, P("road", 4, "end"), S("road", 1, "end"), -1, 1),
        14: link(14, at(340), 70, (2 * R, 0), 0, 101, P("road", 3, "end"), S("road", 2, "start"), -1, -1),
        15: link(15, (2 * R, 0), 180, at(20), 110, 101, P("road", 2, "start"), S("road", 4, "start"), 1, -1),
    }

    def junction(number, rows):
        return (
            f'<junction id="{number}" name="j{number}">'
            + "".join(
                f'<connection id="{k}" incomingRoad="{a}" connectingRoad="{b}" contactPoint="start"><laneLink '
                f'from="{inside}" to="-1"/></connection>'
                for k, (a, b, inside) in enumerate(rows)
            )
            + "</junction>"
        )

    parts = [
        road(1, *west[:2], arm, S("junction", 100)),
        road(2, *east[:2], arm, P("junction", 101)),
        *(m[0] for m in made.values()),
        junction(100, [(4, 10, -1), (1, 11, -1), (4, 12, -1)]),
        junction(101, [(3, 13, -1), (3, 14, -1), (2, 15, 1)]),
    ]
    on = lambda *numbers: [(n, [-1], 1, 0.0, made[n][1]) for n in numbers]  # noqa: E731
    ways = [
        [(1, [-1], 1, 0.0, ARM), *on(11, 3, 14), (2, [-1], 1, 0.0, ARM)],
        [(2, [1], -1, 0.0, ARM), *on(15, 4, 12), (1, [1], -1, 0.0, ARM)],
        [(1, [-1], 1, 0.0, ARM), *on(11, 3, 13, 4, 12), (1, [1], -1, 0.0, ARM)],
    ]
    return whole(parts), ways, True


def build(r):
    return KINDS[r["kind"]](r)


def place(ways, way, k, d):
    """Road, lane and s at distance d along a way in its k-th lane from the inside."""
    for number, lanes, sign, start, length in ways[way]:  # noqa: B007 - the last one is kept
        if d <= length:
            break
        d -= length
    d = min(d, length)
    return number, lanes[min(k, len(lanes) - 1)], round(start + (d if sign > 0 else length - d), 3)
