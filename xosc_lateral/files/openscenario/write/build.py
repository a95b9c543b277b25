"""Pieces of OpenSCENARIO XML that both writers need.

Built with lxml rather than scenariogeneration: importing the latter takes 0.6 s, half of what `convert` may take, and
it writes whole documents of one version where we change a few elements of somebody else's file.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence

import msgspec
import numpy as np
from lxml import etree
from msgspec import Struct
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.files.openscenario.element import parent_of
from xosc_lateral.files.openscenario.write import build
from xosc_lateral.world.scenario.enums import Priority

Version = tuple[int, int]
Pose = tuple[float, float, float, float, float, float]
"""x, y, z [m], heading, pitch, roll [rad]."""

HEADER_DATE = "2024-01-01T00:00:00"
"""Of documents that are made anew: the format asks for one, and the same inputs give the same bytes."""


def version_text(version: Version) -> str:
    """A version as people write it."""
    return f"{version[0]}.{version[1]}"


def decimal(value: float, digits: int) -> str:
    """Fixed-point text without trailing zeros; the same on every machine."""
    text = f"{value:.{digits}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def decimals(values: NDArray[np.float64], digits: Sequence[int]) -> tuple[str, ...]:
    """Text of each number, as `decimal` has it, row by row; values of shape (n, len(digits)).

    The shortest text that is read as a rounded number is that number's decimals: half the time that formats take.
    Numbers so near to the middle between two that a product's rounding might decide, and those that the shortest text
    of is in powers of ten, are written one by one.
    """
    if not values.size:
        return ()
    scaled = values * 10.0 ** np.asarray(digits)
    whole = np.rint(scaled)
    rounded = whole / 10.0 ** np.asarray(digits) + 0.0  # no negative zero
    text = msgspec.json.encode(rounded.ravel().tolist()).decode()
    numbers = text[1:-1].replace(".0,", ",").removesuffix(".0").split(",")
    size = np.abs(scaled)
    odd = np.abs(np.abs(scaled - whole) - 0.5) <= 1e-6 + size * np.finfo(np.float64).eps
    odd |= (whole != 0.0) & (np.abs(rounded) < 1e-5) | (size >= 2.0**50)
    for row, column in np.argwhere(odd).tolist():
        numbers[row * len(digits) + column] = decimal(values[row, column], digits[column])
    return tuple(numbers)


def sub(parent: etree._Element, path: str, **attributes: str) -> etree._Element:
    """Append a child, or one below the other (``PrivateAction/TeleportAction``), the last with the attributes."""
    *above, tag = path.split("/")
    for outer in above:
        parent = etree.SubElement(parent, outer)
    return etree.SubElement(parent, tag, attributes)


def story(name: str) -> etree._Element:
    """An empty story."""
    return etree.Element("Story", {"name": name})


def maneuver(act: etree._Element, name: str, actor: str | None) -> etree._Element:
    """Add a maneuver in a group of its own with at most one actor."""
    return sub(maneuver_group(act, name, actor), "Maneuver", name=name)


def maneuver_group(act: etree._Element, name: str, actor: str | None) -> etree._Element:
    """Add an empty group with at most one actor."""
    group = sub(act, "ManeuverGroup", name=name, maximumExecutionCount="1")
    actors = sub(group, "Actors", selectTriggeringEntities="false")
    if actor is not None:
        sub(actors, "EntityRef", entityRef=actor)
    return group


def event(owner: etree._Element, name: str, priority: Priority, version: Version) -> etree._Element:
    """Add an event; its start trigger comes after its actions."""
    # 1.0 and 1.1 know only the older word.
    code = "overwrite" if priority is Priority.OVERRIDE and version < (1, 2) else priority.value
    return sub(owner, "Event", name=name, priority=code, maximumExecutionCount="1")


def private_action(owner: etree._Element, name: str) -> etree._Element:
    """Add an action to an event."""
    return sub(sub(owner, "Action", name=name), "PrivateAction")


def time_trigger(owner: etree._Element, tag: str, moment: float, version: Version) -> etree._Element:
    """Add a trigger that is true from a simulation time on, to a microsecond.

    Version 1.0 has no ``greaterOrEqual``: a millisecond earlier and ``greaterThan`` come to the same in any player with
    steps of 1 ms or more.
    """
    trigger = sub(owner, tag)
    by_value = condition(sub(trigger, "ConditionGroup"), f"time {decimal(moment, 3)}", "ByValueCondition")
    rule, moment = ("greaterOrEqual", moment) if version >= (1, 1) else ("greaterThan", moment - 1e-3)
    sub(by_value, "SimulationTimeCondition", value=decimal(moment, 6), rule=rule)
    return trigger


def condition(group: etree._Element, name: str, kind: str, *, delay: str = "0", edge: str = "none") -> etree._Element:
    """Add a condition; what it looks at goes into what comes back, its element of that kind."""
    return sub(sub(group, "Condition", name=name, delay=delay, conditionEdge=edge), kind)


def entity_condition(group: etree._Element, name: str, entity: str, *, edge: str = "none") -> etree._Element:
    """Add a condition on an entity; what is asked of it goes into what comes back."""
    by_entity = condition(group, name, "ByEntityCondition", edge=edge)
    triggering = sub(by_entity, "TriggeringEntities", triggeringEntitiesRule="any")
    sub(triggering, "EntityRef", entityRef=entity)
    return sub(by_entity, "EntityCondition")


def state_condition(
    group: etree._Element, kind: str, reference: str, state: str, delay: float, edge: str = "none"
) -> None:
    """Add a condition on the state of a storyboard element."""
    name = f"{state} after {decimal(delay, 3)}"
    by_value = condition(group, name, "ByValueCondition", delay=decimal(delay, 6), edge=edge)
    what = {"storyboardElementType": kind, "storyboardElementRef": reference, "state": state}
    sub(by_value, "StoryboardElementStateCondition", **what)


def speed_step(owner: etree._Element, speed: float) -> None:
    """Speed at once, as the content of a private action."""
    action = sub(owner, "LongitudinalAction/SpeedAction")
    sub(action, "SpeedActionDynamics", dynamicsShape="step", dynamicsDimension="time", value="0")
    sub(action, "SpeedActionTarget/AbsoluteTargetSpeed", value=decimal(speed, 5))


def world_position(owner: etree._Element, pose: Pose) -> None:
    """Position in the world."""
    x, y, z = (decimal(value, 5) for value in pose[:3])
    h, p, r = (decimal(angle, 6) for angle in pose[3:])
    sub(owner, "Position/WorldPosition", x=x, y=y, z=z, h=h, p=p, r=r)


def indentation(root: etree._Element) -> str:
    """What a file sets its levels out by: the white space before the root's first child."""
    text = (root.text or "").rpartition("\n")[2]
    return text if text and text.isspace() else "  "


def insert_indented(parent: etree._Element, index: int, element: etree._Element) -> None:
    """Insert a new element, set out like its neighbours."""
    indent = indentation(parent.getroottree().getroot())
    depth = sum(1 for _ in parent.iterancestors()) + 1
    if isinstance(element.tag, str):
        etree.indent(element, indent, level=depth)
    opening, closing = "\n" + indent * depth, "\n" + indent * (depth - 1)
    if len(parent) == 0:
        parent.text = opening
    elif index >= len(parent):
        parent[-1].tail = opening
    element.tail = closing if index >= len(parent) else opening
    parent.insert(index, element)


def insert_after(neighbour: etree._Element, element: etree._Element) -> None:
    """Insert a new element right after another one."""
    parent = parent_of(neighbour)
    insert_indented(parent, parent.index(neighbour) + 1, element)


def document(root: etree._Element) -> bytes:
    """The whole file: comments around the root element on lines of their own."""
    elements = (*reversed(list(root.itersiblings(preceding=True))), root, *root.itersiblings())
    parts = [etree.tostring(element, encoding="UTF-8", xml_declaration=False, with_tail=False) for element in elements]
    return b"\n".join([b"<?xml version='1.0' encoding='UTF-8'?>", *parts, b""])


# ---- vertices: text only while the document is written, for as elements they take 3 kB each ----
BLOCK = 1000
"""Vertices that are text at a time."""

_POSE, _MOTION = ("x", "y", "z", "h", "p", "r"), ("speed_longitudinal", "acceleration_longitudinal")

_DIGITS = (6, 5, 5, 5, 6, 6, 6, 4, 4)
"""Decimals of the time and of these."""


ColumnsOf = Callable[[slice], Sequence[FloatArray]]


class TimedVertices(Struct, frozen=True, eq=False):
    """Vertices of one trajectory."""

    count: int  # how many they are
    columns_of: ColumnsOf
    """Gives, for some of them, time [s], x, y, z [m], heading, pitch, roll [rad] and, where vertices have a motion,
    speed [m/s] and acceleration [m/s2]; shape (n,) each."""

    def text(self, indent: str, unit: str) -> Iterator[str]:
        """XML of the vertices, set out at `indent`, each level below by `unit` more; the first without its indent."""
        inner, innermost = f"\n{indent}{unit}", f"\n{indent}{unit}{unit}"
        for begin in range(0, self.count, BLOCK):
            block = np.stack(self.columns_of(slice(begin, begin + BLOCK)))
            varies = np.ptp(block, axis=1) != 0.0
            digits = _DIGITS[: len(block)]
            time, *values = ("%s" if varies[k] else build.decimal(block[k, 0], count) for k, count in enumerate(digits))
            pose, motion = (
                "".join(f' {name}="{value}"' for name, value in zip(names, part, strict=True))
                for names, part in ((_POSE, values[:6]), (_MOTION[: len(values) - 6], values[6:]))
            )
            vertex = (
                f'<Vertex time="{time}">{inner}<Position>{innermost}<WorldPosition{pose}/>{inner}</Position>'
                + (f"{inner}<Motion{motion}/>" if motion else "")
                + f"\n{indent}</Vertex>"
            )
            numbers = build.decimals(block[varies].T, [_DIGITS[k] for k in np.flatnonzero(varies)])
            text = f"\n{indent}".join([vertex] * block.shape[1]) % numbers
            yield (f"\n{indent}" if begin else "") + text


class FreeVertices(Struct, frozen=True, eq=False):
    """Vertices of a path without times, which its entity begins wherever it is."""

    entity: str
    beside: FloatArray  # from there, along s and t of its road, shape (2, n) [m]
    places: FloatArray  # x and y of those after them, shape (2, m) [m]

    def text(self, indent: str, unit: str) -> Iterator[str]:
        """XML of the vertices, as in `TimedVertices`; each has some time, which the schemas ask for."""
        holder = etree.tostring(etree.Element("RelativeRoadPosition", entityRef=self.entity), encoding="unicode")
        relative = holder[:-2].replace("%", "%%") + ' ds="%s" dt="%s"/>'
        n, every = self.beside.shape[1], self.beside.shape[1] + self.places.shape[1]
        time = 0.1 * np.arange(every)
        numbers = decimals(np.vstack((time[:n], self.beside)).T, (1, 3, 6))
        numbers += decimals(np.vstack((time[n:], self.places)).T, (1, 5, 5))
        vertex = f'<Vertex time="%s">\n{indent}{unit}<Position>{{}}</Position>\n{indent}</Vertex>'
        texts = [vertex.format(relative)] * n + [vertex.format('<WorldPosition x="%s" y="%s"/>')] * (every - n)
        # it begins with the heading that it has
        itself = relative.replace("Road", "Object").replace(" ds=", " dx=").replace(" dt=", " dy=")[:-2]
        texts[0] = vertex.format(f'{itself}><Orientation type="relative" h="0"/></RelativeObjectPosition>')
        yield f"\n{indent}".join(texts) % numbers


class Vertices:
    """Polylines of a document, and where in it they go.

    No mark of ours can be in the document before, `source`, by chance or by malice: its hash is part of the mark.
    """

    def __init__(self, source: bytes) -> None:
        self._mark = f"vertices-{hashlib.sha256(source).hexdigest()[:32]}"
        self._polylines: list[TimedVertices | FreeVertices] = []

    def add(self, owner: etree._Element, polyline: TimedVertices | FreeVertices) -> None:
        """Let an element hold these vertices and nothing else."""
        owner.append(etree.ProcessingInstruction(self._mark, str(len(self._polylines))))
        self._polylines.append(polyline)

    def document(self, root: etree._Element) -> Iterator[bytes]:
        """The whole file in pieces; see `build.document`."""
        unit = build.indentation(root)
        rest = build.document(root)
        begin, end = f"<?{self._mark} ".encode(), b"?>"
        while (at := rest.find(begin)) >= 0:
            number, _, after = rest[at + len(begin) :].partition(end)
            before = rest[:at]
            yield before
            indent = before[before.rfind(b"\n") + 1 :].decode()
            yield from map(str.encode, self._polylines[int(number)].text(indent, unit))
            rest = after
        yield rest
