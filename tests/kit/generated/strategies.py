"""What may be in a scenario. Each strategy takes a `random.Random` (hypothesis' `st.randoms()` is one, too).

`ROADS`, `ACTS`, `TRIGGERS`, `EGOS` and `STORIES` are lists of (weight, function): another file may add to them.
An act is `(draw, scene, vehicle) -> [actions]`; a trigger `-> [conditions]`; a story adds vehicles and events of a kind
of situation as a whole, since what hangs together is seldom drawn by chance.
"""

from __future__ import annotations

from . import roads

ROADS, ACTS, TRIGGERS, EGOS, STORIES = [], [], [], [], []


def may(table, weight=1.0):
    def add(function):
        table.append((weight, function))
        return function

    return add


def pick(draw, table):
    return draw.choices([one for _, one in table], [weight for weight, _ in table])[0]


def number(draw, low, high, digits=1):
    return round(draw.uniform(low, high), digits)


class Scene:
    """What is there so far."""

    def __init__(self, draw, road):
        self.draw, self.road = draw, road
        _, self.ways, self.junction = roads.build(road)
        self.vehicles, self.events = [], []
        radius = road.get("gap", road.get("radius", 1000))
        self.fastest = min(12.0 if self.junction else 35.0, round((3.0 * radius) ** 0.5, 1))

    def lanes(self, way):
        return min(len(part[1]) for part in self.ways[way])

    def length(self, way):
        return sum(part[4] for part in self.ways[way])

    def add(self, name, kind, way, k, d, v, **more):
        self.vehicles.append({"name": name, "class": kind, "way": way, "k": k, "d": round(d, 1), "v": v, **more})
        return self.vehicles[-1]

    def event(self, of, do, when, **more):
        name = f"e{len(self.events)}"
        self.events.append({"name": name, "of": of, "do": do, "when": when, **more})
        return name


# --- roads
@may(ROADS, 3)
def straight(draw):
    return {"kind": "plain", "lanes": draw.choice([1, 2, 2, 3]), "width": draw.choice([3.0, 3.25, 3.5, 3.75])}


@may(ROADS, 3)
def bends(draw):
    return {**straight(draw), "radius": draw.choice([60, 120, 250, 500, 1000])}


@may(ROADS)
def hills(draw):
    return {**straight(draw), "slope": number(draw, 0.02, 0.08, 2)}


@may(ROADS)
def left_hand(draw):
    return {**draw.choice([straight, bends])(draw), "left": True}


@may(ROADS)
def opposite(draw):
    return {
        "kind": "opposite",
        "lanes": draw.choice([1, 2, 3]),
        "width": 3.5,
        "length": draw.choice([150.0, 300.0, 600.0]),
    }


@may(ROADS)
def tapers(draw):
    return {
        "kind": "taper",
        "what": draw.choice(["drop", "add", "ramp"]),
        "lanes": draw.choice([2, 3]),
        "width": 3.5,
        "at": draw.choice([200.0, 400.0, 600.0]),
    }


@may(ROADS, 1.5)
def crossing(draw):
    return {"kind": "crossing", "width": draw.choice([3.0, 3.5]), "gap": draw.choice([10.0, 15.0, 20.0])}


@may(ROADS, 1.5)
def roundabout(draw):
    return {"kind": "roundabout", "radius": draw.choice([12.0, 20.0, 35.0])}


# --- acts
@may(ACTS, 4)
def to_speed(draw, scene, one):
    v = draw.choice([0, 0, number(draw, 0, scene.fastest), one["v"]])
    return [
        [
            "speed",
            v,
            draw.choice(["linear", "linear", "sinusoidal", "cubic"]),
            *draw.choice([("rate", number(draw, 0.5, 4)), ("time", number(draw, 1, 8))]),
        ]
    ]


@may(ACTS)
def profile(draw, scene, one):
    speeds = (draw.choice([0, number(draw, 0, scene.fastest)]) for _ in range(draw.randint(2, 4)))
    return [["profile", [[one["v"], 0], *([v, number(draw, 2, 8)] for v in speeds)]]]


@may(ACTS)
def as_ego(draw, scene, one):
    return [["speed_as", "Ego", draw.choice([0, -2, 2]), draw.choice(["true", "false"]), number(draw, 1, 5)]]


@may(ACTS, 4)
def change(draw, scene, one):
    shape = draw.choice(["sinusoidal", "sinusoidal", "cubic", "linear"])
    how, value = draw.choice(
        [
            ("time", number(draw, 2, 8)),
            ("time", number(draw, 3, 6)),
            ("distance", number(draw, 30, 150)),
            ("rate", number(draw, 0.6, 2)),
        ]
    )
    n = scene.lanes(one["way"])
    if n == 1:
        return offset(draw, scene, one)
    lane = draw.randrange(n)
    if scene.road["kind"] in ("plain", "taper"):
        return [
            ["change", None, scene.ways[one["way"]][0][1][lane], shape, how, value, draw.choice([0, 0, 0, 0.4, -0.3])]
        ]
    return [["change", one["name"], draw.choice([1, -1]), shape, how, value]]


@may(ACTS, 2)
def offset(draw, scene, one):
    return [
        [
            "offset",
            draw.choice([0, 0.3, -0.4, 0.8, -0.6]),
            draw.choice([0.2, 0.5, 1.0]),
            "false",
            draw.choice(["sinusoidal", "cubic", "linear"]),
        ]
    ]


@may(ACTS, 0.5)
def distance(draw, scene, one):
    return [["keep", "Ego", number(draw, 15, 50), draw.choice(["true", "false"])]]


@may(ACTS, 0.5)
def both(draw, scene, one):
    return to_speed(draw, scene, one) + change(draw, scene, one)


@may(ACTS, 0.4)
def elsewhere(draw, scene, one):
    return [["teleport", one["way"], draw.randrange(scene.lanes(one["way"])), number(draw, 150, 500)]]


@may(ACTS, 0.5)
def meets(draw, scene, one):
    d = number(draw, 150, 280)
    return [
        [
            "synchronise",
            "Ego",
            [0, 0, d],
            [one["way"], one["k"], min(d + number(draw, -20, 60), scene.length(one["way"]) - 20)],
            number(draw, 3, scene.fastest),
        ]
    ]


@may(ACTS, 0.5)
def along_points(draw, scene, one):
    t, d, points = 0, one["d"] + 60, []
    for _ in range(draw.randint(3, 6)):
        points.append([t, one["way"], draw.randrange(scene.lanes(one["way"])), round(d, 1)])
        step = number(draw, 2, 5)
        t, d = round(t + step, 1), d + step * max(one["v"], 3)
    return [["trajectory", points]]


# --- triggers
@may(TRIGGERS, 2)
def at_time(draw, scene, one):
    return [["time", number(draw, 0, 8)]]


@may(TRIGGERS, 3)
def near_ego(draw, scene, one):
    measure = (
        "euclidianDistance"
        if scene.junction or one["way"]
        else draw.choice(["longitudinal", "longitudinal", "euclidianDistance", "lateral"])
    )
    if measure == "lateral":
        return [
            [
                "near",
                one["name"],
                "Ego",
                number(draw, 0.5, 4),
                draw.choice(["lessThan", "greaterThan"]),
                draw.choice(["true", "false"]),
                measure,
            ]
        ]
    return [["near", one["name"], "Ego", number(draw, 10, 120, 0), "lessThan", draw.choice(["true", "false"]), measure]]


@may(TRIGGERS, 2)
def headway(draw, scene, one):
    a, b = draw.sample([one["name"], "Ego"], 2)
    return [["headway", a, b, number(draw, 0.8, 4)]]


@may(TRIGGERS)
def collides_soon(draw, scene, one):
    a, b = draw.sample([one["name"], "Ego"], 2)
    return [["ttc", a, b, number(draw, 1.5, 15)]]


@may(TRIGGERS)
def way_of(draw, scene, one):
    return [["travelled", draw.choice([one["name"], "Ego"]), number(draw, 20, 250, 0)]]


@may(TRIGGERS)
def at_place(draw, scene, one):
    who = draw.choice([one, scene.vehicles[0]])
    return [
        [
            "reach",
            who["name"],
            who["way"],
            who["k"],
            number(draw, who["d"] + 20, who["d"] + 250),
            draw.choice([2.0, 5.0]),
        ]
    ]


@may(TRIGGERS)
def of_speed(draw, scene, one):
    who = draw.choice([one, scene.vehicles[0]])
    return [
        draw.choice(
            [
                ["fast", who["name"], number(draw, 1, scene.fastest), draw.choice(["greaterThan", "lessThan"])],
                ["stands", who["name"], number(draw, 1, 4)],
            ]
        )
    ]


# --- egos
EGOS += [(1.0, name) for name in ("0.6", "0.8", "1.0", "1.2", "1.3", "never", "stops", "stays", "changes")]


# --- stories
@may(STORIES, 6)
def anything(draw, scene):
    """Vehicles anywhere, each with a chain of acts."""
    taken = {(0, scene.vehicles[0]["k"]): [scene.vehicles[0]["d"]]}
    for i in range(draw.choice([1, 1, 2, 2, 3, 5])):
        way = draw.choice([0, 0, 0, draw.randrange(len(scene.ways))])
        k = draw.randrange(scene.lanes(way))
        d = number(draw, 10, min(220, scene.length(way) - 60))
        if any(abs(d - other) < 20 for other in taken.get((way, k), [])):
            continue
        taken.setdefault((way, k), []).append(d)
        v = draw.choice(
            [
                0,
                number(draw, 1, scene.fastest),
                number(draw, 0.6 * scene.fastest, scene.fastest),
                scene.vehicles[0]["v"],
            ]
        )
        one = scene.add(
            "ABCDEF"[i],
            draw.choice(["car", "car", "car", "truck", "bus", "motorbike", "van"]),
            way,
            k,
            d,
            v,
            off=draw.choice([0, 0, 0, 0.3, -0.3]),
        )
        before = None
        for _ in range(draw.randint(0 if i else 1, 3)):
            if before and draw.random() < 0.6:
                when, more = (
                    [
                        [
                            "after",
                            before,
                            draw.choice(["completeState", "completeState", "endTransition", "startTransition"]),
                        ]
                    ],
                    {"delay": draw.choice([0, 0, 1, 3])},
                )
            else:
                when, more = (
                    pick(draw, TRIGGERS)(draw, scene, one),
                    {"edge": draw.choice(["none", "none", "none", "rising"])},
                )
            before = scene.event(one["name"], pick(draw, ACTS)(draw, scene, one), [when], **more)


@may(STORIES)
def queue(draw, scene):
    """Cars stand and drive off as Ego comes."""
    v = number(draw, 5, scene.fastest)
    for i in range(draw.randint(1, 3)):
        one = scene.add("ABCDEF"[i], "car", 0, scene.vehicles[0]["k"], 180 - 9 * i, 0)
        scene.event(
            one["name"],
            [["speed", v, "linear", "rate", number(draw, 0.8, 3)]],
            [[["near", one["name"], "Ego", number(draw, 25, 100, 0), "lessThan", "true"]]],
            delay=i,
        )


@may(STORIES)
def stops_in_the_ring(draw, scene):
    """A car comes to rest on a roundabout, or in a crossing, and goes on."""
    if not scene.junction:
        return queue(draw, scene)
    first = scene.ways[0][0][4]
    v = number(draw, 3, scene.fastest)
    one = scene.add("A", "car", 0, 0, number(draw, first - 60, first - 20), v)
    at = [["travelled", "A", number(draw, first - one["d"] + 2, first - one["d"] + 40, 0)]]
    stop = scene.event("A", [["speed", 0, "linear", "rate", number(draw, 2, 4)]], [at])
    if draw.random() < 0.7:
        scene.event(
            "A", [["speed", v, "linear", "rate", number(draw, 1, 3)]], [[["after", stop]]], delay=draw.choice([1, 3])
        )
    return one


@may(STORIES)
def on_foot(draw, scene):
    """Somebody walks along the road, and a car brakes for him."""
    k = scene.vehicles[0]["k"]
    scene.add("A", "pedestrian", 0, k, number(draw, 120, 160), number(draw, 0.8, 2), off=draw.choice([0, 1.2]))
    one = scene.add("B", "car", 0, k, number(draw, 5, 18), scene.vehicles[0]["v"])
    scene.vehicles[0]["d"] = 40.0
    scene.event("B", [["speed", 1, "linear", "rate", 4]], [[["near", "B", "A", number(draw, 15, 40, 0)]]])
    return one


@may(STORIES)
def jam(draw, scene):
    """Cars stop one after the other and go on."""
    before = "Ego"
    for i in range(draw.randint(1, 3)):
        name = "ABCDEF"[i]
        one = scene.add(name, "car", 0, scene.vehicles[0]["k"], 110 + 35 * i, scene.vehicles[0]["v"])
        stop = scene.event(
            name,
            [["speed", 0, "linear", "rate", number(draw, 2, 4)]],
            [
                [
                    draw.choice(
                        [["travelled", "Ego", number(draw, 50, 150)], ["near", name, before, 30, "lessThan", "true"]]
                    )
                ]
            ],
        )
        scene.event(
            name,
            [["speed", number(draw, 5, 15), "linear", "rate", 1.2]],
            [[["after", stop]]],
            delay=draw.choice([2, 5]),
        )
        before = one["name"]


@may(STORIES)
def overtakes(draw, scene):
    """Out and back; the way back may find it there already."""
    k, n = scene.vehicles[0]["k"], scene.lanes(0)
    if n < 2:
        return anything(draw, scene)
    other = k - 1 if k else 1
    ids = scene.ways[0][0][1]
    scene.add("A", "truck", 0, k, scene.vehicles[0]["d"] + 150, number(draw, 5, 15))
    one = scene.add("B", "car", 0, draw.choice([k, k, other]), scene.vehicles[0]["d"] + 70, scene.vehicles[0]["v"])
    step = (
        (lambda to, t: ["change", None, ids[to], "sinusoidal", "time", t])
        if scene.road["kind"] != "opposite"
        else (lambda to, t: ["change", "Ego" if to == k else one["name"], 0 if to == k else 1, "sinusoidal", "time", t])
    )
    out = scene.event("B", [step(other, number(draw, 3, 6))], [[["near", "B", "A", number(draw, 25, 60)]]])
    back = scene.event(
        "B",
        [step(k, number(draw, 3, 6))],
        [[draw.choice([["near", "B", "A", 20, "greaterThan"], ["after", out]])]],
        delay=1,
    )
    scene.add("C", "car", 0, other, scene.vehicles[0]["d"] - 20, scene.vehicles[0]["v"] + 2)
    slower = scene.event("C", [["speed", number(draw, 10, 20), "linear", "rate", 1.5]], [[["headway", "C", "B", 1.5]]])
    scene.event("C", [["speed", 27, "linear", "rate", 1]], [[["after", back]]])
    return slower


@may(STORIES)
def beside_ego(draw, scene):
    """Ego's brake, or another's, hangs on who is beside it, barely."""
    n, k = scene.lanes(0), scene.vehicles[0]["k"]
    if n < 2:
        return anything(draw, scene)
    one = scene.add(
        "A",
        "car",
        0,
        k + 1 if k + 1 < n else k - 1,
        scene.vehicles[0]["d"] + number(draw, -3, 30),
        scene.vehicles[0]["v"],
    )
    gap = scene.road["width"] - 1.9
    rule = draw.choice(["lessThan", "greaterThan"])
    edge = round(gap + (number(draw, 0.03, 0.3, 2) if rule == "greaterThan" else -number(draw, 0.03, 0.3, 2)), 2)
    scene.event(
        draw.choice(["Ego", "A"]),
        [["speed", number(draw, 0, 10), "linear", "rate", 3]],
        [[["near", "Ego", "A", edge, rule, "true", "lateral"]]],
    )
    return one


def scenario(draw):
    """One scenario, as data."""
    scene = Scene(draw, pick(draw, ROADS)(draw))
    k = draw.randrange(scene.lanes(0))
    scene.add("Ego", "car", 0, k, number(draw, 20, 120), number(draw, 0.4 * scene.fastest, scene.fastest))
    pick(draw, STORIES)(draw, scene)
    egos = [pick(draw, EGOS)]
    how = draw.choices(
        [{"mode": "auto"}, {"mode": "trajectory"}, {"mode": "auto", "lane_changes": "lifelike"}], [5, 2, 1.5]
    )[0]
    written = {
        "minor": draw.choice([1, 2, 2, 2, 3, 4] if "profile" not in str(scene.events) else [2, 3, 4]),
        "catalog": draw.random() < 0.15,
        "parameters": draw.random() < 0.15,
    }
    return {
        **written,
        "road": scene.road,
        "end": draw.choice([8, 10, 12, 16, 20]),
        "vehicles": scene.vehicles,
        "events": scene.events,
        "egos": egos,
        "convert": {**how, "seed": draw.randint(0, 99)},
    }
