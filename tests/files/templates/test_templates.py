"""Templates: the scenario that their summary promises, on a road that holds, whatever is set within the ranges."""

from __future__ import annotations

import json
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from xosc_lateral.base.errors import XoscLateralError
from xosc_lateral.cli import main
from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.files.templates import TEMPLATES, Template, find_template
from xosc_lateral.files.templates.template import Number

XSD = Path(__file__).resolve().parents[2] / "data" / "xsd"
NAMES = [template.name for template in TEMPLATES]


def scenario(template: Template, chosen: dict[str, str] | None = None) -> etree._Element:
    return etree.fromstring(template.files(chosen)[f"{template.name}.xosc"].encode())


def road(template: Template, tmp_path, chosen: dict[str, str] | None = None):
    path = tmp_path / f"{template.name}.xodr"
    path.write_text(template.files(chosen)[path.name])
    return read_opendrive(path)


def starts(root: etree._Element) -> dict[str, tuple[int, float]]:
    """Entity -> lane id and s at the start."""
    found = {}
    for private in root.iterfind(".//Init/Actions/Private"):
        place = private.find(".//LanePosition")
        found[private.get("entityRef")] = (int(place.get("laneId")), float(place.get("s")))
    return found


@pytest.mark.parametrize("template", TEMPLATES, ids=NAMES)
def test_the_same_settings_give_the_same_bytes(template):
    assert template.files({"rain": "2"}) == template.files({"rain": "2"}) != template.files()


@pytest.mark.parametrize("version", ["1.2", "1.3"])
def test_every_template_is_valid_against_the_schema_of_its_version(version):
    schema = etree.XMLSchema(etree.parse(XSD / f"OpenSCENARIO-{version}.0.xsd"))
    for template in TEMPLATES:
        root = scenario(template, {"version": version, "rain": "3", "time_of_day": "23"})
        assert root.find("FileHeader").get("revMinor") == version[-1]
        assert schema.validate(root), f"{template.name}: {schema.error_log}"


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("template", TEMPLATES, ids=NAMES)
def test_the_road_is_continuous_in_place_heading_and_curvature_and_as_long_as_planned(template, side, tmp_path):
    network = road(template, tmp_path, {"traffic": side})
    assert network.notes == ()
    length = network.roads[0].length
    s = np.arange(0.0, length, 0.25)
    poses = network.road_to_world(0, s)
    np.testing.assert_allclose(np.hypot(np.diff(poses.x), np.diff(poses.y)), 0.25, rtol=1e-4)
    turn = np.diff(np.unwrap(poses.heading)) / 0.25
    assert np.abs(turn).max() < 1.0 / 240.0
    assert np.abs(np.diff(turn)).max() < 2e-5  # clothoids: curvature has no steps


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("template", TEMPLATES, ids=NAMES)
def test_the_slow_lane_lies_on_the_side_that_traffic_keeps_to_and_all_drive_along_s(template, side, tmp_path):
    network = road(template, tmp_path, {"traffic": side})
    lanes = sorted({lane for lane, _ in starts(scenario(template, {"traffic": side})).values()})
    for lane in lanes:
        assert network.travel_direction(0, lane) == 1
        assert network.lane_width(0, lane, 100.0) == pytest.approx(3.75)
    across = [float(network.lane_to_world(0, lane, 10.0).y) for lane in (min(lanes, key=abs), max(lanes, key=abs))]
    assert np.sign(across[0]) == np.sign(across[1]) == (1 if side == "left" else -1)
    assert abs(across[1]) > abs(across[0])


@pytest.mark.parametrize("template", TEMPLATES, ids=NAMES)
def test_at_both_ends_of_every_range_vehicles_start_on_the_road_and_apart(template, tmp_path):
    """The only refusal names two settings that contradict each other (a passing car slower than the one passed)."""
    for parameter in template.parameters:
        if not isinstance(parameter, Number):
            continue
        for value in (parameter.low, parameter.high):
            chosen = {parameter.name: f"{value:g}"}
            try:
                placed = starts(scenario(template, chosen))
            except XoscLateralError as error:
                assert "has to be more than" in str(error)
                continue
            length = road(template, tmp_path, chosen).roads[0].length
            for lane in {lane for lane, _ in placed.values()}:
                along = sorted(s for at, s in placed.values() if at == lane)
                assert along[0] >= 0.0 and along[-1] < length - 50.0
                assert all(b - a > 8.5 for a, b in pairwise(along)), (parameter.name, value)


def test_bends_go_to_both_sides_and_bank_towards_their_inside(tmp_path):
    network = road(find_template("curves"), tmp_path)
    s = np.arange(0.0, network.roads[0].length - 1.0, 5.0)
    curvature = np.gradient(np.unwrap(network.road_to_world(0, s).heading), s)
    roll = network.road_to_world(0, s).roll
    assert curvature.max() == pytest.approx(1 / 900, rel=1e-3) and curvature.min() == pytest.approx(-1 / 900, rel=1e-3)
    full = np.abs(curvature) > 0.999 / 900
    np.testing.assert_allclose(np.abs(roll[full]), np.arctan(0.025), rtol=2e-2)
    assert len(set(np.sign(roll[full] * curvature[full]))) == 1


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"ego_speed": "90"}, "ego_speed: 90 is out of range (15 to 45 m/s)"),
        ({"ego_speed": "nan"}, "ego_speed: nan is out of range (15 to 45 m/s)"),
        ({"ego_speed": "fast"}, "ego_speed: 'fast' is not a number (15 to 45 m/s)"),
        ({"traffic": "both"}, "traffic: 'both' is none of right, left"),
        ({"ego_speed": "40", "passing_speed": "38"}, "passing_speed: 38 has to be more than ego_speed (40)"),
        ({"wings": "2"}, "unknown setting 'wings'; there are deceleration,"),
    ],
)
def test_a_bad_setting_is_refused_in_one_line(settings, message, tmp_path, capsys):
    arguments = [part for key, value in settings.items() for part in ("--set", f"{key}={value}")]
    assert main(["template", "write", "cut-in", "-o", str(tmp_path / "out"), *arguments]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"xosc-lateral: {message}") and said.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_an_unknown_template_is_refused():
    with pytest.raises(XoscLateralError, match=r"'cutin' \(did you mean 'cut-in'\?\); there are cut-in, "):
        find_template("cutin")


@pytest.mark.parametrize("template", TEMPLATES, ids=NAMES)
def test_every_setting_changes_the_files(template):
    plain = template.files()
    for parameter in template.parameters:
        if isinstance(parameter, Number):
            value = f"{(0.75 * parameter.default + 0.25 * parameter.high):g}"
        else:
            value = parameter.options[1]
        assert template.files({parameter.name: value}) != plain, parameter.name


def test_declared_parameters_are_used_and_hold_what_was_set():
    root = scenario(find_template("cut-in"), {"ego_speed": "31.5"})
    declared = {each.get("name"): each.get("value") for each in root.iterfind(".//ParameterDeclaration")}
    assert declared["ego_speed"] == "31.5"
    used = set(re.findall(r'"\$(\w+)"', etree.tostring(root, encoding="unicode")))
    assert used == set(declared)


def test_weather_is_written_in_the_standards_units():
    root = scenario(find_template("curves"), {"wind_speed": "12", "wind_direction": "270", "rain": "4"})
    wind, rain = root.find(".//Wind"), root.find(".//Precipitation")
    assert float(wind.get("speed")) == 12.0
    assert float(wind.get("direction")) == pytest.approx(1.5 * np.pi, abs=1e-6)
    assert (rain.get("precipitationType"), float(rain.get("precipitationIntensity"))) == ("rain", 4.0)
    assert float(root.find(".//RoadCondition").get("frictionScaleFactor")) < 1.0


@pytest.mark.parametrize(
    ("hour", "azimuth", "up"),
    [("6", 0.5 * np.pi, True), ("12", np.pi, True), ("18", 1.5 * np.pi, True), ("0", 0.0, False), ("23", None, False)],
)
def test_the_sun_goes_from_east_over_south_to_west(hour, azimuth, up):
    """The standard counts azimuth from north (0) over east (pi/2) to south (pi)."""
    root = scenario(find_template("curves"), {"time_of_day": hour})
    sun, clock = root.find(".//Sun"), root.find(".//TimeOfDay").get("dateTime")
    assert clock == f"2024-06-21T{int(hour):02d}:00:00"
    assert (float(sun.get("elevation")) > 0.0) is up
    assert (float(sun.get("illuminance")) > 1000.0) is up
    if azimuth is not None:
        assert float(sun.get("azimuth")) == pytest.approx(azimuth, abs=1e-5)


def test_the_sun_is_highest_at_noon_and_as_high_before_as_after():
    height = [
        float(scenario(find_template("curves"), {"time_of_day": f"{hour:g}"}).find(".//Sun").get("elevation"))
        for hour in (8.0, 10.0, 12.0, 14.0, 16.0)
    ]
    assert height == pytest.approx(height[::-1]) and max(height) == height[2] == pytest.approx(np.pi / 3)


def test_write_names_the_files_that_it_wrote_and_list_names_all_templates(tmp_path, capsys):
    assert main(["template", "write", "jam-end", "-o", str(tmp_path / "new" / "folder")]) == 0
    written = capsys.readouterr().out.splitlines()
    assert [line.rsplit("/", 1)[1] for line in written] == ["jam-end.xosc", "jam-end.xodr"]
    assert sorted(path.name for path in (tmp_path / "new" / "folder").iterdir()) == ["jam-end.xodr", "jam-end.xosc"]
    assert main(["template", "list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [each["name"] for each in listed["templates"]] == NAMES
    assert all(setting["what"] and "default" in setting for each in listed["templates"] for setting in each["settings"])
    assert main(["template", "list", "curves"]) == 0
    assert "radius" in capsys.readouterr().out
