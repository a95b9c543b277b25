"""The state of a random process as plain JSON values, to be saved and gone on from."""

from __future__ import annotations

from dataclasses import is_dataclass
from typing import Any

import numpy as np

_OWN = __name__.rpartition(".")[0]
"""Objects of this package are looked into; everything else has to be a value."""


def state_of(thing: object) -> dict[str, Any]:
    """State of an object: numbers, arrays and random generators in its attributes, and in those of its parts.

    Parameters that never change (frozen dataclasses) and functions are left out: `restore` needs an object that was
    made with the same ones.

    Raises
    ------
    TypeError
        When an attribute is none of these.
    """
    return {name: _encoded(value, name) for name, value in _attributes(thing).items() if not _is_constant(value)}


def restore(thing: object, state: dict[str, Any]) -> None:
    """Bring an object into the state that `state_of` gave for another one made with the same parameters.

    Raises
    ------
    KeyError
        When the state lacks an attribute.
    """
    for name, value in _attributes(thing).items():
        if not _is_constant(value):
            setattr(thing, name, _decoded(state[name], value))


def _attributes(thing: object) -> dict[str, Any]:
    slots = [name for kind in type(thing).__mro__ for name in getattr(kind, "__slots__", ())]
    own = {name: getattr(thing, name) for name in slots if hasattr(thing, name)}
    return own | getattr(thing, "__dict__", {})


def _is_constant(value: object) -> bool:
    frozen = is_dataclass(value) and getattr(type(value), "__dataclass_params__").frozen  # noqa: B009 (mypy)
    return callable(value) or frozen or isinstance(value, np.random.SeedSequence)


def _encoded(value: Any, name: str) -> Any:
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.integer | np.floating | np.bool_):
        return value.item()
    if isinstance(value, np.ndarray):
        return {"array": value.ravel().tolist(), "shape": list(value.shape), "dtype": str(value.dtype)}
    if isinstance(value, np.random.Generator):
        return {"generator": value.bit_generator.state}
    if isinstance(value, list | tuple):
        return [_encoded(item, name) for item in value]
    if type(value).__module__.startswith(_OWN):
        return {"object": state_of(value)}
    raise TypeError(f"{name}: a {type(value).__name__} can't be saved")


def _decoded(saved: Any, present: Any) -> Any:
    if isinstance(saved, list):
        items = [_decoded(item, _at(present, index)) for index, item in enumerate(saved)]
        return tuple(items) if isinstance(present, tuple) else items
    if not isinstance(saved, dict):
        return saved
    if "array" in saved:
        return np.array(saved["array"], dtype=saved["dtype"]).reshape(saved["shape"])
    if "generator" in saved:
        generator = np.random.default_rng()
        generator.bit_generator.state = saved["generator"]
        return generator
    restore(present, saved["object"])
    return present


def _at(items: Any, index: int) -> Any:
    return items[index] if isinstance(items, list | tuple) and index < len(items) else None
