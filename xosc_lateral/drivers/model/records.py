"""Parameters and states as msgspec structs: strict when read, plain JSON values when written.

Unknown fields are refused by name, `kind` names the type; arrays and random generators, which JSON has
none of, are lists and the generator's own state there.
"""

from __future__ import annotations

import re
from typing import Any, ClassVar, Self, TypeVar, get_args, get_origin

import msgspec
import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from xosc_lateral.base.errors import DriverProfileError

T = TypeVar("T")


class Record(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters: set once, checked in `__post_init__`; `msgspec.structs.replace` makes a changed copy."""

    # Fields that came later: files are without them where they have their defaults, as they were before.
    later: ClassVar[tuple[str, ...]] = ()

    def __deepcopy__(self, memo: object) -> Self:
        return self

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values, as a file holds them."""
        values: dict[str, Any] = plain(self)
        for field in structs.fields(self) if self.later else ():
            default = field.default if field.default_factory is msgspec.NODEFAULT else field.default_factory()
            if field.name in self.later and getattr(self, field.name) == default:
                del values[field.encode_name]
        return values


def kebab(name: str) -> str:
    """`VarianceTrend` as `variance-trend`, `TwoLevelModel` as `two-level`: what a class is called in files."""
    return re.sub(r"(?<!^)(?=[A-Z])", "-", name.removesuffix("Model")).lower()


def plain(thing: object) -> Any:
    """Plain JSON values of a struct, or of anything made of structs."""
    return _listed(msgspec.to_builtins(thing, enc_hook=_encoded))


def read_as(kind: type[T], values: object, where: str = "") -> T:
    """Back from `plain`.

    Raises `DriverProfileError` if a field is missing, unknown, of the wrong kind or out of its range; the message names
    it and its path from `where` on. `kind` is a struct, or a union or a tuple of structs.
    """
    try:
        return msgspec.convert(values, kind, dec_hook=_decoded)
    except msgspec.ValidationError as error:
        raise DriverProfileError(_in_words(str(error), where, kind)) from error


def set_once(record: msgspec.Struct, **values: object) -> None:
    """Set fields of a frozen struct: for its own `__post_init__` only."""
    for name, value in values.items():
        structs.force_setattr(record, name, value)


def frozen_array(values: object, dtype: type[np.generic] = np.float64) -> NDArray[Any]:
    """A copy that nobody can write to, shape and unit [any] of the values."""
    array = np.array(values, dtype=dtype)
    array.flags.writeable = False
    return array


def _encoded(value: object) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist() if value.size or value.ndim == 1 else {"shape": list(value.shape)}
    if isinstance(value, np.random.Generator):
        return value.bit_generator.state
    if isinstance(value, np.generic):
        return value.item()
    raise NotImplementedError(type(value))


def _decoded(kind: type, value: Any) -> Any:
    if get_origin(kind) is np.ndarray:
        wanted: type[np.generic] = get_args(get_args(kind)[1])[0]
        if isinstance(value, dict):  # no values: lists can't say how many there are none of
            shape = value.get("shape")
            known = isinstance(shape, list) and 0 in shape and all(isinstance(n, int) for n in shape)
            if len(value) != 1 or not known:
                raise ValueError(f"expected a list of numbers, got {value!r}")
            return np.empty(shape, dtype=wanted)
        array = np.array(value)
        if array.size and not np.can_cast(array.dtype, wanted, "same_kind"):
            raise ValueError("expected numbers")  # of texts, numpy would make some, and of 1.5 a whole number
        return array.astype(wanted)
    if kind is np.random.Generator:
        generator = np.random.default_rng(0)
        generator.bit_generator.state = value
        return generator
    raise NotImplementedError(kind)


def _listed(value: Any) -> Any:
    """Tuples as lists, for that is what comes back from JSON."""
    if isinstance(value, dict):
        return {key: _listed(item) for key, item in value.items()}
    return [_listed(item) for item in value] if isinstance(value, list | tuple) else value


def _in_words(text: str, where: str, kind: object) -> str:
    """msgspec's message in our words: path, what is wrong with it."""
    match = re.fullmatch(r"(.*?)(?: - at `(?:key in )?(\$[^`]*)`)?", text, re.DOTALL)
    what, path = (match[1], match[2] or "$") if match else (text, "$")
    path = (where + path.removeprefix("$")).lstrip(".")
    if path.endswith(".kind") and what.startswith("Invalid value"):
        what = what.replace("Invalid value", "unknown kind") + f"; known are {', '.join(sorted(_kinds(kind, path)))}"
        path = path.removesuffix(".kind")
    for theirs, ours in (("Object contains unknown field", "unknown field"), ("Object missing required field", "no")):
        what = what.replace(theirs, ours)
    what = what.replace("`", "'")
    what = what[:1].lower() + what[1:] if what.startswith("Expected") else what
    return f"{path}: {what}" if path else what


def _kinds(kind: Any, path: str) -> tuple[str, ...]:
    """Kinds that the structs of a union, or of a field of a struct, have."""
    tag = getattr(getattr(kind, "__struct_config__", None), "tag", None)
    if tag is not None:
        return (str(tag),)
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        field = re.split(r"[.\[]", path)[0]
        return next((_kinds(part.type, "") for part in structs.fields(kind) if part.encode_name == field), ())
    return tuple(name for part in get_args(kind) if part is not Ellipsis for name in _kinds(part, path))
