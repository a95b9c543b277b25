"""What a scenario is written for: a player, and a version of the standard.

Each player's quirks are in one place: `carla` for ScenarioRunner, `esmini` for esmini; what versions of the standard
lack is in `additions`, and how they are told apart in `versions`.
"""

from __future__ import annotations

from enum import StrEnum

from msgspec import Struct

from xosc_lateral.files.openscenario.write.build import Version, named
from xosc_lateral.world.scenario import Scenario

VERSIONS: tuple[Version, ...] = ((1, 0), (1, 1), (1, 2), (1, 3), (1, 4))
"""That can be written."""


class Player(StrEnum):
    """Who is to play a written scenario."""

    STANDARD = "standard"
    ESMINI = "esmini"
    CARLA = "carla"


class TargetPlayer(Struct, frozen=True):
    """Player and version; `ValueError` for a version that can't be written, or that the player does not read."""

    player: Player = Player.STANDARD
    version: Version | None = None  # (1, 0) to (1, 4). Without: the input's own, or the only one that the player reads.

    def __post_init__(self) -> None:
        if self.version is not None and self.version not in VERSIONS:
            raise ValueError(f"version {named(self.version)} can't be written; {_VERSION_LIST} can")
        if self.player is Player.CARLA and self.version not in (None, (1, 0)):
            raise ValueError("CARLA's ScenarioRunner reads version 1.0 alone")

    def version_for(self, scenario: Scenario) -> Version:
        """The version to write."""
        if self.version is not None:
            return self.version
        if self.player is Player.CARLA:
            return (1, 0)
        return min(scenario.header.version, VERSIONS[-1])

    def adapts(self, scenario: Scenario) -> bool:
        """Whether the output is more than the input in its own version: in another one, or for a strict reader.

        Else what an input has beyond its version stays as it is.
        """
        return self.player is Player.CARLA or self.version_for(scenario) != scenario.header.version


STANDARD = TargetPlayer()


def target(player: str = Player.STANDARD.value, version: str | None = None) -> TargetPlayer:
    """From a user's words: a player's name, and a version such as "1.2"; `ValueError` for words that are neither."""
    if version is None:
        return TargetPlayer(Player(player))
    known = {named(one): one for one in VERSIONS}
    if version not in known:
        raise ValueError(f"version {version!r} can't be written; {_VERSION_LIST} can")
    return TargetPlayer(Player(player), known[version])


_VERSION_LIST = ", ".join(named(one) for one in VERSIONS)
