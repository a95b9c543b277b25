"""How speeds and lateral positions go from a start to a target value (OpenSCENARIO `TransitionDynamics`).

With a the start, b the change, c the range of the parameter (time or distance) and p the parameter:
linear a + b p / c; cubic a + b (p/c)^2 (3 - 2 p/c); sinusoidal a + b (1 - cos(pi p/c)) / 2; step: a + b at once.
A dynamics dimension `rate` gives the peak of the slope, hence c = |b| / rate, 1.5 |b| / rate, pi |b| / (2 rate).

The peaks are those of the derivatives, at p = c / 2: (6 / 4) b / c of the cubic, (pi / 2) b / c of the sinusoid.
"""

from __future__ import annotations

from dataclasses import InitVar, dataclass
from math import copysign, cos, inf, pi, sin, sqrt

from xosc_lateral.world.scenario.enums import DynamicsDimension, DynamicsShape
from xosc_lateral.world.scenario.private_actions import TransitionDynamics

EPSILON = 1e-6
"""Below this, times, lengths and speeds count as equal (the reference player's tolerance). [s], [m], [m/s]"""

_PEAK_SLOPE = {DynamicsShape.LINEAR: 1.0, DynamicsShape.CUBIC: 1.5, DynamicsShape.SINUSOIDAL: 0.5 * pi}
"""Peak slope times c / |b|."""


@dataclass(slots=True)
class Transition:
    """A transition under way."""

    shape: DynamicsShape
    dimension: DynamicsDimension  # of the parameter: seconds (`time`, `rate`) or metres (`distance`)
    parameter_range: InitVar[float]  # a step has none; for `rate` the peak slope, whose sign does not matter
    start: float = 0.0
    target: float = 0.0
    parameter: float = 0.0
    scale: float = 1.0
    peak_rate: float = 0.0
    range: float = 0.0

    def __post_init__(self, parameter_range: float) -> None:
        """Take the value as the dimension means it."""
        if self.dimension is DynamicsDimension.RATE:
            self.peak_rate = abs(parameter_range)
        elif self.shape is not DynamicsShape.STEP:
            self.range = parameter_range

    @classmethod
    def of(cls, dynamics: TransitionDynamics) -> Transition:
        """A transition as an action asks for it."""
        return cls(dynamics.shape, dynamics.dimension, dynamics.value)

    def begin(self, start: float, target: float) -> None:
        """Set both ends; the parameter goes back to 0."""
        self.start = start
        self.parameter = 0.0
        self.scale = 1.0
        self.aim(target)

    def aim(self, target: float) -> None:
        """Set the target, keeping the parameter (targets that move)."""
        self.target = target
        if self.dimension is DynamicsDimension.RATE:
            change, peak = abs(target - self.start), self.peak_rate
            if self.shape is DynamicsShape.STEP or change == peak == 0.0:
                self.range = EPSILON
            else:
                self.range = max(_PEAK_SLOPE[self.shape] * change / peak, EPSILON) if peak else inf

    def limit_slope(self, limit: float) -> None:
        """Stretch the transition so that its slope stays under `limit` (per second, sign ignored)."""
        peak = abs(self.peak_slope())
        limit = max(abs(limit), EPSILON)
        self.scale = peak / limit if peak > limit else 1.0

    def range_for_curvature(self, limit: float) -> float:
        """Shortest range whose second derivative stays under `limit`.

        A linear transition has an infinite second derivative at its ends; it gets the range of the cubic one, as in the
        reference player.
        """
        if self.shape is DynamicsShape.STEP or limit == inf:
            return 0.0
        change = abs(self.target - self.start)
        if limit <= 0.0:
            return 0.0 if change == 0.0 else inf  # it never gets there
        if self.shape is DynamicsShape.SINUSOIDAL:
            return pi * sqrt(change / (2.0 * limit))
        return sqrt(6.0 * change / limit)

    @property
    def is_step(self) -> bool:
        """The target is reached at once."""
        return self.shape is DynamicsShape.STEP or (
            self.dimension is not DynamicsDimension.RATE and self.range < EPSILON
        )

    @property
    def is_done(self) -> bool:
        """The parameter has run through its range."""
        return self.parameter > self.range - EPSILON

    def value(self, shape: DynamicsShape | None = None) -> float:
        """Value at the present parameter; `shape` replaces the transition's own."""
        if self.is_step:
            return self.target
        change = self.target - self.start
        u = self.parameter / max(self.range, EPSILON)
        shape = shape or self.shape
        if shape is DynamicsShape.LINEAR:
            return self.start + change * u
        if shape is DynamicsShape.CUBIC:
            return self.start + change * u * u * (3.0 - 2.0 * u)
        return self.start + 0.5 * change * (1.0 - cos(pi * u))

    def slope(self) -> float:
        """Derivative of the value by the (unstretched) parameter; huge for a step."""
        change = self.target - self.start
        if self.is_step:
            return copysign(1e10, change)
        c = max(self.range, EPSILON)
        if self.shape is DynamicsShape.LINEAR:
            return change / c
        u = self.parameter / c
        if self.shape is DynamicsShape.CUBIC:
            return 6.0 * change * (1.0 - u) * u / c
        return 0.5 * pi * change * sin(pi * u) / c

    def peak_slope(self) -> float:
        """Largest slope of the whole transition."""
        if self.dimension is DynamicsDimension.RATE:
            return self.peak_rate
        change = self.target - self.start
        return copysign(1e10, change) if self.is_step else _PEAK_SLOPE[self.shape] * change / max(self.range, EPSILON)

    def advance(self, delta: float) -> None:
        """Move the parameter by `delta` (divided by the stretch), staying within 0 and the range."""
        self.parameter = min(max(self.parameter + delta / self.scale, 0.0), self.range)
