"""Units of table columns, as `--map speed=v:km/h` names them."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from types import MappingProxyType

from xosc_lateral.segment import CONTEXT_UNITS

# unit -> (what it measures, factor to SI). Degrees stay apart from radians only by their factor.
UNITS: Mapping[str, tuple[str, float]] = MappingProxyType(
    {
        "m": ("length", 1.0),
        "cm": ("length", 1e-2),
        "mm": ("length", 1e-3),
        "km": ("length", 1e3),
        "ft": ("length", 0.3048),
        "in": ("length", 0.0254),
        "m/s": ("speed", 1.0),
        "km/h": ("speed", 1 / 3.6),
        "kph": ("speed", 1 / 3.6),
        "mph": ("speed", 0.44704),
        "kn": ("speed", 1852 / 3600),
        "s": ("time", 1.0),
        "ms": ("time", 1e-3),
        "us": ("time", 1e-6),
        "ns": ("time", 1e-9),
        "min": ("time", 60.0),
        "h": ("time", 3600.0),
        "rad": ("angle", 1.0),
        "deg": ("angle", pi / 180),
        "rad/s": ("angular speed", 1.0),
        "deg/s": ("angular speed", pi / 180),
        "m/s2": ("acceleration", 1.0),
        "g": ("acceleration", 9.80665),
        "1/m": ("curvature", 1.0),
        "1/km": ("curvature", 1e-3),
        "-": ("number", 1.0),
        "%": ("number", 1e-2),
        "mm/h": ("rain", 1.0),
        "lx": ("illuminance", 1.0),
        "klx": ("illuminance", 1e3),
    }
)

# Other spellings, as bus logs have them; in lower case and without spaces.
_SPELLINGS = MappingProxyType(
    {
        **dict.fromkeys(("meter", "meters", "metre", "metres"), "m"),
        **dict.fromkeys(("kmh", "kmph", "km/hr", "kph"), "km/h"),
        **dict.fromkeys(("mps", "m/sec", "ms-1", "m.s-1"), "m/s"),
        **dict.fromkeys(("sec", "second", "seconds"), "s"),
        **dict.fromkeys(("msec",), "ms"),
        **dict.fromkeys(("µs", "μs"), "us"),
        **dict.fromkeys(("°", "grad", "degree", "degrees"), "deg"),
        **dict.fromkeys(("radian", "radians"), "rad"),
        **dict.fromkeys(("°/s", "deg/sec", "grad/s", "degree/s", "degrees/s"), "deg/s"),
        **dict.fromkeys(("rad/sec",), "rad/s"),
        **dict.fromkeys(("m/s^2", "m/s²", "m/s**2", "m/s/s", "mps2", "m/sec2", "m/sec^2"), "m/s2"),
        **dict.fromkeys(("m^-1", "m-1", "m⁻¹", "rad/m"), "1/m"),
        **dict.fromkeys(("percent", "prozent"), "%"),
        **dict.fromkeys(("lux",), "lx"),
        **dict.fromkeys(("1", "none", "unitless", "no_unit", "count", "counts", "bool", "enum"), "-"),
    }
)

_TABLE_UNITS = MappingProxyType({"time": "s", "offset": "m", "distance_left": "m", "distance_right": "m"})


def spelled(unit: str) -> str | None:
    """The unit in the spelling of `UNITS`; empty where none is given, None where it is not known."""
    plain = "".join(unit.split()).strip("[]()").lower()
    known = _SPELLINGS.get(plain, plain)
    return known if not known or known in UNITS else None


def is_measured(unit: str) -> bool:
    """Whether a unit of `UNITS` is that of a quantity, and not of a count, a flag or a share."""
    return unit in UNITS and UNITS[unit][0] != "number"


def factor(column: str, unit: str) -> float:
    """Factor from `unit` to the unit that the standard table has `column` in (SI where it names none).

    A unit with a leading minus turns the sign: ``-m`` for offsets counted to the right.

    Raises `ValueError` for an unknown unit, or one that measures something else.
    """
    sign, name = (-1.0, unit[1:]) if unit.startswith("-") and unit != "-" else (1.0, unit)
    if name not in UNITS:
        raise ValueError(f"unknown unit {unit!r}; known: {', '.join(UNITS)}")
    quantity, to_si = UNITS[name]
    target = _TABLE_UNITS.get(column) or CONTEXT_UNITS.get(column)
    if target is None:
        return sign * to_si
    wanted, target_to_si = UNITS[target]
    if wanted != quantity:
        raise ValueError(f"{column} is held in {target}, {unit} measures {quantity}")
    return sign * to_si / target_to_si
