"""From a scenario as plain data to OpenSCENARIO text. Strategy files add kinds of actions and conditions to the tables.

scenario = {"road": {...}, "end": s, "egos": [name], "convert": {...}, "vehicles": [{"name", "class", "way", "k", "d",
"v", "off", "init": [action]}], "events": [{"name", "of": vehicle, "do": [action], "when": [[condition]], ...}]}
action = [kind, ...], condition = [kind, ...]. Events of one vehicle form a maneuver, in order.
"""

from __future__ import annotations

from functools import partial

from . import roads

CLASSES = {"car": (4.6, 1.9), "truck": (12.0, 2.5), "bus": (12.0, 2.5), "motorbike": (2.2, 0.8), "van": (6.0, 2.1)}
EXTERNAL = (
    '<ObjectController><Controller name="ext"><Properties><Property name="esminiController" '
    'value="ExternalController"/>'
    "</Properties></Controller></ObjectController>"
)
ACTIVE = '<ControllerAction><ActivateControllerAction longitudinal="true" lateral="true"/></ControllerAction>'
ACTIONS, CONDITIONS, OBJECTS = {}, {}, {}


def adds(table):
    def add(function):
        table[function.__name__] = function
        return function

    return add


action, condition = partial(adds, ACTIONS), partial(adds, CONDITIONS)


def dynamics(tag, shape, by, value):
    return f'<{tag} dynamicsShape="{shape}" dynamicsDimension="{by}" value="{value}"/>'


def position(at, inside=True):
    """Where: [way, k, d] as LanePosition; `s` holds the ways."""
    number, lane, s = at
    return f'<Position><LanePosition roadId="{number}" laneId="{lane}" s="{s}"/></Position>'


def along(inner):
    return f"<LongitudinalAction>{inner}</LongitudinalAction>"


def across(inner):
    return f"<LateralAction>{inner}</LateralAction>"


@action()
def speed(_, v, shape="step", by="time", value=0):
    return along(
        f"<SpeedAction>{dynamics('SpeedActionDynamics', shape, by, value)}<SpeedActionTarget>"
        f'<AbsoluteTargetSpeed value="{v}"/></SpeedActionTarget></SpeedAction>'
    )


@action()
def speed_as(_, who, delta, continuous="false", value=2):
    target = (
        f'<RelativeTargetSpeed entityRef="{who}" value="{delta}" speedTargetValueType="delta" '
        f'continuous="{continuous}"/>'
    )
    return along(
        f"<SpeedAction>{dynamics('SpeedActionDynamics', 'linear', 'time', value)}<SpeedActionTarget>"
        f"{target}</SpeedActionTarget></SpeedAction>"
    )


@action()
def profile(_, entries):
    return along(
        '<SpeedProfileAction followingMode="position">'
        + "".join(f'<SpeedProfileEntry speed="{v}" time="{t}"/>' for v, t in entries)
        + "</SpeedProfileAction>"
    )


@action()
def keep(_, who, distance, continuous="false", free="true"):
    limits = '<DynamicConstraints maxAcceleration="2" maxDeceleration="4" maxSpeed="40"/>'
    return along(
        f'<LongitudinalDistanceAction entityRef="{who}" distance="{distance}" freespace="{free}" '
        f'continuous="{continuous}" coordinateSystem="road">{limits}</LongitudinalDistanceAction>'
    )


@action()
def synchronise(s, who, master, own, final):
    where = (
        f"<{tag}>{position(roads.place(s, *at))[10:-11]}</{tag}>"
        for tag, at in (("TargetPositionMaster", master), ("TargetPosition", own))
    )
    return (
        f'<SynchronizeAction masterEntityRef="{who}">{"".join(where)}<FinalSpeed><AbsoluteSpeed '
        f'value="{final}"/></FinalSpeed></SynchronizeAction>'
    )


@action()
def change(_, who, step, shape="sinusoidal", by="time", value=4, offset=0):
    more = f' targetLaneOffset="{offset}"' if offset else ""
    target = (
        f'<RelativeTargetLane entityRef="{who}" value="{step}"/>' if who else f'<AbsoluteTargetLane value="{step}"/>'
    )
    return across(
        f"<LaneChangeAction{more}>{dynamics('LaneChangeActionDynamics', shape, by, value)}"
        f"<LaneChangeTarget>{target}</LaneChangeTarget></LaneChangeAction>"
    )


@action()
def offset(_, to, limit=0.5, continuous="false", shape="sinusoidal"):
    most = f' maxLateralAcc="{limit}"' if limit else ""
    return across(
        f'<LaneOffsetAction continuous="{continuous}"><LaneOffsetActionDynamics '
        f'dynamicsShape="{shape}"{most}/><LaneOffsetTarget><AbsoluteTargetLaneOffset value="{to}"/>'
        "</LaneOffsetTarget></LaneOffsetAction>"
    )


@action()
def teleport(s, way, k, d):
    return f"<TeleportAction>{position(roads.place(s, way, k, d))}</TeleportAction>"


@action()
def beside(_, who, lanes, ds):
    return (
        f'<TeleportAction><Position><RelativeLanePosition entityRef="{who}" dLane="{lanes}" ds="{ds}"/>'
        "</Position></TeleportAction>"
    )


@action()
def route(s, way, k=0):
    ends, d = [], 0.0
    for _, _, _, _, length in s[way]:
        ends.append(d + 0.5 * length)
        d += length
    points = "".join(
        f'<Waypoint routeStrategy="shortest">{position(roads.place(s, way, k, d))}</Waypoint>' for d in ends
    )
    return (
        f'<RoutingAction><AssignRouteAction><Route name="r" closed="false">{points}</Route>'
        "</AssignRouteAction></RoutingAction>"
    )


@action()
def trajectory(s, points):
    vertices = "".join(f'<Vertex time="{t}">{position(roads.place(s, *at))}</Vertex>' for t, *at in points)
    return (
        '<RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="t" closed="false"><Shape><Polyline>'
        + vertices
        + "</Polyline></Shape></Trajectory></TrajectoryRef><TimeReference><Timing "
        'domainAbsoluteRelative="relative" scale="1" offset="0"/></TimeReference>'
        '<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction>'
    )


@action()
def controller(_, along_, across_):
    return (
        f'<ControllerAction><ActivateControllerAction longitudinal="{along_}" lateral="{across_}"/></ControllerAction>'
    )


def valued(inner):
    return f"<ByValueCondition>{inner}</ByValueCondition>"


def by(who, inner):
    return (
        '<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef '
        f'entityRef="{who}"/></TriggeringEntities><EntityCondition>{inner}</EntityCondition>'
        "</ByEntityCondition>"
    )


MEASURE = 'coordinateSystem="road" relativeDistanceType="longitudinal"'


@condition()
def time(_, t):
    return valued(f'<SimulationTimeCondition value="{t}" rule="greaterThan"/>')


@condition()
def after(_, event, state="completeState"):
    return valued(
        f'<StoryboardElementStateCondition storyboardElementType="event" storyboardElementRef="{event}" '
        f'state="{state}"/>'
    )


@condition()
def headway(_, who, to, t, rule="lessThan", free="false"):
    return by(who, f'<TimeHeadwayCondition entityRef="{to}" value="{t}" freespace="{free}" {MEASURE} rule="{rule}"/>')


@condition()
def ttc(_, who, to, t, free="true"):
    return by(
        who,
        f'<TimeToCollisionCondition value="{t}" freespace="{free}" {MEASURE} rule="lessThan">'
        f'<TimeToCollisionConditionTarget><EntityRef entityRef="{to}"/></TimeToCollisionConditionTarget>'
        "</TimeToCollisionCondition>",
    )


@condition()
def near(_, who, to, d, rule="lessThan", free="false", measure="longitudinal"):
    system = "entity" if measure == "euclidianDistance" else "road"
    return by(
        who,
        f'<RelativeDistanceCondition entityRef="{to}" value="{d}" freespace="{free}" '
        f'coordinateSystem="{system}" relativeDistanceType="{measure}" rule="{rule}"/>',
    )


@condition()
def travelled(_, who, d):
    return by(who, f'<TraveledDistanceCondition value="{d}"/>')


@condition()
def reach(s, who, way, k, d, tolerance):
    return by(
        who,
        f'<ReachPositionCondition tolerance="{tolerance}">{position(roads.place(s, way, k, d))}'
        "</ReachPositionCondition>",
    )


@condition()
def fast(_, who, v, rule="greaterThan"):
    return by(who, f'<SpeedCondition value="{v}" rule="{rule}"/>')


@condition()
def stands(_, who, t):
    return by(who, f'<StandStillCondition duration="{t}"/>')


def box(length, width, height):
    return (
        f'<BoundingBox><Center x="{0.3 * length:g}" y="0" z="{0.5 * height:g}"/><Dimensions width="{width}" '
        f'length="{length}" height="{height}"/></BoundingBox>'
    )


@adds(OBJECTS)
def pedestrian(_):
    return (
        '<Pedestrian name="p" mass="80" model="p" pedestrianCategory="pedestrian">'
        f"{box(0.6, 0.6, 1.8)}<Properties/></Pedestrian>"
    )


def vehicle(one, by_catalog=False):
    """The object of a vehicle."""
    made = f'<CatalogReference catalogName="cars" entryName="{one["class"]}"/>' if by_catalog else thing(one["class"])
    return f'<ScenarioObject name="{one["name"]}">{made}{EXTERNAL if one["name"] == "Ego" else ""}</ScenarioObject>'


def thing(kind):
    """Who or what it is."""
    if kind in OBJECTS:
        return OBJECTS[kind](kind)
    length, width = CLASSES[kind]
    axle = 'maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.6" positionZ="0.3"'
    return (
        f'<Vehicle name="{kind}" vehicleCategory="{kind}">{box(length, width, 1.5)}<Performance '
        'maxSpeed="70" maxAcceleration="10" maxDeceleration="10"/>'
        f'<Axles><FrontAxle positionX="{0.6 * length}" {axle}/><RearAxle positionX="0" {axle}/></Axles>'
        "<Properties/></Vehicle>"
    )


def do(kind, table, ways):
    return table[kind[0]](ways, *kind[1:])


def private(text):
    return f"<PrivateAction>{text}</PrivateAction>"


def header(minor):
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><OpenSCENARIO><FileHeader revMajor="1" revMinor="{minor}" '
        'date="2026-01-01T00:00:00" description="made" author="generator"/>'
    )


def scenario(spec, road_file, ways):
    """The whole file."""
    override, minor = ("overwrite" if spec.get("minor", 2) < 2 else "override"), spec.get("minor", 2)
    init = ""
    for one in spec["vehicles"]:
        number, lane, s = roads.place(ways, one["way"], one["k"], one["d"])
        at = (
            f'<TeleportAction><Position><LanePosition roadId="{number}" laneId="{lane}" s="{s}" '
            f'offset="{one.get("off", 0)}"/></Position></TeleportAction>'
        )
        first = [
            at,
            do(["speed", f"$v_{one['name']}" if spec.get("parameters") else one["v"]], ACTIONS, ways),
            *(
                [do(["route", one["way"], one["k"]], ACTIONS, ways)]
                if len(ways[one["way"]]) > 1 and spec["road"]["kind"] != "opposite"
                else []
            ),
            *([ACTIVE] if one["name"] == "Ego" else []),
            *(do(item, ACTIONS, ways) for item in one.get("init", ())),
        ]
        init += f'<Private entityRef="{one["name"]}">{"".join(map(private, first))}</Private>'
    groups = ""
    for one in spec["vehicles"]:
        events = ""
        for event in (event for event in spec["events"] if event["of"] == one["name"]):
            name = event["name"]
            what = "".join(
                f'<Action name="{name}_a{k}">{private(do(item, ACTIONS, ways))}</Action>'
                for k, item in enumerate(event["do"])
            )
            when = "".join(
                "<ConditionGroup>"
                + "".join(
                    f'<Condition name="{name}_c{k}" delay="{event.get("delay", 0)}" '
                    f'conditionEdge="{event.get("edge", "none")}">{do(item, CONDITIONS, ways)}</Condition>'
                    for k, item in enumerate(group)
                )
                + "</ConditionGroup>"
                for group in event["when"]
            )
            events += (
                f'<Event name="{name}" priority="{event.get("priority", override)}" '
                f'maximumExecutionCount="{event.get("times", 1)}">{what}'
                f"<StartTrigger>{when}</StartTrigger></Event>"
            )
        if events:
            groups += (
                f'<ManeuverGroup name="g{one["name"]}" maximumExecutionCount="1"><Actors '
                f'selectTriggeringEntities="false"><EntityRef entityRef="{one["name"]}"/></Actors>'
                f'<Maneuver name="m{one["name"]}">{events}</Maneuver></ManeuverGroup>'
            )
    if not groups:
        groups = (
            '<ManeuverGroup name="g" maximumExecutionCount="1"><Actors selectTriggeringEntities="false">'
            '<EntityRef entityRef="Ego"/></Actors><Maneuver name="m"><Event name="never" '
            f'priority="{override}"><Action name="x">'
            + private(do(["offset", 0], ACTIONS, ways))
            + '</Action><StartTrigger><ConditionGroup><Condition name="c" delay="0" conditionEdge="none">'
            f"{do(['time', 9999], CONDITIONS, ways)}</Condition></ConditionGroup></StartTrigger></Event>"
            "</Maneuver></ManeuverGroup>"
        )
    stop = spec.get("stop", "")

    def at(t, rule):
        return (
            '<ConditionGroup><Condition name="t" delay="0" conditionEdge="none"><ByValueCondition>'
            f'<SimulationTimeCondition value="{t}" rule="{rule}"/></ByValueCondition></Condition>'
            "</ConditionGroup>"
        )

    acts = f'<Act name="act">{groups}<StartTrigger>{at(0, "greaterOrEqual")}</StartTrigger>{stop}</Act>'
    parameters = "".join(
        f'<ParameterDeclaration name="v_{one["name"]}" parameterType="double" value="{one["v"]}"/>'
        for one in (spec["vehicles"] if spec.get("parameters") else ())
    )
    catalog = '<VehicleCatalog><Directory path="catalogs"/></VehicleCatalog>' if spec.get("catalog") else ""
    entities = "".join(vehicle(one, bool(catalog) and one["class"] in CLASSES) for one in spec["vehicles"])
    return (
        f"{header(minor)}<ParameterDeclarations>{parameters}</ParameterDeclarations>"
        f'<CatalogLocations>{catalog}</CatalogLocations><RoadNetwork><LogicFile filepath="{road_file}"/></RoadNetwork>'
        f"<Entities>{entities}</Entities>"
        f'<Storyboard><Init><Actions>{init}</Actions></Init><Story name="story">{acts}</Story>'
        f"<StopTrigger>{at(spec['end'], 'greaterThan')}</StopTrigger></Storyboard></OpenSCENARIO>"
    )


def files(spec, folder):
    """Write both; returns the scenario's path."""
    text, ways, _ = roads.build(spec["road"])
    (folder / "road.xodr").write_text(text)
    if spec.get("catalog"):
        (folder / "catalogs").mkdir(exist_ok=True)
        cars = "".join(map(thing, CLASSES))
        whole = f'{header(spec.get("minor", 2))}<Catalog name="cars">{cars}</Catalog></OpenSCENARIO>'
        (folder / "catalogs" / "cars.xosc").write_text(whole)
    path = folder / "scenario.xosc"
    path.write_text(scenario(spec, "road.xodr", ways))
    return path
