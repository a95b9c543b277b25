"""A profile's numbers as constant tables in C: what the templates in `extras/live/c` read."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from decimal import Decimal, localcontext
from functools import cache, reduce
from itertools import pairwise
from typing import Any

import numpy as np

from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.limits import DISTANCES, LIVE_PAUSE, LIVE_RANGES, OFFSET_LANES, TIME, context_range
from xosc_lateral.base.names import in_c
from xosc_lateral.base.segment import CLOCK_RATES, CLOCK_SPEEDS, MINIMUM_SPEED, SPEED_SLACK
from xosc_lateral.base.version import __version__
from xosc_lateral.drivers.model import actuator
from xosc_lateral.drivers.model import effects as kinds
from xosc_lateral.drivers.model.core.autoregressive.model import HEADROOM, KNEE_SHARE, AutoregressiveModel
from xosc_lateral.drivers.model.core.autoregressive.parameters import (
    CANDIDATES,
    COARSE_EVERY,
    SLOW_CORRELATION_TIME,
    TICKS,
    phases,
)
from xosc_lateral.drivers.model.core.two_level.model import TwoLevelModel
from xosc_lateral.drivers.model.effects.base import LOG_LIMIT
from xosc_lateral.drivers.model.effects.response import split_shift
from xosc_lateral.drivers.model.group import rows_ahead
from xosc_lateral.drivers.model.linear_filters import SAMPLES_AHEAD
from xosc_lateral.drivers.model.plausibility import MINIMUM_LANE_WIDTH
from xosc_lateral.drivers.model.profile import DriverProfile, sampling_hash
from xosc_lateral.drivers.model.seeds import AutoregressiveSeed, DriveSeed, TwoLevelSeed
from xosc_lateral.extras.live import moment
from xosc_lateral.world.motion import driver_clock
from xosc_lateral.world.motion.trajectory import SETTLING_TIME

USUAL_INPUTS = {"speed": 30.0, "lane_count": 2.0, "friction": 1.0}
"""Inputs that nobody sets; others are 0, of distances that nobody is there."""

SHAPES = ("VALUE", "MAGNITUDE", "BEYOND", "SATURATING", "STEP_AT", "HINGE_AT", "EQUALS", "PRESENCE", "NEARNESS",
          "PROXIMITY", "SINE", "COSINE")  # fmt: skip
"""How a column enters a component of an effect's quantity; a product has two."""

Shape = tuple[str, str, float, float]
"""Kind, column, and its two numbers."""

FAULTS = {
    "START": "the driver was not started, or its memory was written to",
    "TIME": f"time: not a number, before the last one, more than {LIVE_PAUSE} after it, or beyond {TIME}",
    "LOOKS": "looks: as many as the header says before the first step, or none",
    "STATE": "saved driver: damaged, or of another profile",
    "LANE_WIDTH": "lane_width: not above 0 m",
    "SPEED": "speed: not a number, or below 0 m/s: a driver who follows the road drives forwards",
    "FOLLOWING": "following: not a number",
    "POSITION": f"position: not within {LIVE_RANGES['offset'].high:g} m",
}
"""Reasons for which a call is refused, beside columns out of their ranges."""


def inputs_of(profile: DriverProfile) -> tuple[str, ...]:
    """Columns that a driver is told of: those that his profile reads, and two that every driver needs."""
    return "speed", "lane_width", *sorted(set(profile.columns) - {"speed", "lane_width"})


def usual(profile: DriverProfile, column: str) -> float:
    """Value of an input that nobody sets."""
    if column.endswith("_distance"):
        return np.inf
    return {**USUAL_INPUTS, "lane_width": profile.lane_width}.get(column, 0.0)


# ---- the profile's numbers -------------------------------------------------------------------------------------------
def numbers_of(profile: DriverProfile) -> tuple[dict[str, int], list[str]]:
    """Sizes for the header, and the lines of the tables."""
    columned = [effect for effect in profile.effects if isinstance(effect, kinds.ColumnEffect)]
    hidden = [effect for effect in profile.effects if isinstance(effect, kinds.HiddenEffect)]
    sizes, lines = _effects(profile, columned)
    match profile.model:
        case TwoLevelModel():
            core_sizes, core = _two_level(profile.model)
        case AutoregressiveModel():
            core_sizes, core = _autoregressive(profile.model)
        case _:
            raise DriverProfileError(f"profile {profile.name}: the C driver has no core model {profile.model.kind!r}")
    hidden_lines = _hidden(profile, hidden)
    rated = any(effect.acts is kinds.Acts.RATE for effect in columned) or any(
        isinstance(effect, kinds.Adapted) and effect.rate != 1.0 for effect in hidden
    )
    measured = profile.validity.lane_width
    fine_width = 0.0 if measured is None or profile.model.fine_scales_with_lane else profile.lane_width
    seeds = {
        f"SEED_{seed.name}": f"{int(seed)}U" for kind in (DriveSeed, AutoregressiveSeed, TwoLevelSeed) for seed in kind
    }
    constants = {
        "DRIVER_STEP": profile.model.step, "PROFILE": f"UINT64_C(0x{sampling_hash(profile)[:16]})",
        "OWN_LANE_WIDTH": profile.lane_width, "WIDEST_LANE": np.inf if measured is None else measured[1],
        "FINE_WIDTH": fine_width, "RATED": int(rated), "LOG_LIMIT": LOG_LIMIT, "LONGEST_PAUSE": LIVE_PAUSE.value,
        "LATEST_TIME": TIME.value, "FARTHEST_POSITION": LIVE_RANGES["offset"].high, "MINIMUM_SPEED": MINIMUM_SPEED,
        "SETTLING_TIME": SETTLING_TIME,
        "LARGEST_TURN": driver_clock.LEADING_OVER_SHARE * driver_clock.LARGEST_TURN_RATE,
        "OFFSET_LANES": OFFSET_LANES.value, "MINIMUM_LANE_WIDTH": MINIMUM_LANE_WIDTH,
        **{name: getattr(actuator, name) for name in ("RESPONSE_SPEED", "RESPONSE_ACCELERATION", "LARGEST_SPEED",
                                                      "LARGEST_ACCELERATION", "IMPOSSIBLE_ACCELERATION")},
        "STEP_PEAK": driver_clock.STEP_PEAK, "NEGLIGIBLE_REST": moment.NEGLIGIBLE_REST,
        "LARGEST_SINE": moment.LARGEST_SINE,
        "STANDSTILL": moment.STANDSTILL,
        "CLOCK_KNOTS": len(CLOCK_SPEEDS), "SPEED_SLACK": SPEED_SLACK, "CLOCK_TOLERANCE": moment.CLOCK_TOLERANCE,
        **seeds,
    }  # fmt: skip
    sizes |= core_sizes | {"HIDDEN": max(1, len(hidden))}
    return sizes, [
        f"/* Numbers of the profile, written by xosc-lateral {__version__}. */",
        *(f"#define {name} {_number(value)}" for name, value in constants.items()),
        f"#define DRIVER_TWO_LEVEL {int(isinstance(profile.model, TwoLevelModel))}",
        f"static const double clock_speeds[] = {{{', '.join(map(_number, CLOCK_SPEEDS))}}};",
        f"static const double clock_rates[] = {{{', '.join(map(_number, CLOCK_RATES))}}};",
        *ziggurats(),
        *core,
        *lines,
        *hidden_lines,
        *_inputs(profile),
    ]


def _inputs(profile: DriverProfile) -> list[str]:
    columns = inputs_of(profile)
    usual_values = [*(usual(profile, column) for column in columns), 0.0, 1.0]
    rows, texts = [], ["", *FAULTS.values()]
    wishes = (actuator.fault_in_words(profile, fault) for fault in range(1, len(profile.effects) + 2))
    impossible = ["", *(f"{what} wanted what can't be driven: the driver is held back" for what in wishes)]
    for column in columns:
        believed = context_range(column)
        rows.append(f"{{{_number(believed.low)}, {_number(believed.high)}, {int(column in DISTANCES)}}}")
        texts.append(f"{column}: not within {believed.low:g} to {believed.high:g} ({believed.reason})")
    return [
        f"enum {{ LANE_WIDTH = 1, COLUMNS = {len(columns)} }};",
        "typedef struct { double low, high; int may_be_infinite; } range_t;",
        f"static const range_t ranges[] = {{{', '.join(rows)}}};",
        f"static const DRIVER_inputs usual_inputs = {{{', '.join(map(_number, usual_values))}}};",
        "enum { FAULT_NONE, "
        + ", ".join(f"FAULT_{name}" for name in FAULTS)
        + f", FAULT_COLUMNS, FAULTS = FAULT_COLUMNS + {len(columns)} }};",
        "static const char *const impossible[] = {" + ",\n    ".join(map(in_c, impossible)) + "};",
        "static const char *const faults[] = {" + ",\n    ".join(map(in_c, texts)) + "};",
    ]


def _number(value: object) -> str:
    """A number as C has it, to the last bit; texts as they are."""
    if isinstance(value, str):
        return value
    if isinstance(value, int | np.integer):
        return str(int(value))
    number = float(value)  # type: ignore[arg-type]
    if np.isinf(number):
        return "(double)INFINITY" if number > 0 else "-(double)INFINITY"
    return repr(number)


def _array(name: str, values: Iterable[Any], kind: str = "double") -> str:
    """A constant array; C has none without an element."""
    numbers = [_number(value) for value in values] or ["0"]
    rows = [", ".join(numbers[first : first + 6]) for first in range(0, len(numbers), 6)]
    return f"static const {kind} {name}[] = {{\n    " + ",\n    ".join(rows) + "};"


# ---- core models -----------------------------------------------------------------------------------------------------
def _autoregressive(model: AutoregressiveModel) -> tuple[dict[str, int], list[str]]:
    table, order, half = phases(), model.coarse.order, len(model.kernel) // 2
    first = max(half, COARSE_EVERY * TICKS)
    parts = (model.coarse_volatility, model.fine_volatility)
    keep = {
        "quick": np.exp(-model.step * COARSE_EVERY / np.array([part.correlation_time for part in parts])),
        "slow": np.exp(-model.step * COARSE_EVERY / np.full(2, SLOW_CORRELATION_TIME)),
    }
    variance = {"quick": [part.within for part in parts], "slow": [part.slow for part in parts]}
    between = np.array([part.between for part in parts])
    constants = {
        "DRIVER_MEAN": model.mean, "DRIVER_BETWEEN": model.between_drivers, "DRIVER_ORDER": order, "KNEE": KNEE_SHARE,
        "HEADROOM": HEADROOM, "CANDIDATES": CANDIDATES, "CORRELATION": model.correlation,
        "OTHER_SHARE": np.sqrt(1.0 - model.correlation**2), "VARIES_SLOWLY": int(any(variance["slow"])),
        "COARSE_NOISE": model.coarse.scale, "PHASE_STEPS": len(table),
        "COARSE_SKIPPED": first - COARSE_EVERY * TICKS, "FINE_SKIPPED": first - half,
    }  # fmt: skip
    rows = ",\n    ".join("{" + ", ".join(map(_number, row)) + "}" for row in table)
    lines = [
        *(f"#define {name} {_number(value)}" for name, value in constants.items()),
        f"static const double phases[PHASE_STEPS][{COARSE_EVERY}] = {{\n    {rows}}};",
        _array("coarse_coefficients", model.coarse.coefficients),
        _array("start_factor", model.start_factor[np.tril_indices(order)]),
        _array("fine_kernel", model.kernel),
        _array("limit", model.limits),
        _array("between", between),
        _array("between_spread", np.sqrt(between)),
        _array("factor_offset", [part.within + part.slow for part in parts]),
    ]
    for name in ("quick", "slow"):
        lines += [
            _array(f"{name}_keep", keep[name]),
            _array(f"{name}_gain", np.sqrt(np.array(variance[name]) * (1.0 - keep[name] ** 2))),
            _array(f"{name}_spread", np.sqrt(variance[name])),
        ]
    sizes = {"STEPS": max(order, len(table)), "EVERY": COARSE_EVERY, "TAPS": len(model.kernel)}
    return sizes, lines


def _two_level(model: TwoLevelModel) -> tuple[dict[str, int], list[str]]:
    table, smoothing, kernel = model.chain.alias_table, model.settings.smoothing_kernel, model.noise.kernel
    reached = np.cumsum(model.chain.stationary)  # as `Generator.choice` does
    return {"STEPS": len(smoothing), "EVERY": 1, "TAPS": len(kernel)}, [
        f"#define DRIVER_MEAN {_number(model.mean)}",
        f"#define DRIVER_BINS {table.n_bins}",
        _array("chain_keep", table.keep),
        _array("chain_other", table.other, "int"),
        _array("bin_centre", model.chain.centres),
        _array("bin_reached", reached / reached[-1]),
        _array("smoothing", smoothing),
        _array("fine_kernel", kernel),
    ]


# ---- effects ---------------------------------------------------------------------------------------------------------
def components_of(effect: kinds.ColumnEffect) -> list[tuple[Shape, ...]]:
    """An effect's quantity, component by component, each a product of shapes of columns.

    Raises `DriverProfileError` if C has no such effect: it is a plug-in's.
    """
    if type(effect) not in kinds.EFFECTS or effect.episode:
        held = " whose last peak is held" if effect.episode else ""
        raise DriverProfileError(f"the C driver has no effect {effect.kind!r}{held}")
    if isinstance(effect, kinds.Product):
        angles = (kinds.Form.SINE, kinds.Form.COSINE)
        at = [2.0 * np.pi / factor.at if factor.form in angles else factor.at for factor in effect.factors]
        return [tuple((factor.form.name, factor.column, k, 0.0) for factor, k in zip(effect.factors, at, strict=True))]
    column = effect.columns[0]
    match effect:
        case kinds.Linear():
            shapes = [("VALUE", 0.0, 0.0)]
        case kinds.Magnitude():
            shapes = [("MAGNITUDE", 0.0, 0.0)]
        case kinds.Saturating():
            shapes = [("SATURATING", effect.middle, effect.scale)]
        case kinds.Threshold():
            shapes = [("STEP_AT" if effect.jump else "HINGE_AT", effect.at, 1.0 if effect.above else -1.0)]
        case kinds.Piecewise():
            shapes = [("VALUE", 0.0, 0.0), *(("BEYOND", knot, 0.0) for knot in effect.knots)]
        case kinds.Levels():
            shapes = [("EQUALS", level, 0.0) for level in effect.levels]
        case kinds.Nearness():
            shapes = [("PRESENCE" if effect.presence else "NEARNESS", effect.scale, 0.0)]
        case kinds.Proximity():
            shapes = [("PROXIMITY", effect.scale, 0.0)]
        case kinds.Angular():
            shapes = [(name, 2.0 * np.pi / effect.period, 0.0) for name in ("SINE", "COSINE")]
        case _:
            raise DriverProfileError(f"the C driver has no effect {effect.kind!r}")
    return [((name, column, first, second),) for name, first, second in shapes]


def _effects(profile: DriverProfile, columned: Sequence[kinds.ColumnEffect]) -> tuple[dict[str, int], list[str]]:
    """Tables of the effects of columns; sizes of what they remember."""
    step, columns = profile.model.step, inputs_of(profile)
    ahead = rows_ahead(profile)
    effects: list[str] = []
    components: list[str] = []
    shifts: list[tuple[int, float, float]] = []
    lags = 0
    for effect in columned:
        quantity = components_of(effect) if effect.coefficients else []
        late = [
            (*split_shift((effect.lag_s + delay) / step), weight) for delay, weight in effect.course or [(0.0, 1.0)]
        ]
        order = effect.response_order if effect.response_s > 0 else 0
        keep = float(np.exp(-step / effect.response_s)) if order else 0.0
        number = next(k for k, one in enumerate(profile.effects, 1) if one is effect)
        mask = sum(1 << columns.index(column) for column in set(effect.columns))
        numbers = (f"ON_{effect.acts.name}", len(components), len(quantity), len(shifts), len(late), order,
                   int(any(effect.between_drivers)), number, keep, f"UINT64_C({mask})")  # fmt: skip
        effects.append("{" + ", ".join(map(_number, numbers)) + "}")
        components += [_component(effect, k, shapes, columns) for k, shapes in enumerate(quantity)]
        shifts += late
        lags += order * len(quantity)
    rows = ahead - min([0, *(whole for whole, _, _ in shifts)]) + 1
    sizes = {"LOOKS": ahead + SAMPLES_AHEAD, "COMPONENTS": max(1, len(components)), "ROWS": rows, "LAGS": max(1, lags)}
    shift_rows = [f"{{{whole}, {_number(share)}, {_number(weight)}}}" for whole, share, weight in shifts]
    return sizes, [
        "enum { " + ", ".join(SHAPES) + " };",
        "enum { " + ", ".join(f"ON_{acts.name}" for acts in kinds.Acts) + " };",
        f"enum {{ EFFECTS = {len(effects)}, COMPONENTS = {len(components)}, AHEAD = {ahead} }};",
        "typedef struct { int kind, column; double a, b; } shape_t;",
        "typedef struct { double reference, coefficient, between, low, high; int levels_off, shapes; "
        "shape_t shape[2]; } component_t;",
        "typedef struct { int whole; double share, weight; } shift_t;",
        "typedef struct { int acts, first, components, first_shift, shifts, order, differs, number; double keep; "
        "uint64_t columns; } effect_t;",
        _structs("component_t components", components, "{0, 0, 0, 0, 0, 0, 0, {{0, 0, 0, 0}, {0, 0, 0, 0}}}"),
        _structs("shift_t shifts", shift_rows, "{0, 0, 0}"),
        _structs("effect_t effects", effects, "{0, 0, 0, 0, 0, 0, 0, 0, 0, 0}"),
    ]


def _structs(what: str, rows: Sequence[str], none: str) -> str:
    """A constant array of structs; C has none without an element."""
    return f"static const {what}[] = {{\n    " + ",\n    ".join(rows or [none]) + "};"


def _component(effect: kinds.ColumnEffect, k: int, shapes: Sequence[Shape], columns: Sequence[str]) -> str:
    low, high = effect.response_range[k] if effect.response_range else (-np.inf, np.inf)
    between = effect.between_drivers[k] if effect.between_drivers else 0.0
    numbers = (effect.reference[k], effect.coefficients[k], between, low, high, int(effect.levels_off), len(shapes))
    table = [f"{{{kind}, {columns.index(name)}, {_number(a)}, {_number(b)}}}" for kind, name, a, b in shapes]
    table += ["{VALUE, 0, 0.0, 0.0}"] * (2 - len(shapes))
    return "{" + ", ".join(map(_number, numbers)) + ", {" + ", ".join(table) + "}}"


def _hidden(profile: DriverProfile, hidden: Sequence[kinds.HiddenEffect]) -> list[str]:
    rows, numbers = [], list[float]()
    for effect in hidden:
        kind, values = _hidden_numbers(effect, profile.model.step)
        rows.append(f"{{{kind}, {len(numbers)}}}")
        numbers += values
    return [
        "enum { ADAPTED, POPULATION, JUMP, TREND, SMOOTH, DRIFT, CYCLE, REGIMES" + f", HIDDEN = {len(hidden)} }};",
        "typedef struct { int kind, first; } hidden_t;",
        _structs("hidden_t hidden", rows, "{0, 0}"),
        _array("hidden_numbers", numbers),
    ]


def _hidden_numbers(effect: kinds.HiddenEffect, step: float) -> tuple[str, list[float]]:
    """Kind and numbers of an effect; `DriverProfileError` if C has no such effect."""
    if type(effect) not in kinds.EFFECTS:
        raise DriverProfileError(f"the C driver has no effect {effect.kind!r}")
    match effect:
        case kinds.Adapted():
            return "ADAPTED", [effect.shift, effect.spread, effect.rate, effect.fine]
        case kinds.Population():
            return "POPULATION", [effect.shift, effect.log_spread, effect.log_fine]
        case kinds.Step():
            return "JUMP", [effect.size, effect.at_s, effect.share_before]
        case kinds.VarianceTrend():
            return "TREND", [effect.factor, effect.fine_factor, effect.from_s, effect.to_s]
        case kinds.TimeSmooth():
            sizes = (effect.location, effect.spread, effect.fine)
            return "SMOOTH", [effect.from_s, effect.to_s, *map(len, sizes), *(size for part in sizes for size in part)]
        case kinds.Drift():
            return "DRIFT", [effect.size, float(np.exp(-step / effect.correlation_s))]
        case kinds.Cycle():
            return "CYCLE", [effect.amplitude, effect.period_s, float(np.sqrt(step / effect.coherence_s))]
        case kinds.Regimes():
            return "REGIMES", [effect.factor, effect.fine_factor, effect.on_s, effect.off_s]
    raise DriverProfileError(f"the C driver has no effect {effect.kind!r}")


# ---- numpy's normal and exponential numbers --------------------------------------------------------------------------
ZIGGURAT_LAYERS = 256


@cache
def ziggurats() -> tuple[str, ...]:
    """Tables of the ziggurats that numpy draws normal and exponential numbers from, layers of equal area [1]_.

    Computed to 40 digits; numpy's own table is within 1e-14 of it, relative.

    References
    ----------
    .. [1] G. Marsaglia, W. W. Tsang, "The Ziggurat Method for Generating Random Variables", J. Statistical Software 5,
           2000.
    """
    with localcontext(prec=40):
        tail = Decimal("3.6541528853610087963519472518")  # where numpy's begin; that of the normal density ends in ...
        mills_ratio = 1 / reduce(lambda value, n: tail + n / value, range(400, 0, -1), tail)  # ... a continued fraction
        normal = (lambda x: (-x * x / 2).exp(), lambda y: (-2 * y.ln()).sqrt())
        exponential = (lambda x: (-x).exp(), lambda y: -y.ln())
        return (
            *_ziggurat("normal", tail, mills_ratio, 52, *normal),
            *_ziggurat("exponential", Decimal("7.6971174701310497140446280481"), Decimal(1), 53, *exponential),
        )


def _ziggurat(name: str, tail: Decimal, beyond: Decimal, bits: int, density: Any, inverse: Any) -> list[str]:
    """Of a density whose tail has `beyond` times its height as area."""
    area, borders = density(tail) * (tail + beyond), [tail]
    while len(borders) < ZIGGURAT_LAYERS - 1:
        borders.insert(0, inverse(area / borders[0] + density(borders[0])))
    widths, scale = [area / density(tail), *borders], Decimal(2) ** bits
    inside = [tail / widths[0] * scale, 0, *(low / high * scale for low, high in pairwise(borders))]
    return [
        f"#define {name.upper()}_TAIL {float(tail)!r}",
        _array(f"{name}_inside", (f"UINT64_C({int(value)})" for value in inside), "uint64_t"),
        _array(f"{name}_width", (width / scale for width in widths)),
        _array(f"{name}_height", [1.0, *map(density, borders)]),
    ]
