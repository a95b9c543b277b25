"""Convert one scenario: read, play, enrich, write."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from xosc_lateral.enrich.result import Enriched
from xosc_lateral.pipeline.settings import ConvertSettings


@dataclass(frozen=True, slots=True)
class Provenance:
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
    """

    package_version: str
    inputs: Mapping[str, str]
    profiles: Mapping[str, tuple[str, str]]
    seed: int
    variant: int
    parameters: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, slots=True)
class Conversion:
    """One converted scenario.

    Parameters
    ----------
    source, output : Path
    output_hash : str
        SHA-256 of the output's bytes.
    enriched : Enriched
        Nominal and enriched motion, segments, gaps.
    provenance : Provenance
    warnings : tuple of str
        What a user has to know, a line each.
    """

    source: Path
    output: Path
    output_hash: str
    enriched: Enriched
    provenance: Provenance
    warnings: tuple[str, ...]


def convert_scenario(source: Path, output: Path, settings: ConvertSettings, *, variant: int = 0) -> Conversion:
    """Convert one scenario and write it.

    Raises
    ------
    XoscLateralError
        When the input is at fault; nothing is written then.
    OSError
        When the output can't be written; nothing is left half-written.
    """
    raise NotImplementedError
