"""All core models that a profile can hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from xosc_lateral.driver.best import BestModel
from xosc_lateral.driver.core import CoreModel
from xosc_lateral.driver.two_level import TwoLevelModel
from xosc_lateral.errors import DriverProfileError

CORE_MODELS: tuple[type[CoreModel], ...] = (TwoLevelModel, BestModel)
"""Every model that a profile file may name, by its `kind`."""


def core_model_from_dict(values: Mapping[str, Any]) -> CoreModel:
    """Read the model of a profile file.

    Raises
    ------
    DriverProfileError
        If its kind is unknown, a field is missing, unknown or contradicts another.
    """
    kind = values.get("kind")
    for model in CORE_MODELS:
        if model.kind == kind:
            try:
                return model.from_dict(values)
            except KeyError as error:
                raise DriverProfileError(f"model {kind}: no {error}") from error
            except (TypeError, ValueError) as error:
                raise DriverProfileError(f"model {kind}: {error}") from error
    raise DriverProfileError(f"model {kind!r} is unknown; known are {', '.join(model.kind for model in CORE_MODELS)}")
