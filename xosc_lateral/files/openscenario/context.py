"""What every part of the reader needs to know, and structs from elements as their fields declare."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, partial, reduce
from operator import or_
from types import NoneType, UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin, get_type_hints

from msgspec import NODEFAULT, UNSET, Struct, structs

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.note import Note
from xosc_lateral.files.openscenario.element import XmlElement
from xosc_lateral.files.openscenario.references import Catalogs, local_scope, parameter_name
from xosc_lateral.world.scenario.place import Place, Xml
from xosc_lateral.world.scenario.position import Position, Shape

S = TypeVar("S", bound=Struct)
R = TypeVar("R")

ZERO_DECIMALS = ".0000000000"
"""Of the id of a road that came out of an expression or a number parameter: ids are text, in their plain form."""

MAX_NESTING = 20
"""Routes in positions in routes ...: bounds the recursion."""


@dataclass(slots=True)
class Context:
    """State of one reading."""

    version: tuple[int, int]  # (major, minor) of the file
    catalogs: Catalogs
    notes: list[Note]  # collected on the way
    readers: Mapping[object, Reader]
    """Own readers, of an element and this context, for what the declaration of a struct does not say."""
    entities: set[str] = field(default_factory=set)  # names of scenario objects; filled before the storyboard is read
    selections: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # entity selections and their members
    strict: bool = False  # refuse what could be replaced by something usual (a vehicle whose catalog is missing)
    left_handed: bool = False  # written for CARLA; see `left_handed`
    _depth: int = 0

    def entity(self, element: XmlElement, name: str = "entityRef") -> str:
        """Attribute naming an entity that must exist."""
        reference = element.text(name)
        if reference not in self.entities:
            known = ", ".join(sorted(self.entities)[:8]) or "none"
            element.fail(f"{name}: no entity '{reference[:60]}' (there are {known})")
        return reference

    def members(self, owner: XmlElement) -> Iterator[str]:
        """Entities that the EntityRef children of an element stand for; a selection for all of its own."""
        for element in owner.children("EntityRef"):
            selected = self.selections.get(element.text("entityRef"))
            yield from (self.entity(element),) if selected is None else selected

    def note(self, element: XmlElement, reason: str = "is not read") -> None:
        """Note something that is read over."""
        self.notes.append(element.place().note(reason))

    def inline_or_entry(self, owner: XmlElement, tag: str) -> XmlElement:
        """The element of that tag that `owner` holds or refers to, in the scope of its own and assigned parameters."""
        inline = owner.child(tag)
        if inline is not None:
            return inline.within(local_scope(inline))
        entry = self.catalogs.entry(owner.required("CatalogReference"))
        if entry.tag != tag:
            owner.fail(f"catalog entry '{entry.raw('name')}' is a {entry.tag}, not a {tag}")
        return entry

    def optional_entry(self, reference: XmlElement) -> XmlElement | None:
        """Catalog entry that motion does not depend on: a missing one is remarked, not refused."""
        try:
            return self.catalogs.entry(reference)
        except FormatError as error:
            self.note(reference, error.what)
            return None

    def nested(self, element: XmlElement, reader: Callable[[XmlElement, Context], R]) -> R:
        """What may hold others of its kind, at most `MAX_NESTING` deep."""
        self._depth += 1
        if self._depth > MAX_NESTING:
            element.fail(f"positions, routes and trajectories are nested more than {MAX_NESTING} deep")
        content = reader(element, self)
        self._depth -= 1
        return content


Reader = Callable[[XmlElement, Context], Any]


def read_struct(kind: type[S], e: XmlElement, context: Context, /, **preset: Any) -> S:
    """A struct whose fields are read as they declare (see `Xml`), but for those that are given.

    Raises `FormatError` for an attribute or a child element that is missing and has no default, or is not of its type,
    and for what the struct itself refuses.
    """
    read = {name: reader(e, context) for name, reader in _readers(kind) if name not in preset}
    try:
        return kind(**preset, **read)
    except ValueError as error:
        e.fail(str(error))


def declared(*kinds: type[Struct]) -> dict[str, Reader]:
    """Readers for elements that are called like their structs."""
    return {kind.__name__: partial(read_struct, kind) for kind in kinds}


@cache
def _readers(kind: type[Struct]) -> tuple[tuple[str, Reader], ...]:
    hints = get_type_hints(kind, include_extras=True)
    return tuple((info.name, _reader(info, hints[info.name])) for info in structs.fields(kind))


def _reader(info: structs.FieldInfo, hint: Any) -> Reader:
    """Of one field."""
    xml = Xml()
    if get_origin(hint) is Annotated:
        hint, xml = get_args(hint)
    if get_origin(hint) is tuple:
        return _children(get_args(hint)[0], xml)
    kinds = get_args(hint) if get_origin(hint) in (UnionType, Union) else (hint,)
    default = None if NoneType in kinds else xml.default
    if info.default is not NODEFAULT:
        default = info.default
    kinds = tuple(kind for kind in kinds if kind is not NoneType)
    if kinds == (Place,):
        return lambda e, context: e.place()
    if isinstance(kinds[0], type) and issubclass(kinds[0], (str, float, int)):
        return _attribute(xml.names or (_camel(info.name),), kinds[0], xml, default)
    return _child(kinds, xml, default)


def _camel(name: str) -> str:
    first, *others = name.split("_")
    return first + "".join(map(str.capitalize, others))


def _attribute(names: tuple[str, ...], kind: type[Any], xml: Xml, default: Any) -> Reader:
    paths = [(above.split("/") if above else [], name) for above, _, name in (path.rpartition("/") for path in names)]

    def read(e: XmlElement, context: Context) -> Any:
        value = None
        for above, name in paths:
            holder = _below(e, above)
            if holder is not None and value in (None, ""):
                value = _value(holder, name, kind, xml, context)
        if value is None and default is UNSET:
            (holder or e.required(*above)).fail(f"attribute '{name}' is missing")
        return default if value is None else value

    return read


def _value(e: XmlElement, name: str, kind: type[Any], xml: Xml, context: Context) -> Any:
    """An attribute; None where it is missing, or empty and no text."""
    if xml.is_entity:
        return None if e.raw(name) is None else context.entity(e, name)
    if xml.is_parameter:
        return parameter_name(e.raw(name) or e.text(name))
    return e.text(name).removesuffix(ZERO_DECIMALS) if xml.is_road else e.optional(name, kind, finite=xml.finite)


def _below(e: XmlElement | None, above: list[str]) -> XmlElement | None:
    for tag in above:
        e = None if e is None else e.child(*() if tag == "*" else (tag,))
    return e


_UNIONS: dict[Any, str] = {Position: "Position", Shape: "Shape"}
"""Elements of any of several kinds."""


def _child(kinds: tuple[type[Any], ...], xml: Xml, default: Any) -> Reader:
    """An element of one kind, or one that holds an element of one of several kinds."""
    key: Any = reduce(or_, kinds)
    usual = _UNIONS.get(key, kinds[0].__name__)
    *above, last = (xml.names or (usual,))[0].split("/")
    tags = (last, *xml.names[1:])
    by_tag = {kind.__name__: kind for kind in kinds}

    def read(e: XmlElement, context: Context) -> Any:
        owner = _below(e, above)
        holder = owner if tags == ("",) or owner is None else owner.child(*tags)
        if holder is None and default is not UNSET:
            return default
        if holder is None:
            holder = e.required(*tags)
        reader = context.readers.get(key)
        if reader is not None:
            return reader(holder, context)
        if len(kinds) > 1:
            holder = holder.required(*by_tag)
        return read_struct(by_tag[holder.tag] if len(kinds) > 1 else kinds[0], holder, context)

    return read


def _children(kind: type[Any], xml: Xml) -> Reader:
    """Elements of one kind, or names of entities."""
    if xml.is_entity:
        return lambda e, context: tuple(context.members(e))
    tags = xml.names or (kind.__name__,)

    def read(e: XmlElement, context: Context) -> Any:
        reader = context.readers.get(kind)
        return tuple(reader(x, context) if reader else read_struct(kind, x, context) for x in e.children(*tags))

    return read
