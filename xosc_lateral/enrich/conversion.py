"""A conversion as data: what was made of a scenario, and what went into it. The report and the manifest read it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from xosc_lateral.enrich.result import Enriched


@dataclass(frozen=True, slots=True)
class ConversionProvenance:
    """What went into an output: enough to make the same bytes again.

    Parameters
    ----------
    package_version : str
    inputs : mapping of str to str
        File name -> SHA-256 of every file that was read (scenario, road, catalogs, context table).
    profiles : mapping of str to (str, str)
        Enriched entity -> name and SHA-256 of its profile.
    seed, variant : int
    parameters : mapping of str to str
        Scenario parameters that were replaced.
    with_sensor : bool
        Offsets hold the sensor error of the drives that profiles were fitted on; else the driver alone.
    player, version : str
        What it was written for; version of the standard.
    ego : tuple of str
        Vehicles under test: left as they are. Empty: there is none, and everything is replayed.
    modes : mapping of str to str
        Vehicle that was enriched -> "trajectory" or "lane-offset".
    only : tuple of str or None
        Who alone was to be enriched.
    attempts : int
        Samplings at most while vehicles touch or leave their lane.
    neighbours : str
        Whose answer to vehicles beside them drivers have: "profile", "borrow" or "none".
    behaviour : int
        `version.BEHAVIOUR` of the program.
    """

    package_version: str
    inputs: Mapping[str, str]
    profiles: Mapping[str, tuple[str, str]]
    seed: int
    variant: int
    parameters: Mapping[str, str] = field(default_factory=dict)
    with_sensor: bool = False
    player: str = "standard"
    version: str = ""
    ego: tuple[str, ...] = ()
    modes: Mapping[str, str] = field(default_factory=dict)
    only: tuple[str, ...] | None = None
    attempts: int = 1
    neighbours: str = "borrow"
    behaviour: int = 1

    @property
    def mode(self) -> str:
        """Of all vehicles that were enriched: "trajectory", "lane-offset", "mixed"; empty: nobody was."""
        found = sorted(set(self.modes.values()))
        return "mixed" if len(found) > 1 else "".join(found)


@dataclass(frozen=True, eq=False, slots=True)
class ConvertedScenario:
    """One converted scenario.

    Parameters
    ----------
    source, output : Path
    output_sha256 : str
        SHA-256 of the output's bytes.
    enriched : Enriched
        Nominal and enriched motion, segments, gaps.
    provenance : ConversionProvenance
    warnings : tuple of str
        What a user has to know, a line each.
    data : bytes
        The converted scenario, if it was not to be written.
    is_replay : bool
        Everything happens by the clock of the nominal run, whoever drives.
    """

    source: Path
    output: Path
    output_sha256: str
    enriched: Enriched
    provenance: ConversionProvenance
    warnings: tuple[str, ...]
    data: bytes = b""
    is_replay: bool = True
