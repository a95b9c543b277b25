"""Versions of the profile file: what a file must say of itself, and older files as the present version has them.

1
    As of package version 0.1.
2
    `id` (was `name`); `metadata`; model `autoregressive` (was `best`), its `coarse_volatility` and `fine_volatility`
    (were `..._liveliness`); `sensor`; effects may have `between_drivers`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from xosc_lateral.errors import DriverProfileError

FORMAT = "xosc-lateral driver profile"

VERSION = 2
"""Of the file format. A reader understands its own and every older version."""

_MODELS = {"best": "autoregressive"}
_FIELDS = {"coarse_liveliness": "coarse_volatility", "fine_liveliness": "fine_volatility"}


def upgraded(values: object) -> dict[str, Any]:
    """A profile file's values as the present version writes them, without format and version.

    Raises
    ------
    DriverProfileError
        If the file is none of ours, or of a newer version.
    """
    if not isinstance(values, Mapping) or values.get("format") != FORMAT:
        raise DriverProfileError(f'not a driver profile: "format" is not "{FORMAT}"')
    version = _version_of(values)
    rest = {name: value for name, value in values.items() if name not in ("format", "version")}
    return _from_1(rest) if version == 1 else rest


def _version_of(values: Mapping[str, Any]) -> int:
    """Of the file's format; refused if it is none, or newer than this package."""
    version = values.get("version")
    if not isinstance(version, int) or isinstance(version, bool) or version < 1:
        raise DriverProfileError(f"version {version!r}, expected a whole number from 1")
    if version > VERSION:
        raise DriverProfileError(
            f"written by a newer version of xosc-lateral (file format {version}; this one reads up to {VERSION}): "
            "update the package"
        )
    return version


def _from_1(values: dict[str, Any]) -> dict[str, Any]:
    renamed = {"id" if name == "name" else name: value for name, value in values.items()}
    model = renamed.get("model")
    if isinstance(model, Mapping):
        kind = model.get("kind")
        fields = {_FIELDS.get(name, name): value for name, value in model.items()}
        known = {"kind": _MODELS.get(kind, kind)} if isinstance(kind, str) else {}
        renamed["model"] = fields | known
    return renamed


def as_version_1(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values of the present version as version 1 had them, for what was named by a hash of those."""
    older = {"version": 1} | {
        "name" if name == "id" else name: value
        for name, value in values.items()
        if name not in ("metadata", "sensor", "version")
    }
    names = {new: old for old, new in _FIELDS.items()}
    kinds = {new: old for old, new in _MODELS.items()}
    model = {names.get(name, name): value for name, value in values["model"].items()}
    older["model"] = model | {"kind": kinds.get(model["kind"], model["kind"])}
    return older
