"""All core models that a profile can hold, and how each is fitted. A new one is listed here, or is a plug-in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, reduce
from operator import or_
from typing import Any

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.plugins import entry_points
from xosc_lateral.drivers.model.core.autoregressive.model import AutoregressiveModel
from xosc_lateral.drivers.model.core.base import CoreModel
from xosc_lateral.drivers.model.core.two_level.model import TwoLevelModel

ENTRY_POINTS = "xosc_lateral.models"
"""Group of entry points under which other packages offer core models: each names a `KnownModel`."""

ALIASES = {"best": "autoregressive"}
"""Other names of models, on the command line."""


FitCore = Callable[[Sequence[FloatArray], Sequence[str]], CoreModel]
"""From relative offsets and the name of each run's drive to a core model."""


@dataclass(frozen=True, slots=True)
class KnownModel:
    """A core model and its fit.

    ``fit(rel_offsets, drives)`` gets relative offsets [-], one array per run at the model's step, and for each run the
    name of its drive; it gives a `model`, or raises `NotEnoughDataError`.
    """

    model: type[CoreModel]
    fit: FitCore


def _fit_two_level(rel_offsets: Sequence[FloatArray], drives: Sequence[str]) -> CoreModel:
    from xosc_lateral.drivers.fitting.models.two_level import fit_two_level  # who samples does not fit

    return fit_two_level(rel_offsets)


def _fit_autoregressive(rel_offsets: Sequence[FloatArray], drives: Sequence[str]) -> CoreModel:
    from xosc_lateral.drivers.fitting.models.autoregressive_fit import fit_autoregressive

    return fit_autoregressive(rel_offsets, drives)


CORE_MODELS = (KnownModel(TwoLevelModel, _fit_two_level), KnownModel(AutoregressiveModel, _fit_autoregressive))
"""The models of this package; a profile file names them by their `kind`."""


@cache
def known_models() -> dict[str, KnownModel]:
    """Every model that a profile may hold, by its kind: those here, then those of installed plug-ins.

    Raises `DriverProfileError` if a plug-in offers something else than a core model, or one of a kind that is taken.
    """
    known = {entry.model.kind: entry for entry in CORE_MODELS}
    for plugin in entry_points(group=ENTRY_POINTS):
        entry = plugin.load()
        if not (isinstance(entry, KnownModel) and issubclass(entry.model, CoreModel)):
            raise DriverProfileError(f"plug-in {plugin.name}: {plugin.value} is not a KnownModel")
        kind = entry.model.kind
        if kind in known:
            raise DriverProfileError(f"plug-in {plugin.name}: there is a model of the kind {kind!r} already")
        known[kind] = entry
    return known


def model_named(name: str) -> KnownModel:
    """The model of a kind, by its name or an older one.

    Raises `DriverProfileError` if there is none; lists those that there are.
    """
    name = ALIASES.get(str(name), str(name))
    here = {entry.model.kind: entry for entry in CORE_MODELS}
    known = here.get(name) or known_models().get(name)
    if known is None:
        raise DriverProfileError(f"no core model {name!r}; known are {', '.join(known_models())}")
    return known


def any_model(kind: str | None = None) -> Any:
    """The union of all core models: what a profile file's model is read as.

    Plug-ins are searched when the kind is not among the models here, or none is given.
    """
    here = [entry.model for entry in CORE_MODELS]
    if kind in {model.kind for model in here}:
        return reduce(or_, here)
    return reduce(or_, (entry.model for entry in known_models().values()))
