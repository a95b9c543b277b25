"""What a profile says of itself: where it comes from, and what it describes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from msgspec import Meta, field

from xosc_lateral.driver.records import Record, plain


class Provenance(Record, frozen=True):
    """Where a profile comes from.

    Parameters
    ----------
    source : str
        The drives in words.
    licence : str
        Of the drives, and what it asks of who passes the profile on.
    hours : float
        Driving that was fitted, after cutting. [h]
    drives, runs : int
        How many.
    inputs : mapping of str to str
        File name -> SHA-256 of every table.
    fit : mapping
        Model and settings of the fit.
    evaluation : mapping
        Results on held-out drives, if there are any.
    package_version : str
        That wrote it.
    notes : str
    """

    source: Annotated[str, Meta(description="The drives in words.")] = ""
    licence: Annotated[str, Meta(description="Of the drives.")] = ""
    hours: Annotated[float, Meta(ge=0, description="Driving fitted, after cutting. [h]")] = 0.0
    drives: Annotated[int, Meta(ge=0)] = 0
    runs: Annotated[int, Meta(ge=0)] = 0
    inputs: Annotated[Mapping[str, str], Meta(description="File name to SHA-256.")] = field(default_factory=dict)
    fit: Annotated[Mapping[str, Any], Meta(description="Model and settings of the fit.")] = field(default_factory=dict)
    evaluation: Annotated[Mapping[str, Any], Meta(description="Results on held-out drives.")] = field(
        default_factory=dict
    )
    package_version: str = ""
    notes: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        values: dict[str, Any] = plain(self)
        return values


class Metadata(Record, frozen=True):
    """What a profile is of, to be searched by; all of it is optional.

    Parameters
    ----------
    version : str
        Of the profile itself, as its owners count: "2", "1.3".
    driver, vehicle, road : str
        Whom and what was measured, and where: "professional", "truck", "motorway".
    country : str
        ISO 3166-1 alpha-2: "DE".
    date : str
        When the drives were recorded, ISO 8601: "2026-05", "2026-05-03/2026-06-01".
    licence : str
        Of the profile.
    tags : tuple of str
    """

    version: str = ""
    driver: str = ""
    vehicle: str = ""
    road: str = ""
    country: str = ""
    date: str = ""
    licence: str = ""
    tags: tuple[str, ...] = ()
