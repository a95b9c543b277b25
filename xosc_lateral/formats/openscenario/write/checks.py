"""What has to hold before anything is written."""

from __future__ import annotations

from lxml import etree

from xosc_lateral.errors import PlaybackError
from xosc_lateral.formats.openscenario.provenance import refuse_converted
from xosc_lateral.motion.nominal import NominalMotion
from xosc_lateral.scenario import Scenario


def check_convertible(root: etree._Element, scenario: Scenario, motion: NominalMotion) -> None:
    """Refuse a scenario that was converted before, or that is over before anything has moved.

    Raises
    ------
    FormatError
        With the reason; a `PlaybackError` for a run of 0 s.
    """
    refuse_converted(root, scenario.path)
    if motion.end_time <= 0.0:
        trigger = scenario.storyboard.stop_trigger
        place = scenario.storyboard.place if trigger is None else trigger.place
        raise PlaybackError(
            f"the scenario is over at 0 s ({motion.ended_by}): there is nothing to convert",
            path=scenario.path,
            line=place.line,
            element=place.element,
        )
