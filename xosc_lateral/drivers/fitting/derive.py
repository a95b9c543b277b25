"""A driver from stated figures: what a profile does, made larger, slower or elsewhere, until it has them.

The driver is a single one: where the base is a population, its typical driver, without what differs between drivers. A
base's movement has four handles, those of the effect `Adapted`: a shift, factors on coarse and fine movement, a rate.
Variances and squared lateral speeds of both parts add up, and a memory is in inverse proportion to the rate, so that
figures give the handles in closed form. Long free runs of the result are measured, the handles corrected by what
they miss, and the result measured again with other seeds: those are the figures that it is said to have.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from msgspec import structs

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.segment import MINIMUM_SPEED
from xosc_lateral.base.version import __version__
from xosc_lateral.drivers.evaluation.lane_keeping import HIGHWAY_SPEED, LaneKeeping, highway_drives, lane_keeping
from xosc_lateral.drivers.evaluation.look_words import in_words
from xosc_lateral.drivers.model.core.autoregressive.model import AutoregressiveModel
from xosc_lateral.drivers.model.effects import Acts, Adapted, ColumnEffect, Population
from xosc_lateral.drivers.model.effects.base import FACTOR_LIMIT
from xosc_lateral.drivers.model.plausibility import UNCOMFORTABLE_SHARE, strain
from xosc_lateral.drivers.model.profile import DriverProfile

TOLERANCE = 0.02
"""Figures are reached within this share of what was asked; a mean within it of the standard deviation. [-]"""

DESIGN_SEED, PROOF_SEED = 20261, 20262
"""Seeds of the runs that handles are corrected by, and of those that the result is measured with. [-]"""

DRIVE_COUNT = 240
"""Of an hour each, twice as many for a memory or a share near a line: standard errors are 0.3 % of an SDLP, 0.6 % of a
memory, 2 % of a share of 0.02."""

CORRECTIONS = 4
"""At most; one is enough where figures answer to the handles as the closed form has it. [-]"""

TRUCK_HALF_WIDTH = 1.275
"""Half the largest width of a lorry in the European Union (Directive 96/53/EC, annex I: 2.55 m). [m]"""


class Derived(NamedTuple):
    """A profile, what was asked, and what it has."""

    profile: DriverProfile
    asked: Asked
    reached: LaneKeeping

    def __str__(self) -> str:
        asked = self.asked.figures
        had = [f"{name} {value:g}, reached {getattr(self.reached, name):.4g}" for name, value in asked.items()]
        if "near_line" in asked and "mean" not in asked and self.asked.size_is_given:
            side = "left" if self.reached.mean > 0 else "right"
            had.append(f"for which he drives {abs(self.reached.mean):.2f} m {side} of the lane's middle")
        lines = [f"{self.profile.name}: " + ("; ".join(had) or "as its base"), in_words(self.profile)]
        return "\n".join(line for line in lines if line)


def derive(base: DriverProfile, asked: Asked, name: str, *, preset: Preset | None = None) -> Derived:
    """A driver with stated figures.

    `base`: gives what is not stated; `name`: the new profile's id; `preset`: that the figures are of. Raises
    `DriverProfileError`: if figures contradict each other, are too far from the base's, or no car could drive them.
    """
    asked.check()
    speed = HIGHWAY_SPEED if asked.speed is None else asked.speed
    plain, adapted = _of_class(_single(base), asked.vehicle)
    plain = structs.replace(plain, name=name)
    half_width = TRUCK_HALF_WIDTH if asked.vehicle == "truck" else None
    count = DRIVE_COUNT if asked.memory is None and asked.near_line is None else 2 * DRIVE_COUNT

    def measured(handles: Adapted, seed: int) -> tuple[LaneKeeping, FloatArray]:
        drives = highway_drives(plain.with_effects(handles), seed, speed=speed, drives=count)
        step, simulated = plain.model.step, (drives.size * plain.model.step, len(drives))
        return lane_keeping(drives, plain.lane_width, step, half_width=half_width, recorded=simulated), drives

    known, drives = measured(adapted, DESIGN_SEED)
    if asked.sdlp_change is not None:
        if known.sdlp + asked.sdlp_change <= 0.0:
            raise DriverProfileError(f"the SDLP of {base.name} is {known.sdlp:.3f} m: it can't be so much smaller")
        asked = replace(asked, sdlp=known.sdlp + asked.sdlp_change, sdlp_change=None)
    within = drives - drives.mean(axis=1, keepdims=True)
    parts = _parts(known, measured(structs.replace(adapted, fine=0.5 * adapted.fine), DESIGN_SEED)[0])
    handles, reached, want = adapted, known, asked
    for _ in range(CORRECTIONS):
        handles = _handles(adapted, known, parts, within, want, plain.lane_width)
        reached, _ = measured(handles, DESIGN_SEED)
        if not _missed(asked, reached, share=0.25):
            break
        want = _corrected(want, asked, reached)
    reached, drives = measured(handles, PROOF_SEED)
    missed = _missed(asked, reached)
    if missed:
        raise DriverProfileError(f"{base.name} can't have these together: {'; '.join(missed)}")
    _check_drivable(drives, plain, speed)
    reached = replace(reached, errors={})  # the simulation's, which say nothing of drivers
    return Derived(_described(plain.with_effects(handles), base, asked, reached, speed, preset), asked, reached)


def _single(base: DriverProfile) -> DriverProfile:
    """The typical driver of a population: without what differs between its drivers."""
    model = base.model
    if isinstance(model, AutoregressiveModel):
        alike = {
            name: structs.replace(getattr(model, name), between=0.0)
            for name in ("coarse_volatility", "fine_volatility")
        }
        model = structs.replace(model, between_drivers=0.0, **alike)
    effects = [
        structs.replace(effect, between_drivers=()) if isinstance(effect, ColumnEffect) else effect
        for effect in base.effects
        if not isinstance(effect, Population)
    ]
    return structs.replace(base, model=model, effects=tuple(effects))


def _of_class(base: DriverProfile, vehicle: str | None) -> tuple[DriverProfile, Adapted]:
    """The base with what it knows of trucks made its own, where that is asked."""
    if vehicle is None:
        return base, Adapted()
    of_trucks = [
        effect for effect in base.effects if isinstance(effect, ColumnEffect) and effect.columns == ("is_truck",)
    ]
    if not of_trucks:
        raise DriverProfileError(f"{base.name} doesn't know how trucks differ: no effect of is_truck")
    changes = dict.fromkeys(Acts, 0.0)
    for effect in of_trucks:
        strength = effect.strength(base.model.step, {"is_truck": np.ones(2)})
        changes[effect.acts] += 0.0 if strength is None else float(strength[-1])
    rest = tuple(effect for effect in base.effects if effect not in of_trucks)
    factors = {acts.value: float(np.exp(changes[acts])) for acts in (Acts.SPREAD, Acts.RATE, Acts.FINE)}
    return structs.replace(base, effects=rest), Adapted(shift=changes[Acts.LOCATION], **factors)


class _Parts(NamedTuple):
    """Variances [m2] and mean squared lateral speeds [m2/s2] of the coarse and the fine movement."""

    coarse: float
    fine: float
    coarse_speed: float
    fine_speed: float


def _parts(known: LaneKeeping, quiet: LaneKeeping) -> _Parts:
    """From a driver and the same with half of the fine movement."""
    share = 1.0 - 0.5**2
    fine = max((known.sdlp**2 - quiet.sdlp**2) / share, 0.0)
    fine_speed = max((known.restlessness**2 - quiet.restlessness**2) / share, 0.0)
    return _Parts(known.sdlp**2 - fine, fine, known.restlessness**2 - fine_speed, fine_speed)


def _handles(
    start: Adapted, known: LaneKeeping, parts: _Parts, within: FloatArray, want: Asked, lane_width: float
) -> Adapted:
    """Closed form: from the base's figures, and its deviations `within` drives [m], to those wanted."""
    limit = known.limit_near_line
    mean = known.mean if want.mean is None else want.mean
    rate = 1.0 if want.memory is None else known.memory / want.memory
    size, fine = 1.0, None
    if want.sdlp is None and want.restlessness is not None and want.memory is not None:
        size = want.restlessness / (rate * known.restlessness)  # from speed and memory follows how far
    elif want.sdlp is None and want.near_line is not None:
        size = _solved(
            lambda k: _within_tolerance(mean + k * within, limit), want.near_line, 1 / FACTOR_LIMIT, FACTOR_LIMIT
        )
    elif want.sdlp is not None:
        size = want.sdlp / known.sdlp
    if want.restlessness is not None and want.memory is None:
        rate = want.restlessness / (size * known.restlessness)
        if want.sdlp is not None:  # slower movement has less of the fine one in its variance
            size = want.sdlp / float(np.sqrt(parts.coarse + rate**2 * parts.fine))
            rate = want.restlessness / (size * known.restlessness)
    elif want.restlessness is not None and want.sdlp is not None:
        left = want.restlessness**2 - size**2 * rate**2 * parts.coarse_speed
        fine = float(np.sqrt(max(left, 0.0) / max(parts.fine_speed, 1e-12)))
        if fine < size * rate / FACTOR_LIMIT:
            least = size * rate * float(np.sqrt(parts.coarse_speed + parts.fine_speed / FACTOR_LIMIT**2))
            raise DriverProfileError(
                f"an SDLP of {want.sdlp:.3g} m with a memory of {want.memory:.3g} s moves at {least:.3g} m/s at least: "
                f"a restlessness of {want.restlessness:.3g} m/s can't be had with them"
            )
    if want.near_line is not None and want.mean is None and want.size_is_given:
        away = 1.0 if known.mean >= 0 else -1.0
        moved = _solved(
            lambda m: _within_tolerance(away * m + size * within, limit), want.near_line, 0.0, 0.5 * lane_width
        )
        mean = away * moved
    fine = start.fine * (size * rate if fine is None else fine)
    spread, rate = start.spread * size, start.rate * rate
    for word, factor in (("large", spread), ("quick", rate), ("restless", fine)):
        if not 1.0 / FACTOR_LIMIT <= factor <= FACTOR_LIMIT:
            raise DriverProfileError(
                f"movement {factor:.2g} times as {word} as the base's (SDLP {known.sdlp:.3f} m, restlessness "
                f"{known.restlessness:.3f} m/s, memory {known.memory:.2g} s): {1 / FACTOR_LIMIT:g} to "
                f"{FACTOR_LIMIT:g} times can be had"
            )
    return Adapted(shift=start.shift + mean - known.mean, spread=spread, rate=rate, fine=fine)


def _within_tolerance(offset: FloatArray, limit: float) -> float:
    return float((np.abs(offset) > limit).mean())


def _solved(share: Callable[[float], float], wanted: float, low: float, high: float) -> float:
    """Where a share that grows becomes what is wanted, by halving."""
    if not share(low) < wanted < share(high):
        raise DriverProfileError(
            f"near line {wanted:g}: with what else is stated or the base gives it lies between {share(low):.2g} and "
            f"{share(high):.2g}"
        )
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if share(middle) < wanted else (low, middle)
    return 0.5 * (low + high)


def _missed(asked: Asked, reached: LaneKeeping, *, share: float = 1.0) -> list[str]:
    """Figures that are not reached within so much of the tolerance, in words."""
    failures = []
    for name, value in asked.figures.items():
        had = getattr(reached, name)
        scale = reached.sdlp if name == "mean" else value
        known_to = 0.0 if share < 1.0 else 2.0 * reached.errors.get(name, 0.0)  # what runs as many can't tell
        if abs(had - value) > share * TOLERANCE * scale + known_to:
            failures.append(f"{name.replace('_', ' ')} {value:.4g} asked, {had:.4g} reached")
    return failures


def _corrected(want: Asked, asked: Asked, reached: LaneKeeping) -> Asked:
    """What to want instead, by what was missed."""
    now = {}
    for name, value in asked.figures.items():
        had, wanted = getattr(reached, name), getattr(want, name)
        now[name] = wanted + value - had if name == "mean" else wanted * value / max(had, 1e-6)
    return replace(want, **now)


def _check_drivable(drives: FloatArray, profile: DriverProfile, speed: float) -> None:
    out = float((np.abs(drives) > 0.5 * profile.lane_width).mean())
    if out > UNCOMFORTABLE_SHARE:
        raise DriverProfileError(
            f"the vehicle's middle would be out of its lane of {profile.lane_width:.2f} m for {out:.1%} of the time"
        )
    strains = [strain(drive, profile.model.step, np.full(len(drive), speed)) for drive in drives]
    worst = sorted(strains, key=lambda strained: strained.excess)[len(strains) // 2]
    if worst.excess > 1.0:  # in every second hour
        raise DriverProfileError(
            f"no car could drive it: lateral acceleration above {worst.seldom:.2f} m/s2 for 0.1 % of the time, at most "
            f"{worst.largest:.2f} m/s2, jerk at most {worst.jerk:.1f} m/s3 (see `model.plausibility`)"
        )


def _described(
    profile: DriverProfile,
    base: DriverProfile,
    asked: Asked,
    reached: LaneKeeping,
    speed: float,
    preset: Preset | None,
) -> DriverProfile:
    """With a provenance that says from what it was derived, what was asked and reached."""
    stated = asked.figures
    reach = {name: round(getattr(reached, name), 5) for name in stated}
    words = [f"{name.replace('_', ' ')} {value:.4g} (reached {reach[name]:.4g})" for name, value in stated.items()]
    notes = f"Derived from {base.name}: {', '.join(words) or 'as its base'}, at {speed:.3g} m/s."
    fit: dict[str, object] = {
        "derived_from": base.name,
        "asked": stated if asked.vehicle is None else {**stated, "vehicle": asked.vehicle},
        "reached": reach,
        "speed": round(speed, 3),
    }
    if (look := base.provenance.fit.get("look")) is not None:
        fit["look"] = look  # at the base
    if preset is not None:
        notes = f"{preset.what[0].upper()}{preset.what[1:]}. {notes}"
        fit["preset"] = {"name": preset.name, "source": preset.source, "doi": preset.doi}
    provenance = structs.replace(
        base.provenance,
        source=f"derived from {base.name}, which is of: {base.provenance.source}",
        fit=fit,
        evaluation={},
        package_version=__version__,
        notes=notes,
    )
    known = base.metadata
    metadata = structs.replace(known, tags=(*known.tags, "derived"), vehicle=asked.vehicle or known.vehicle)
    return structs.replace(profile, provenance=provenance, metadata=metadata, sensor=None)


# ---- what can be asked of a driver, and states of drivers that a source gives figures of ----
@dataclass(frozen=True, slots=True)
class Asked:
    """Figures that a driver is to have; None: the base's."""

    sdlp: float | None = None  # Standard deviation of lateral position, as the highway driving test has it. [m]
    sdlp_change: float | None = None  # The same, as a difference from the base's. [m]
    mean: float | None = None  # Mean offset, positive left. [m]
    restlessness: float | None = None  # Standard deviation of lateral speed. [m/s]
    memory: float | None = None  # After which a deviation is correlated with itself by 1/e. [s]
    near_line: float | None = None  # Share of time with a side within 0.2 m of a marking, or beyond it. [-]
    speed: float | None = None  # At which the figures hold. [m/s]
    vehicle: str | None = None  # "truck": what the base knows of trucks.

    def check(self) -> None:
        """Refuse what no driver has."""
        for name, unit in (("sdlp", " m"), ("restlessness", " m/s"), ("memory", " s"), ("near_line", "")):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < np.inf:
                raise DriverProfileError(f"{name.replace('_', ' ')} of {value:g}{unit}: it is above 0")
        if self.near_line is not None and self.near_line >= 1.0:
            raise DriverProfileError(f"near line {self.near_line:g}: a share of the time is below 1")
        if self.sdlp is not None and self.sdlp_change is not None:
            raise DriverProfileError("an SDLP and a change of it: one of both")
        if self.speed is not None and not MINIMUM_SPEED <= self.speed < 100.0:
            raise DriverProfileError(
                f"speed of {self.speed:g} m/s: profiles say nothing below {MINIMUM_SPEED:.1f} m/s, or from 100 m/s on"
            )
        if self.vehicle not in (None, "truck"):
            raise DriverProfileError(f"class {self.vehicle!r}: expected truck")
        if self.mean is not None and not np.isfinite(self.mean):
            raise DriverProfileError(f"mean of {self.mean:g} m")

    @property
    def figures(self) -> dict[str, float]:
        """Those that are stated, by name."""
        values = {name: getattr(self, name) for name in ("sdlp", "mean", "restlessness", "memory", "near_line")}
        return {name: value for name, value in values.items() if value is not None}

    @property
    def size_is_given(self) -> bool:
        """Whether the size of the movement follows from other figures than the time near a marking."""
        return self.sdlp is not None or (self.restlessness is not None and self.memory is not None)


@dataclass(frozen=True, slots=True)
class Preset:
    """A state of a driver that a source gives figures of."""

    name: str
    what: str
    asked: Asked
    source: str
    doi: str


PRESETS = (
    Preset(
        "alcohol-0.5",
        "0.5 g/l of alcohol in the blood: SDLP 2.5 cm larger (95 % interval 2.0 to 2.9), 182 drivers, on the road",
        Asked(sdlp_change=0.025),
        "S. Jongen et al., A pooled analysis of on-the-road highway driving studies in actual traffic measuring "
        "standard deviation of lateral position while driving at a blood alcohol concentration of 0.5 g/L, "
        "Psychopharmacology 234, 2017, pp. 837-844",
        "10.1007/s00213-016-4519-z",
    ),
    Preset(
        "drowsy",
        "after a night without sleep: SDLP 3.1 cm larger, 24 drivers, on the road",
        Asked(sdlp_change=0.031),
        "S. Jongen et al., Sensitivity and validity of psychometric tests for assessing driving impairment: effects of "
        "sleep deprivation, PLoS ONE 10(2), 2015, e0117045",
        "10.1371/journal.pone.0117045",
    ),
    Preset(
        "truck",
        "what the base's own recording says of trucks",
        Asked(vehicle="truck"),
        "DLR Highway Traffic v1.1.0, where the base is a shipped population",
        "10.5281/zenodo.14012005",
    ),
)
"""Only what a source states; each is a difference from the base, whose figures are those of the sober and rested."""


def preset_called(name: str) -> Preset:
    """A preset by name."""
    for preset in PRESETS:
        if preset.name == name:
            return preset
    raise DriverProfileError(f"no preset {name!r}; there are {', '.join(preset.name for preset in PRESETS)}")
