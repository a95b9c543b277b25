"""Whose maneuvers a version of the standard can't express, so that they have to be written as trajectories."""

from __future__ import annotations

from collections.abc import Collection

from xosc_lateral.formats.openscenario.write.build import Version, named
from xosc_lateral.formats.openscenario.write.draft import source_of
from xosc_lateral.formats.openscenario.write.versions import newer_than
from xosc_lateral.formats.xml import parse_xml
from xosc_lateral.motion.nominal import NominalMotion
from xosc_lateral.scenario import Scenario
from xosc_lateral.scenario.private_actions import MOTION, ConnectTrailerAction


def motion_unknown_to(
    version: Version, scenario: Scenario, motion: NominalMotion, entities: Collection[str]
) -> dict[str, str]:
    """Entities with a maneuver that a version does not know, and which.

    Parameters
    ----------
    version : Version
    scenario : Scenario
    motion : NominalMotion
        Its run.
    entities : collection of str
        Those to look at.
    """
    if version >= scenario.header.version:
        return {}
    root = parse_xml(scenario.source, scenario.path)
    found: dict[str, str] = {}
    for played in motion.actions:
        actor, content = played.actor, played.action.content
        if actor is None or actor not in entities or actor in found or not isinstance(content, MOTION):
            continue
        what = newer_than(source_of(played.action, scenario, root), version)
        if what is not None:
            found[actor] = f"version {named(version)} has no {what}"
    trailers = {entity.trailer for entity in scenario.entities if entity.trailer is not None}
    trailers |= {
        p.action.content.trailer_ref for p in motion.actions if isinstance(p.action.content, ConnectTrailerAction)
    }
    if version < (1, 3):
        found |= dict.fromkeys(sorted(trailers & set(entities)), f"version {named(version)} has no Trailer")
    return found
