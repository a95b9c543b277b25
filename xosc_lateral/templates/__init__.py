"""Maneuver-based motorway scenarios to start from, one per file, with their roads."""

from __future__ import annotations

from collections.abc import Sequence

from xosc_lateral.errors import XoscLateralError
from xosc_lateral.templates.braking_leader import BRAKING_LEADER
from xosc_lateral.templates.curves import CURVES
from xosc_lateral.templates.cut_in import CUT_IN
from xosc_lateral.templates.dense_traffic import DENSE_TRAFFIC
from xosc_lateral.templates.jam_end import JAM_END
from xosc_lateral.templates.overtake_truck import OVERTAKE_TRUCK
from xosc_lateral.templates.template import Template

__all__ = ["TEMPLATES", "Template", "find_template", "read_settings"]

TEMPLATES = (CUT_IN, BRAKING_LEADER, OVERTAKE_TRUCK, CURVES, JAM_END, DENSE_TRAFFIC)


def find_template(name: str) -> Template:
    """The template of that name; `XoscLateralError` if there is none."""
    for template in TEMPLATES:
        if template.name == name:
            return template
    raise XoscLateralError(f"unknown template {name!r}; there are {', '.join(each.name for each in TEMPLATES)}")


def read_settings(texts: Sequence[str]) -> dict[str, str]:
    """Settings from ``KEY=VALUE`` texts, the last one of a key counts; `XoscLateralError` if one has another form."""
    settings = {}
    for text in texts:
        key, equals, value = text.partition("=")
        if not (equals and key.strip() and value.strip()):
            raise XoscLateralError(f"setting {text!r}: expected KEY=VALUE")
        settings[key.strip()] = value.strip()
    return settings
