"""JSON Schema of a profile file, generated from the types: what `make schema` writes."""

from __future__ import annotations

import json
from typing import Any, get_origin

import msgspec
import numpy as np

from xosc_lateral.drivers.model.core.registry import CORE_MODELS
from xosc_lateral.drivers.model.profile import FORMAT, VERSION, file_type
from xosc_lateral.files.profiles import SCHEMA


def _schema_hook(kind: type) -> dict[str, Any]:
    """JSON Schema of what msgspec doesn't know: arrays."""
    if kind is np.ndarray or get_origin(kind) is np.ndarray:
        return {"type": "array", "items": {"type": ["number", "array"]}}
    raise NotImplementedError(kind)


def profile_schema() -> dict[str, Any]:
    """Plug-ins are not in it."""
    schema = msgspec.json.schema(file_type(CORE_MODELS[0].model.kind, frozenset()), schema_hook=_schema_hook)
    definition = schema["$defs"]["DriverProfile"]
    head = {"format": {"const": FORMAT}, "version": {"const": VERSION}}
    definition["properties"] = head | definition["properties"]
    definition["required"] = [*head, *definition["required"]]
    definition["title"] = f"Driver profile of xosc-lateral, version {VERSION}"
    definition["description"] = "Offsets are relative to the lane width, positive to the left of travel."
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


if __name__ == "__main__":
    SCHEMA.write_text(json.dumps(profile_schema(), indent=1, ensure_ascii=False) + "\n")
