"""What is taken out of a scenario for a target that lacks it: what goes along, what is said, what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest
from lxml import etree

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.openscenario.write.draft import Losses, remove, tidy

STORY = """<OpenSCENARIO>
  <Storyboard>
    <Init><Actions>
      <Private entityRef="A">
        <PrivateAction><LongitudinalAction><SpeedAction/></LongitudinalAction></PrivateAction>
      </Private>
      <Private entityRef="B">
        <PrivateAction><AppearanceAction><LightStateAction/></AppearanceAction></PrivateAction>
      </Private>
    </Actions></Init>
    <Story><Act><ManeuverGroup><Maneuver>
      <Event name="one">
        <Action name="a"><PrivateAction><AppearanceAction><AnimationAction/></AppearanceAction></PrivateAction></Action>
        <Action name="b"><PrivateAction><LateralAction><LaneChangeAction/></LateralAction></PrivateAction></Action>
        <StartTrigger><ConditionGroup><Condition name="c">
          <ByEntityCondition><EntityCondition><AngleCondition/></EntityCondition></ByEntityCondition>
        </Condition></ConditionGroup></StartTrigger>
      </Event>
      <Event name="two">
        <Action name="c"><PrivateAction><AppearanceAction><AnimationAction/></AppearanceAction></PrivateAction></Action>
      </Event>
    </Maneuver></ManeuverGroup></Act></Story>
  </Storyboard>
</OpenSCENARIO>"""


def losses(*, reactive: bool = False) -> Losses:
    return Losses(etree.fromstring(STORY), Path("x.xosc"), "version 1.0", reactive)


def found(loss: Losses, path: str) -> etree._Element:
    element = loss.root.find(path)
    assert element is not None, path
    return element


def names(loss: Losses, tag: str) -> list[str | None]:
    return [item.get("name") for item in loss.root.iter(tag)]


def test_an_action_goes_with_its_element_and_the_others_of_its_event_stay() -> None:
    loss = losses()
    loss.element(found(loss, ".//Event[@name='one']//AnimationAction"))
    assert names(loss, "Action") == ["b", "c"]
    assert [one.what for one in loss.notes] == ["Event 'one': AnimationAction left out (version 1.0 has none)"]


def test_an_event_goes_with_the_last_of_its_actions() -> None:
    loss = losses()
    loss.element(found(loss, ".//Event[@name='two']//AnimationAction"), "nobody plays it")
    assert names(loss, "Event") == ["one"]
    assert [one.what for one in loss.notes] == ["Event 'two': AnimationAction left out (nobody plays it)"]


def test_an_entity_s_initial_actions_go_with_the_last_of_them() -> None:
    loss = losses()
    loss.element(found(loss, ".//LightStateAction"))
    assert [item.get("entityRef") for item in loss.root.iter("Private")] == ["A"]
    assert [one.what for one in loss.notes] == ["Init: LightStateAction left out (version 1.0 has none)"]


def test_an_event_that_others_may_wait_for_keeps_its_name_in_a_reactive_scenario() -> None:
    loss = losses(reactive=True)
    loss.element(found(loss, ".//Event[@name='two']//AnimationAction"))
    assert names(loss, "Event") == ["one", "two"]
    assert found(loss, ".//Event[@name='two']/Action/UserDefinedAction/CustomCommandAction").get("type") == "nothing"


def test_motion_is_never_taken_out_of_a_reactive_scenario() -> None:
    loss = losses(reactive=True)
    with pytest.raises(FormatError, match=r"version 1\.0 has no LaneChangeAction; use --mode trajectory") as refused:
        loss.element(found(loss, ".//LaneChangeAction"))
    assert str(refused.value).startswith("x.xosc:")
    assert names(loss, "Action") == ["a", "b", "c"]
    loss = losses()
    loss.element(found(loss, ".//LaneChangeAction"))  # written as a trajectory, its motion is in there
    assert names(loss, "Action") == ["a", "c"]


@pytest.mark.parametrize("reactive", [True, False])
def test_conditions_decide_on_what_happens_and_are_never_taken_out(reactive: bool) -> None:
    loss = losses(reactive=reactive)
    with pytest.raises(FormatError, match=r"version 1\.0 has no AngleCondition"):
        loss.element(found(loss, ".//AngleCondition"))


def test_what_is_gone_with_something_around_it_is_no_second_loss() -> None:
    loss = losses()
    animation = found(loss, ".//Event[@name='two']//AnimationAction")
    loss.element(animation)
    said = list(loss.notes)
    loss.element(animation)
    loss.action(animation, "again")
    assert loss.notes == said
    assert not loss.has(animation)


def test_a_remark_is_made_once() -> None:
    loss = losses()
    for _ in range(3):
        loss.note("something")
    assert [one.what for one in loss.notes] == ["something"]


def test_attributes_that_mean_what_their_absence_means_go_in_silence() -> None:
    loss = losses()
    condition = found(loss, ".//AngleCondition")
    condition.set("coordinateSystem", "entity")
    loss.attribute(condition, "coordinateSystem")
    assert not loss.notes
    assert condition.get("coordinateSystem") is None
    condition.set("coordinateSystem", "road")
    with pytest.raises(FormatError, match=r"AngleCondition/@coordinateSystem \('road'\)"):
        loss.attribute(condition, "coordinateSystem")


def test_attributes_of_others_are_named_when_they_go() -> None:
    loss = losses()
    light = found(loss, ".//LightStateAction")
    light.set("transitionTime", "2")
    loss.attribute(light, "transitionTime")
    assert [one.what for one in loss.notes] == ["LightStateAction/@transitionTime: left out (version 1.0 has none)"]


def test_white_space_of_what_goes_does_not_pile_up() -> None:
    root = etree.fromstring("<a>\n  <b/>\n  <c/>\n</a>")
    remove(root[1])
    assert etree.tostring(root) == b"<a>\n  <b/>\n</a>"
    remove(root[0])
    assert etree.tostring(root) == b"<a/>"
    held = etree.fromstring("<a>\n  <!-- kept -->\n</a>")
    tidy(held)
    assert etree.tostring(held) == b"<a><!-- kept --></a>"
