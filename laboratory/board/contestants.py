"""What is on the board: models that are fitted for it, and profiles as they are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

from laboratory.board.models.base import LateralModel
from laboratory.board.models.catalogue import MODELS
from laboratory.board.models.profiles import ProfileModel
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.model.profile import DriverProfile

AS_IT_IS = "not fitted on these drives' halves: sampled as the file has it"


@dataclass(frozen=True)
class Contestant:
    """One row to be.

    Parameters
    ----------
    key, title, source, departures : str
        See `LateralModel`; `key` is unique on the board.
    fit : callable
        Training runs -> model.
    """

    key: str
    title: str
    source: str
    departures: str
    fit: Callable[[Sequence[Run]], LateralModel]


def contestants(models: Sequence[str] | None, profiles: Sequence[DriverProfile]) -> list[Contestant]:
    """Models by their names (None: all), then profiles.

    Raises
    ------
    ValueError
        For a model that there is not, or a name that comes twice.
    """
    keys = list(MODELS if models is None else models)
    for key in keys:
        if key not in MODELS:
            raise ValueError(f"no model {key!r}; there are {', '.join(MODELS)}")
    found = [_model(key) for key in keys] + [_profile(profile) for profile in profiles]
    names = [one.key for one in found]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"{name!r} is on the board twice")
    return found


def _model(key: str) -> Contestant:
    model = MODELS[key]
    return Contestant(key, model.title, model.source, model.departures, model.fit)


def _profile(profile: DriverProfile) -> Contestant:
    source = profile.provenance.source or "no source in the profile"
    return Contestant(f"profile {profile.name}", f"profile {profile.name}", source, AS_IT_IS, lambda _: _Fixed(profile))


class _Fixed(ProfileModel):
    """A profile that stays as it is."""

    title: ClassVar[str] = "profile"
    source: ClassVar[str] = "the profile's file"
    departures: ClassVar[str] = AS_IT_IS

    @classmethod
    def fit(cls, runs: Sequence[Run]) -> _Fixed:
        """A profile is not fitted here."""
        raise NotImplementedError
