"""What is derived from the scenario model's fields."""

from __future__ import annotations

from pathlib import Path

import pytest

from xosc_lateral.world.scenario.entity import BoundingBox, Entity
from xosc_lateral.world.scenario.enums import EntityCategory
from xosc_lateral.world.scenario.place import Place
from xosc_lateral.world.scenario.scenario import FileHeader, Init, Scenario, Storyboard

PLACE = Place("f.xosc", 3, "ScenarioObject 'a'")


def entity(name: str, category: EntityCategory = EntityCategory.VEHICLE) -> Entity:
    return Entity(name, category, PLACE, BoundingBox(1.4, 0.0, 0.7, 4.5, 1.9, 1.5))


def scenario(*names: str, hashes: dict[Path, str] | None = None) -> Scenario:
    board = Storyboard(Init((), (), ()), (), None, PLACE)
    header = FileHeader(1, 2, "d")
    return Scenario(
        Path("f.xosc"), header, {}, {}, {}, None, (), tuple(map(entity, names)), board, input_hashes=hashes or {}
    )


@pytest.mark.parametrize(
    ("description", "left_handed"),
    [("CARLA:LaneChange", True), (" CARLA: x", True), ("Made for CARLA: x", False), ("carla:x", False), ("", False)],
)
def test_only_a_description_that_begins_with_carla_makes_y_point_right(description, left_handed):
    """As scenario_runner tells its own files (`convert to left-handed` by that prefix)."""
    assert FileHeader(1, 0, description).is_left_handed is left_handed


def test_entities_are_found_by_name_and_only_vehicles_are_given_movement():
    found = scenario("a", "b")
    assert found.entity("b").name == "b"
    with pytest.raises(KeyError, match="c"):
        found.entity("c")
    assert [entity("x", kind).is_vehicle for kind in EntityCategory] == [True, False, False, False]


def test_parsed_files_are_named_in_the_order_in_which_they_were_read():
    hashes = {Path("z.xosc"): "0" * 64, Path("a.xosc"): "1" * 64}
    assert scenario(hashes=hashes).input_files == (Path("z.xosc"), Path("a.xosc"))


def test_elements_read_again_from_the_same_bytes_are_equal():
    """`node` finds an element again in a new parse, and is no part of what it says."""
    assert Place("f", 3, "Event 'x'", node=(1, 2)) == Place("f", 3, "Event 'x'", node=(4,))
    assert Place("f", 3, "Event 'x'") != Place("f", 4, "Event 'x'")
