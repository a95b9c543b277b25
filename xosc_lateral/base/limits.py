"""Every limit on what comes in, with its reason: the one place for these numbers.

``python -m xosc_lateral.base.limits`` prints them as a table. A message that refuses something names
limit and value (`Limit.refusal`). Nothing here is a tuning constant of a model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class Limit:
    """A number that nothing may exceed."""

    value: float
    unit: str  # "MB" counts a million bytes; empty for a count
    what: str  # is counted, as in "bytes of a file"
    reason: str  # why it is where it is

    def __str__(self) -> str:
        return self._with_unit(self.value)

    def refusal(self, value: float) -> str:
        """``WHAT: VALUE, at most LIMIT``."""
        return f"{self.what}: {self._with_unit(value)}, at most {self}"

    def _with_unit(self, value: float) -> str:
        number = f"{value:.0f}" if abs(value) < 1e15 and value == round(value) else f"{value:.6g}"
        return f"{number} {self.unit}" if self.unit else number

    @property
    def bytes(self) -> int:
        """The limit as a count of bytes, where the unit is MB."""
        return int(self.value * 1_000_000)


FILE_SIZE = Limit(4000, "MB", "size of an input file", "a day of 60 channels at 50 Hz as text; larger logs are split")
PACKING_RATIO = Limit(
    200, "", "unpacked bytes per byte of a file", "measured tables shrink 3 to 30 times, decompression bombs 1000 times"
)
UNPACKED_UNASKED = Limit(100, "MB", "unpacked size that needs no such ratio", "takes a second, and little memory")
UNPACKED_SIZE = Limit(4000, "MB", "unpacked size of a gz, zip or Parquet file", "as for a file that is not packed")
TABLE_CELLS = Limit(250e6, "", "cells of a table", "2 GB as doubles: 24 h at 50 Hz with 57 columns")
TABLE_COLUMNS = Limit(2000, "", "columns of a table", "bus logs have hundreds; beyond, it is transposed")
PROFILE_SIZE = Limit(5, "MB", "size of a driver profile", "fitted ones have less than 1 MB")
MODEL_ORDER = Limit(200, "", "coefficients of an autoregression", "fitted ones have 16, which is 16 s of memory")
RESPONSE = Limit(600, "s", "lag, preview or response time of an effect", "drivers look seconds ahead and tire in hours")
COURSE = Limit(100, "", "shifts in time of an effect's course", "fitted ones have three; each costs a row per step")
JSON_DEPTH = Limit(64, "", "levels of nesting", "profiles nest 10 deep; Python's parser ends at about 1000")
TOML_SIZE = Limit(1, "MB", "size of a file in TOML", "a mapping of a hundred columns has 10 kB; a second to read")
XML_TREE = Limit(750, "MB", "memory of an XML file, estimated", "a road of 25 MB fits, and reading stays below 1 GB")
XML_ATTRIBUTES = Limit(1000, "", "attributes of an XML element", "the standards' have ten; reading all is quadratic")

TIME = Limit(1e10, "s", "time stamp", "seconds since 1970 until the year 2286; beyond, doubles lose microseconds")
DRIVE_SPAN = Limit(2.7e6, "s", "time that one drive covers", "a month; 13.5 million model steps")
CLOCK_ROWS = Limit(30e6, "", "rows of an evenly sampled log", "two weeks at 25 Hz; 240 MB a channel")

EXPRESSION_SIZE = Limit(10_000, "", "characters of an expression", "field files stay below 200")
VALUE_SIZE = Limit(10_000, "", "characters of a parameter's value", "each reference may double it: 40 fill any memory")
PARAMETER_SETS = Limit(100_000, "", "parameter sets of one distribution", "a day of conversions on two cores")
COMBINATIONS = Limit(1_000_000, "", "combinations of parameters tried", "constraints may leave some out")
DISTRIBUTION_TIME = Limit(120, "s", "time to draw the parameter sets of a distribution", "100 000 take seconds")
VARIANTS = Limit(10_000, "", "variants of one scenario", "more add no information")
BATCH_JOBS = Limit(1_000_000, "", "outputs of one batch", "1 GB of plans; a database that large is converted in parts")
PROVENANCE_NAMES = Limit(10_000, "", "inputs, or vehicles, of a provenance", "each is hashed; 1300 fill a job's memory")
DECIMAL_EXPONENT = Limit(30, "", "decimal exponent of a range's numbers", "exact arithmetic writes out every digit")

JOB_TIMEOUT = Limit(
    600, "s", "time for one scenario", "field scenarios take a second; 500 entities for a minute take half of one"
)
JOB_MEMORY = Limit(4000, "MB", "memory for one scenario", "500 entities for a minute take 1.5 GB")

REPEATED_RUNS = Limit(
    20, "", "runs of an action that offsets follow", "more is one that runs at every step, and never lets go"
)

PARSER_TIME = Limit(120, "s", "time that a library may read a file for", "a small one takes a second")
PARSER_TIME_PER_SIZE = Limit(4, "s", "more for each MB of the file", "a trace of OSI takes up to one")
PARSER_MEMORY = Limit(4000, "MB", "memory to read a file with, and three times its size", "as for one scenario")
SMALL_PARSER_MEMORY = Limit(1000, "MB", "of it whatever the size, and 200 times that", "libraries load in 500 MB")

LIVE_PAUSE = Limit(60, "s", "time between two steps of a running simulation", "300 steps of a driver: a second or two")
LIVE_LINE = Limit(100, "MB", "a line of live stdio", "100 000 vehicles; one that sends no end of line fills any memory")

OFFSET_LANES = Limit(1.5, "", "lane widths between an offset and the lane centre", "at 1 it follows the next lane")


@dataclass(frozen=True, slots=True)
class Range:
    """What a quantity of the real world can be, both borders included."""

    low: float
    high: float
    reason: str
    unit: str = "-"


CONTEXT_RANGES: Mapping[str, Range] = MappingProxyType(
    {
        "speed": Range(-50, 150, "540 km/h; cars reverse more slowly than that", "m/s"),
        "acceleration": Range(-100, 100, "10 g; a car brakes with 1 g", "m/s2"),
        "curvature": Range(-1, 1, "a radius of 1 m; cars turn in 5 m", "1/m"),
        "lane_width": Range(0, 20, "the widest toll plaza lane; 0 where a lane begins", "m"),
        "lane_index": Range(-1, 50, "lanes of one direction; -1: none"),
        "lane_count": Range(0, 50, "lanes of one direction"),
        "crossfall": Range(-100, 100, "45 degrees", "%"),
        "grade": Range(-100, 100, "45 degrees", "%"),
        "lead_distance": Range(-100, 1e5, "overlapping by a road train's length, to 100 km", "m"),
        "is_truck": Range(0, 1, "a truth value"),
        "lead_is_truck": Range(0, 1, "a truth value"),
        "left_distance": Range(-1e5, 1e5, "100 km", "m"),
        "right_distance": Range(-1e5, 1e5, "100 km", "m"),
        "left_is_truck": Range(0, 1, "a truth value"),
        "right_is_truck": Range(0, 1, "a truth value"),
        "oncoming_distance": Range(-1e5, 1e5, "100 km", "m"),
        "time_of_day": Range(0, 24, "hours of a day", "h"),
        "rain": Range(0, 2000, "the most ever measured in a minute: 1870 mm/h (Guadeloupe 1970)", "mm/h"),
        "wind_speed": Range(0, 150, "the strongest gust ever measured: 113 m/s (Barrow Island 1996)", "m/s"),
        "wind_direction": Range(-360, 720, "a circle, either way", "deg"),
        "friction": Range(0, 3, "racing tyres: 2"),
        "illuminance": Range(0, 200_000, "the sun in the zenith: 130 000 lx", "lx"),
    }
)
"""Contexts that a scenario can supply by itself, by their names."""

DISTANCES = frozenset({"lead_distance", "left_distance", "right_distance"})
"""To vehicles in lanes; infinite where a lane has nobody in it."""

LIVE_RANGES: Mapping[str, Range] = MappingProxyType(
    {
        "offset": Range(-1e4, 1e4, "10 km"),
        "base": Range(-1e4, 1e4, "10 km"),
        "lane": Range(-1e4, 1e4, "lanes of a road"),
        "s": Range(-1e9, 1e9, "along any road"),
        "length": Range(0.01, 1e3, "the longest road trains: 53 m"),
        "width": Range(0.01, 1e3, "as length"),
        "center_x": Range(-1e3, 1e3, "as length"),
    }
)
"""What a running simulation says of a vehicle beside its context."""

ANY_CONTEXT = Range(-1e30, 1e30, "other names, whatever their unit: squares and cubes stay far from overflow")


def context_range(name: str) -> Range:
    """Range of a context column."""
    return CONTEXT_RANGES.get(name, ANY_CONTEXT)


def limits_table() -> str:
    """All limits as Markdown."""
    lines = ["| limit | at most | why |", "|---|---|---|"]
    lines += [f"| {item.what} | {item} | {item.reason} |" for item in globals().values() if isinstance(item, Limit)]
    lines += ["", "| context | from | to | why |", "|---|---|---|---|"]
    lines += [
        f"| {name} | {item.low:g} | {item.high:g} | {item.reason} |"
        for name, item in (*CONTEXT_RANGES.items(), ("any other", ANY_CONTEXT))
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    print(limits_table())
