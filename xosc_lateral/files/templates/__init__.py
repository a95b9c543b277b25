"""Maneuver-based motorway scenarios to start from, with their roads.

They lie as plain files in the top-level folder ``templates``, where anybody can add to them. For those that ship,
`plots` says what the road, starts and times are by their settings: what lies there is what it makes of the defaults.
"""

from __future__ import annotations

from pathlib import Path

from xosc_lateral.base.errors import XoscLateralError, did_you_mean
from xosc_lateral.base.plugins import plugins
from xosc_lateral.base.shipped import shipped_folder
from xosc_lateral.files.templates.plain import PlainTemplate, plain_templates
from xosc_lateral.files.templates.plots import TEMPLATES
from xosc_lateral.files.templates.template import Template

__all__ = ["TEMPLATES", "AnyTemplate", "PlainTemplate", "Template", "all_templates", "find_template"]

GROUP = "xosc_lateral.templates"  # entry points of further templates

AnyTemplate = Template | PlainTemplate


def all_templates() -> tuple[AnyTemplate, ...]:
    """Templates with a builder, plain ones, and those of plug-ins (templates, or folders of plain ones)."""
    found: dict[str, AnyTemplate] = {template.name: template for template in TEMPLATES}
    for plain in plain_templates(shipped_folder("templates")):
        found.setdefault(plain.name, plain)
    for offered in plugins(GROUP).values():
        for one in plain_templates(Path(offered)) if isinstance(offered, str | Path) else [offered]:
            found.setdefault(one.name, one)
    return tuple(found.values())


def find_template(name: str) -> AnyTemplate:
    """The template of that name; `XoscLateralError` if there is none."""
    for template in TEMPLATES:
        if template.name == name:
            return template
    for one in all_templates():
        if one.name == name:
            return one
    known = [each.name for each in all_templates()]
    raise XoscLateralError(f"unknown template {name!r}{did_you_mean(name, known)}; there are {', '.join(known)}")
