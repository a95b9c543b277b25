"""Maneuver-based motorway scenarios to start from, with their roads.

They lie as plain files in the top-level folder ``templates``, where anybody can add to them. For those that ship,
`plots` says what the road, starts and times are by their settings: what lies there is what it makes of the defaults.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from xml.sax.saxutils import quoteattr, unescape

from xosc_lateral.base.errors import FormatError, XoscLateralError, did_you_mean
from xosc_lateral.base.plugins import plugins, shipped_folder
from xosc_lateral.files.templates.plots import TEMPLATES
from xosc_lateral.files.templates.template import Settings, Template, Word

__all__ = ["TEMPLATES", "AnyTemplate", "PlainTemplate", "Template", "all_templates", "find_template"]
GROUP = "xosc_lateral.templates"  # entry points of further templates
SCENARIO, ROAD = ".xosc", ".xodr"

# A comment (to be left alone), or a declaration; a value may hold ">", which ends no tag there.
_COMMENT_OR_DECLARATION = re.compile(
    r"""<!--.*?-->|<ParameterDeclaration\b(?:[^>"']|"[^"]*"|'[^']*')*>""",
    re.DOTALL,
)
_ATTRIBUTE = re.compile(r"""(?P<name>[\w:.-]+)(?P<equals>\s*=\s*)(?P<quoted>"[^"]*"|'[^']*')""")


@dataclass(frozen=True)
class PlainTemplate:
    """A scenario file and the road beside it."""

    path: Path  # the scenario; the road has the same name

    @property
    def name(self) -> str:
        """As on the command line, and of the files."""
        return self.path.stem

    @property
    def summary(self) -> str:
        """The description in its header."""
        header = self._root.find("FileHeader")
        return "" if header is None else header.get("description", "")

    @property
    def parameters(self) -> tuple[Word, ...]:
        """What the scenario declares."""
        return tuple(
            Word(one.get("name", ""), one.get("value", ""), kind=one.get("parameterType", "string"))
            for one in self._root.iterfind("ParameterDeclarations/ParameterDeclaration")
        )

    def files(self, chosen: Mapping[str, str] | None = None) -> dict[str, str]:
        """File name -> text of the scenario, with the chosen values as declared ones, and of its road."""
        settings, text = Settings(self.parameters, chosen or {}), self._text
        for name in chosen or {}:
            text = _declared(text, name, settings.text(name))
        return {self.path.name: text, f"{self.name}{ROAD}": self.path.with_suffix(ROAD).read_text(encoding="utf-8")}

    @cached_property
    def _text(self) -> str:
        return self.path.read_text(encoding="utf-8")

    @cached_property
    def _root(self) -> ET.Element:
        try:
            return ET.fromstring(self._text)
        except ET.ParseError as error:
            raise FormatError(f"not XML: {error}", path=self.path) from error


def plain_templates(folder: Path) -> Iterator[PlainTemplate]:
    """Scenarios of a folder that have a road of their name beside them, by name."""
    for path in sorted(folder.glob(f"*{SCENARIO}")):
        if path.with_suffix(ROAD).is_file():
            yield PlainTemplate(path)


def _declared(text: str, name: str, value: str) -> str:
    """The text with another value of a declared parameter; all else, comments and layout, stays."""
    for match in _COMMENT_OR_DECLARATION.finditer(text):
        attributes = {part["name"]: part["quoted"][1:-1] for part in _ATTRIBUTE.finditer(match[0])}
        if match[0].startswith("<!--") or unescape(attributes.get("name", "")) != name:
            continue
        replaced = _ATTRIBUTE.sub(
            lambda part: part["name"] + part["equals"] + quoteattr(value) if part["name"] == "value" else part[0],
            match[0],
        )
        return text[: match.start()] + replaced + text[match.end() :]
    raise AssertionError("it is among the parsed declarations")


AnyTemplate = Template | PlainTemplate


def all_templates() -> tuple[AnyTemplate, ...]:
    """Templates with a builder, plain ones, and those of plug-ins (templates, or folders of plain ones)."""
    templates: dict[str, AnyTemplate] = {template.name: template for template in TEMPLATES}
    for plain in plain_templates(shipped_folder("templates")):
        templates.setdefault(plain.name, plain)
    for offered in plugins(GROUP).values():
        for template in plain_templates(Path(offered)) if isinstance(offered, str | Path) else [offered]:
            templates.setdefault(template.name, template)
    return tuple(templates.values())


def find_template(name: str) -> AnyTemplate:
    """The template of that name; `XoscLateralError` if there is none."""
    for template in TEMPLATES:
        if template.name == name:
            return template
    for candidate in all_templates():
        if candidate.name == name:
            return candidate
    known = [each.name for each in all_templates()]
    raise XoscLateralError(f"unknown template {name!r}{did_you_mean(name, known)}; there are {', '.join(known)}")
