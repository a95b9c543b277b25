"""What all elements of a file have in common: where they stand, and how their fields are written."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from msgspec import UNSET, Struct

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.note import Note


@dataclass(frozen=True, slots=True)
class Place:
    """File, line and element of something read."""

    path: str  # the file (a scenario or a catalog)
    line: int | None  # line, from 1
    element: str  # the element as errors name it, as in ``Event 'brake'``
    node: tuple[int, ...] = field(default=(), repr=False, compare=False)
    """Child indices from the root element down: finds the same XML element again in a new parse of the same bytes."""

    def error(self, what: str, kind: type[FormatError] = FormatError) -> FormatError:
        """An error that names the place."""
        return kind(what, path=self.path, line=self.line, element=self.element)

    def note(self, what: str, *, is_warning: bool = False, entity: str | None = None) -> Note:
        """A note that names the place."""
        return Note(what, self.path, self.line, self.element, is_warning, entity)


class Content(Struct, frozen=True, kw_only=True):
    """What an action, a condition or a position says; knows where it stands."""

    place: Place


class Unsupported(Struct, frozen=True):
    """Something that was understood to be there, but that the model holds no more of: the player names it."""

    kind: str  # the standard's element name, as in ``RandomRouteAction``
    place: Place  # where it stands
    reason: str = ""  # why, if there is more to say than that it is unknown


class Xml(Struct, frozen=True):
    """How a field is written in a file, where its name and type don't say so.

    Without it an attribute is called like its field (``entityRef`` for `entity_ref`), an element like its type.
    """

    names: tuple[str, ...] = ()
    """Attributes, or child elements, of which the first that is there counts; ``Sun/azimuth`` is in a child element,
    ``*`` the first of any. An empty tuple where the name is the usual one, ``("",)`` for the element itself."""
    default: object = UNSET
    """What is read where it is missing, if the field itself has no default: lenient reading, not the standard."""
    finite: bool = True  # infinity is refused
    is_entity: bool = False
    """The name of an entity that has to be there; of a tuple, those that EntityRef elements stand for."""
    is_parameter: bool = False  # the name of a parameter, which files also write with a ``$``
    is_road: bool = False  # the id of a road


def called(*names: str, default: object = UNSET) -> Xml:
    """A field under other names."""
    return Xml(names, default)


EntityRef = Annotated[str, Xml(is_entity=True)]
EntityRefs = Annotated[tuple[str, ...], Xml(is_entity=True)]
ParameterRef = Annotated[str, Xml(is_parameter=True)]
RoadId = Annotated[str, Xml(is_road=True)]
AnyNumber = Annotated[float, Xml(finite=False)]
"""May be infinite."""
Zero = Annotated[float, Xml(default=0.0)]
"""0 where a file has none."""
No = Annotated[bool, Xml(default=False)]
"""False where a file has none."""
Name = Annotated[str, Xml(default="")]
"""Empty where a file has none."""
