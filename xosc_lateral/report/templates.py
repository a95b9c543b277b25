"""Templates and their settings, as text and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from xosc_lateral.templates import AnyTemplate
from xosc_lateral.templates.parameter import Choice, Number, Parameter


def as_text(templates: Sequence[AnyTemplate], *, with_settings: bool) -> str:
    """One line per template, and on request one per setting."""
    width = max(len(template.name) for template in templates)
    lines = []
    for template in templates:
        lines.append(f"{template.name:<{width}}  {template.summary}")
        if with_settings:
            lines += ["", *_settings(template.parameters)]
    return "\n".join(lines)


def templates_record(templates: Sequence[AnyTemplate]) -> list[dict[str, Any]]:
    """Templates with all settings, as plain values."""
    return [
        {
            "name": template.name,
            "summary": template.summary,
            "settings": [_setting(parameter) for parameter in template.parameters],
        }
        for template in templates
    ]


def _settings(parameters: Sequence[Parameter]) -> list[str]:
    rows = [
        (each.name, each.shown_default, each.unit if isinstance(each, Number) else "", f"({each.allowed})", each.what)
        for each in parameters
    ]
    widths = [max(len(row[column]) for row in rows) for column in range(4)]
    return [
        "  " + "  ".join([*(f"{text:<{width}}" for text, width in zip(row, widths, strict=False)), row[-1]])
        for row in rows
    ]


def _setting(parameter: Parameter) -> dict[str, Any]:
    common = {"name": parameter.name, "default": parameter.default, "what": parameter.what}
    if isinstance(parameter, Number):
        return common | {"unit": parameter.unit, "low": parameter.low, "high": parameter.high}
    if isinstance(parameter, Choice):
        return common | {"options": list(parameter.options)}
    return common | {"type": parameter.kind}
