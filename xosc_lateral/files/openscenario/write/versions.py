"""Write a scenario in another version of the standard: what the other one calls differently, asks for, or lacks.

Every version since 1.0 takes what the ones before it wrote, but for a few choices that 1.3 made strict; so going up is
a matter of those. Going down, names are put back (`older`), what was made optional is filled in with what it meant, and
the rest of what the version before lacks is taken out and named. What each version lacks are facts of the schemas: they
stand in `resources/openscenario_versions.toml`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from lxml import etree

from xosc_lateral.files.openscenario.element import child_of, children_of, elements, local_name, parent_of
from xosc_lateral.files.openscenario.write import build, older
from xosc_lateral.files.openscenario.write.build import Version
from xosc_lateral.files.openscenario.write.losses import Losses, remove

_VERSIONS_FILE = Path(__file__).resolve().parents[3] / "resources" / "openscenario_versions.toml"

NEWEST_MINOR = 4

_STRICT_SINCE_MINOR = 3
"""From this version on, choices hold exactly one element, and an orientation without a type is relative."""


@cache
def version_facts() -> Mapping[str, Any]:
    """What each version has that the one before lacks, by ``version_1_MINOR``, and former words for values."""
    import tomllib

    return tomllib.loads(_VERSIONS_FILE.read_text(encoding="utf-8"))


def additions(minor: int, kind: str) -> Mapping[str, Any]:
    """A table of what a version has that the one before lacks: elements, attributes, values, renamed, required."""
    return version_facts()[f"version_1_{minor}"].get(kind, {})  # type: ignore[no-any-return]


def fit_version(losses: Losses, source: Version, version: Version) -> None:
    """Make a scenario one of another version; `FormatError` for a condition or a reactive maneuver that it lacks."""
    was_strict, is_strict = (one[1] >= _STRICT_SINCE_MINOR for one in (source, version))
    for item in elements(losses.root, "Orientation") if was_strict != is_strict else ():
        item.set("type", item.get("type") or ("relative" if was_strict else "absolute"))  # what it meant without
    if is_strict:
        _be_strict(losses)
    for minor in range(NEWEST_MINOR, version[1], -1):
        _take_back(losses, minor)
    if version[1] == 2:
        older.complete_choices(losses)
    header = child_of(losses.root, "FileHeader")
    if header is not None:
        header.set("revMajor", str(version[0]))
        header.set("revMinor", str(version[1]))


def newer_than(element: etree._Element, version: Version) -> str | None:
    """Name of something inside an element that a version does not know; None if it knows everything."""
    for minor in range(NEWEST_MINOR, version[1], -1):
        news = additions(minor, "elements")
        for item in elements(element):
            parent, tag = item.getparent(), local_name(item)
            if parent is not None and tag in news.get(local_name(parent), ()) and tag != "TrajectoryRef":
                return tag
    return None


def _take_back(losses: Losses, minor: int) -> None:
    """From 1.`minor` to the version before it."""
    older.rename(losses, minor, additions(minor, "renamed"))
    new_elements, new_attributes = additions(minor, "elements"), additions(minor, "attributes")
    new_values = additions(minor, "values")
    for item in elements(losses.root):
        parent, tag = item.getparent(), local_name(item)
        if item is not losses.root and not losses.has(item):
            continue
        if parent is not None and tag in new_elements.get(local_name(parent), ()):
            losses.element(item)
            continue
        for name in new_attributes.get(tag, ()):
            if name in item.attrib:
                losses.attribute(item, name)
        for name in list(map(str, item.attrib)):
            if item.get(name) in new_values.get(f"{tag}/{name}", ()):
                _write_older_value(losses, item, name)
    older.complete(losses, minor, additions(minor, "required"))


def _write_older_value(losses: Losses, item: etree._Element, name: str) -> None:
    value, facts = item.get(name) or "", version_facts()
    former = facts["former"].get(name, {}).get(value)
    if former is None and name in facts["fallback"]:
        former = facts["fallback"][name]
        losses.note(f"{local_name(item)}/@{name} '{value}': written as '{former}' ({losses.target} has none)")
    if former is not None:
        item.set(name, former)
    elif local_name(item) == "ByType" and name == "objectType":
        losses.element(item)
    elif any(local_name(owner) == "Condition" for owner in item.iterancestors()):
        losses.refuse(item, f"{name} '{value}'")
    else:
        losses.action(item, f"{losses.target} has no {name} '{value}'")


def _be_strict(losses: Losses) -> None:
    """One action in an action: a controller assigned and its values overridden are two; an empty one is none."""
    for item in elements(losses.root, "ControllerAction"):
        _split_controller_action(item)
    for item in elements(losses.root, "Action", "PrivateAction"):
        if not children_of(item):
            losses.action(item, "it is empty")
    for item in elements(losses.root, "TrafficeSignalGroupState"):
        item.tag = "TrafficSignalGroupState"


def _split_controller_action(item: etree._Element) -> None:
    parts = children_of(item)
    if not parts:
        remove(item)
        return
    inactive = [part for part in parts if len(parts) > 1 and older.overrides_nothing(part)]
    for part in inactive:
        remove(part)
    for part in [part for part in parts if part not in inactive][1:]:
        # Into a controller action of its own, right after the one that it was in.
        item.remove(part)
        after = parent_of(item)
        another = etree.Element("PrivateAction")
        holder = another
        if local_name(parent_of(after)) == "Action":
            after = parent_of(after)
            another = etree.Element("Action", {"name": f"{after.get('name')} {local_name(part)}"})
            holder = build.sub(another, "PrivateAction")
        build.sub(holder, "ControllerAction").append(part)
        build.insert_after(after, another)
