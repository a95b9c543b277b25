"""A conversion as data: what was made of a scenario, and what went into it. The report and the manifest read it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from xosc_lateral.enrich.result import Enriched


@dataclass(frozen=True, slots=True)
class ConversionProvenance:
    """What went into an output: enough to make the same bytes again.

    Parameters
    ----------
    package_version : str
    behaviour : int
        `version.BEHAVIOUR` of the program.
    scenario : str
        Where the scenario lies, as seen from the output.
    inputs : mapping of str to str
        File name, as seen from the scenario -> SHA-256 of every file that was read (scenario, road, catalogs, context).
    profiles : mapping of str to (str, str)
        Enriched entity -> name and SHA-256 of its profile.
    options : mapping
        What was asked for: `ConvertSettings.record`.
    variant : int
        From 1, as in file names.
    version : str
        Of the standard that was written.
    ego : tuple of str
        Vehicles under test: left as they are. Empty: there is none, and everything is replayed.
    modes : mapping of str to str
        Vehicle that was enriched -> "trajectory" or "lane-offset".
    content_sha256 : str
        Of the output without its provenance.
    """

    package_version: str
    behaviour: int
    scenario: str
    inputs: Mapping[str, str]
    profiles: Mapping[str, tuple[str, str]]
    options: Mapping[str, Any]
    variant: int
    version: str
    ego: tuple[str, ...]
    modes: Mapping[str, str]
    content_sha256: str

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
