"""Scenario files made by tests: a straight road, a few cars, maneuvers as needed."""

from __future__ import annotations

import shutil
from pathlib import Path

from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.world.scenario.scenario import Scenario

ROAD = Path(__file__).parents[1] / "data" / "xosc" / "road.xodr"

VEHICLE = (
    '<Vehicle name="car" vehicleCategory="car"{attributes}>{parameters}'
    '<BoundingBox><Center x="1.4" y="0" z="0.9"/><Dimensions width="1.9" length="4.8" height="1.6"/></BoundingBox>'
    '<Performance maxSpeed="{speed}" maxAcceleration="5" maxDeceleration="9"/><Axles>'
    '<FrontAxle maxSteering="0.5" wheelDiameter="0.7" trackWidth="1.6" positionX="2.8" positionZ="0.35"/>'
    '<RearAxle maxSteering="0" wheelDiameter="0.7" trackWidth="1.6" positionX="0" positionZ="0.35"/>'
    "</Axles><Properties/></Vehicle>"
)


def vehicle(speed: str = "69", parameters: str = "", attributes: str = "") -> str:
    return VEHICLE.format(speed=speed, parameters=parameters, attributes=attributes)


def entity(name: str, content: str = "", controller: str = "") -> str:
    return f'<ScenarioObject name="{name}">{content or vehicle()}{controller}</ScenarioObject>'


def teleport(s: str = "50", lane: str = "-1") -> str:
    position = f'<LanePosition roadId="1" laneId="{lane}" s="{s}"/>'
    return f"<PrivateAction><TeleportAction><Position>{position}</Position></TeleportAction></PrivateAction>"


def speed_action(value: str = "30") -> str:
    return (
        "<PrivateAction><LongitudinalAction><SpeedAction>"
        '<SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>'
        f'<SpeedActionTarget><AbsoluteTargetSpeed value="{value}"/></SpeedActionTarget>'
        "</SpeedAction></LongitudinalAction></PrivateAction>"
    )


def private(name: str, *actions: str) -> str:
    return f'<Private entityRef="{name}">{"".join(actions or (teleport(), speed_action()))}</Private>'


def time_condition(value: float, rule: str = "greaterThan") -> str:
    return (
        f'<ConditionGroup><Condition name="t" delay="0" conditionEdge="none"><ByValueCondition>'
        f'<SimulationTimeCondition value="{value}" rule="{rule}"/></ByValueCondition></Condition></ConditionGroup>'
    )


def event(name: str, *actions: str, time: float = 1.0) -> str:
    return (
        f'<Event name="{name}" priority="parallel" maximumExecutionCount="1">{"".join(actions)}'
        f"<StartTrigger>{time_condition(time)}</StartTrigger></Event>"
    )


def action(name: str, content: str) -> str:
    return f'<Action name="{name}">{content}</Action>'


def story(*events: str, actors: tuple[str, ...] = ("Ego",), parameters: str = "", maneuver_parameters: str = "") -> str:
    references = "".join(f'<EntityRef entityRef="{name}"/>' for name in actors)
    return (
        f'<Story name="story">{parameters}<Act name="act"><ManeuverGroup name="group" maximumExecutionCount="1">'
        f'<Actors selectTriggeringEntities="false">{references}</Actors>'
        f'<Maneuver name="maneuver">{maneuver_parameters}{"".join(events)}</Maneuver></ManeuverGroup>'
        f"<StartTrigger>{time_condition(-1)}</StartTrigger></Act></Story>"
    )


def parameter(name: str, value: str, kind: str = "double", constraints: str = "") -> str:
    attributes = f'name="{name}" parameterType="{kind}" value="{value}"'
    return f"<ParameterDeclaration {attributes}>{constraints}</ParameterDeclaration>"


def declarations(*parameters: str) -> str:
    return f"<ParameterDeclarations>{''.join(parameters)}</ParameterDeclarations>"


def scenario_text(
    *,
    minor: int = 2,
    parameters: str = "",
    catalogs: str = "",
    road: str = "road.xodr",
    entities: str = "",
    init: str = "",
    stories: str = "",
    stop: str = "",
) -> str:
    trigger = f"<StopTrigger>{stop or time_condition(10)}</StopTrigger>"
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<!-- licence -->
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="{minor}" date="2024-01-01T00:00:00" description="test" author="tests"/>
  {parameters}
  <CatalogLocations>{catalogs}</CatalogLocations>
  <RoadNetwork><LogicFile filepath="{road}"/></RoadNetwork>
  <Entities>
    <!-- who drives -->
    {entities or entity("Ego")}
  </Entities>
  <Storyboard>
    <Init><Actions>{init or private("Ego")}</Actions></Init>
    {stories or story(event("faster", action("faster", speed_action("33"))))}
    {trigger}
  </Storyboard>
</OpenSCENARIO>
"""


def write_scenario(folder: Path, text: str, name: str = "made.xosc") -> Path:
    """The scenario beside a straight road of 1 km with two lanes."""
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(ROAD, folder / "road.xodr")
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def made(folder: Path, **parts: str) -> Scenario:
    """Write and read a scenario."""
    return read_scenario(write_scenario(folder, scenario_text(**parts)))  # type: ignore[arg-type]
