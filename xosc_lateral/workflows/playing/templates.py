"""`list_templates` and `write_template`: maneuver-based scenarios to start from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from xosc_lateral.base.lazy import pd
from xosc_lateral.base.texts import aligned
from xosc_lateral.files.atomic import together, write_atomically
from xosc_lateral.files.output_paths import claim, output_folder, template_mark
from xosc_lateral.files.templates import AnyTemplate, all_templates, find_template
from xosc_lateral.files.templates.template import Parameter
from xosc_lateral.workflows.result import PathLike, Result


def list_templates(name: str | None = None) -> TemplateList:
    """All templates, or one with its settings.

    Raises
    ------
    XoscLateralError
        If there is none of that name.
    """
    return TemplateList(all_templates() if name is None else (find_template(name),), name is not None)


def write_template(name: str, folder: PathLike, *, force: bool = False, **settings: object) -> tuple[Path, ...]:
    """Write a template's scenario and its road.

    Parameters
    ----------
    name : str
        `list_templates` has them.
    folder : str or Path
        To write to; made if it is missing.
    force : bool
        Replace files that this package did not write, or that were edited since.
    settings
        Values that differ from the defaults; ``list_templates(name)`` has them with units and ranges.

    Returns
    -------
    tuple of Path
        The scenario, and its road.

    Raises
    ------
    XoscLateralError
        An unknown template or setting, or a value out of range.
    """
    files = find_template(name).files({key: str(value) for key, value in settings.items()})
    output = output_folder(folder)
    paths = {output / file: text for file, text in files.items()}
    claim(paths, force=force)
    with together():
        for path, text in paths.items():
            write_atomically(path, text.rstrip() + "\n" + template_mark(text))
    return tuple(paths)


@dataclass(frozen=True, eq=False, repr=False)
class TemplateList(Result):
    """Templates with their settings."""

    _templates: tuple[AnyTemplate, ...]
    _detailed: bool

    @property
    def names(self) -> tuple[str, ...]:
        """As `write_template` takes them."""
        return tuple(template.name for template in self._templates)

    def headline(self) -> str:
        """One line."""
        return ", ".join(self.names)

    def __str__(self) -> str:
        width = max(map(len, self.names))
        lines = []
        for template in self._templates:
            lines.append(f"{template.name:<{width}}  {template.summary}")
            lines += ["", *_settings(template.parameters)] if self._detailed else []
        return "\n".join(lines)

    def to_frame(self) -> pd.DataFrame:
        """One row per template and setting: `template`, `name`, `default`, `unit`, `allowed`, `what`."""
        names = ("name", "shown_default", "unit", "allowed", "what")
        rows = [
            [template.name, *(getattr(one, name) for name in names)]
            for template in self._templates
            for one in template.parameters
        ]
        return pd.DataFrame(rows, columns=["template", "name", "default", "unit", "allowed", "what"])

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""
        listed = [
            {"name": one.name, "summary": one.summary, "settings": [each.to_dict() for each in one.parameters]}
            for one in self._templates
        ]
        return {"templates": listed}


def _settings(parameters: Sequence[Parameter]) -> list[str]:
    """A line each, in columns."""
    rows = [
        (one.name, one.shown_default, "" if one.unit == "-" else one.unit, f"({one.allowed})", one.what)
        for one in parameters
    ]
    return [f"  {line}" for line in aligned(rows)]
