"""What `reconstruct` can be told: one declaration for Python and the command line."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict

from xosc_lateral.workflows import options as say
from xosc_lateral.workflows.opened import RoadLike
from xosc_lateral.workflows.options import Paths, option

VERSIONS = ("1.0", "1.1", "1.2", "1.3")  # of the standard, that can be written


def _version(text: str) -> str:
    if text not in VERSIONS:
        raise ValueError(f"version {text!r}, expected {', '.join(VERSIONS)}")
    return text


@say.documented
@dataclass(frozen=True, slots=True)
class ReconstructSettings:
    """What is reconstructed, and how: keywords of `reconstruct`, and the options of the command line.

    Parameters
    ----------
    relative : bool
        Lane changes and braking begin at a distance to another vehicle, where the recording bears it out.
    """

    # fmt: off
    format: str | None = option(
        None, str, kind=str | None, show_default=False,
        help="dlr-ht, dlr-ut, levelx, osi, commonroad, fcd, tracks; default: by the file.")
    road: RoadLike | None = option(
        None, lambda stated: stated, kind=Path | None, show_default=False,
        help="OpenDRIVE file, or SUMO network, that it was recorded on.")
    case: str | None = option(
        None, str, kind=str | None, metavar="NAME", show_default=False, help="Which of several recordings in a file.")
    begin: float | None = option(None, float, "--from", kind=float | None, show_default=False, help="Begin there [s].")
    end: float | None = option(None, float, "--to", kind=float | None, show_default=False, help="End there [s].")
    vehicles: frozenset[str] | None = option(
        None, say.names, kind=list[str] | None, metavar="ID", help="This vehicle alone; may be repeated.")
    around: str | None = option(
        None, str, kind=str | None, metavar="ID", show_default=False, help="This vehicle and those who come near it.")
    window: float = option(
        60.0, float, kind=float, min=1, max=3600, help="Length of the part that --around takes [s].")
    host: str | None = option(
        None, str, kind=str | None, metavar="ID", show_default=False,
        help="The vehicle under test; default: the host of an OSI trace; none: no vehicle.")
    error: float = option(
        0.5, float, kind=float, min=0.01,
        help="Positions along the road are within this [m]: the smaller, the more corners.")
    version: str = option("1.2", _version, kind=str, metavar="1.0..1.3", help="Version of OpenSCENARIO to write.")
    relative: bool = option(
        False, bool, "--relative", kind=bool, help="Cut-ins and braking begin at a distance to another vehicle.")
    exact: bool = option(False, bool, "--exact", kind=bool, help="Recorded paths as trajectories, no maneuvers.")
    fit: bool = option(False, bool, "--fit", kind=bool, help="Fit a profile to everybody who drove long enough.")
    library: tuple[Path, ...] = option((), say.paths)
    # fmt: on


class ReconstructKeywords(TypedDict, total=False):
    """The same names for type checkers, with what a call may be given."""

    format: str | None
    road: RoadLike | None
    case: str | None
    begin: float | None
    end: float | None
    vehicles: Collection[str] | None
    around: str | None
    window: float
    host: str | None
    error: float
    version: str
    relative: bool
    exact: bool
    fit: bool
    library: Paths
