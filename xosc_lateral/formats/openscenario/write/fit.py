"""Make a written scenario one of its target's: another version of the standard, a player's own ways."""

from __future__ import annotations

from collections.abc import Sequence

from lxml import etree

from xosc_lateral.formats.openscenario.write.build import named
from xosc_lateral.formats.openscenario.write.carla import fit_carla
from xosc_lateral.formats.openscenario.write.esmini import fit_esmini
from xosc_lateral.formats.openscenario.write.literal import fill_in, inline_catalogs
from xosc_lateral.formats.openscenario.write.losses import Losses
from xosc_lateral.formats.openscenario.write.target import Player, TargetPlayer
from xosc_lateral.formats.openscenario.write.versions import fit_version
from xosc_lateral.motion.nominal import NominalMotion
from xosc_lateral.scenario import Scenario
from xosc_lateral.scenario.parameters import Scope


def fit(
    root: etree._Element,
    scenario: Scenario,
    motion: NominalMotion,
    target: TargetPlayer,
    scope: Scope,
    converted: Sequence[str] | None = None,
) -> tuple[str, ...]:
    """Change what the target does not know, and say so.

    Parameters
    ----------
    root : element
        Of the output, its file references still as seen from the scenario. Changed in place.
    scenario : Scenario
    motion : NominalMotion
    target : TargetPlayer
    scope : Scope
        Global parameters.
    converted : sequence of str, optional
        Entities that follow trajectories; None: maneuvers are still maneuvers.

    Returns
    -------
    tuple of str
        A line for everything that was left out or filled in.

    Raises
    ------
    FormatError
        For what the target does not know and the scenario can't do without.
    """
    version, source = target.version_for(scenario), scenario.header.version
    losses = Losses(root, scenario.path, f"version {named(version)}", reactive=converted is None)
    if target.adapts(scenario):
        inline_catalogs(losses, scenario, scope)
        if version == (1, 0):
            fill_in(losses, scope, parameters=target.player is Player.CARLA)
        fit_version(losses, source, version)
    if target.player is Player.ESMINI:
        losses.target = "esmini"
        fit_esmini(losses)
    elif target.player is Player.CARLA:
        losses.target = "CARLA's ScenarioRunner"
        fit_carla(losses, scenario, motion, converted or ())
    return tuple(losses.notes)
