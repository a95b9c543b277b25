"""What every core model can do: two independent parts, coarse and fine, sampled apart and in pieces of any length.

References
----------
.. [1] N. Neis, J. Beyerer, "A two-level stochastic model for the lateral movement of vehicles within their lane", IEEE
       ITSC 2023, pp. 1896-1903, arXiv:2405.17080: the split into both parts.
.. [2] E. Catmull, R. Rom, "A class of local interpolating splines", Computer Aided Geometric Design, 1974.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Any, ClassVar, Protocol

import msgspec
import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.records import Record, frozen_array, kebab, set_once


@dataclass(frozen=True, slots=True)
class Start:
    """Where sampled drives begin: ``mean + spread * (coarse - mean) + fine * fine part`` is `rel_offset` at first.

    In lane widths, positive left, one for all or of shape (drivers,); factors are the effects' at that moment. [-]
    """

    rel_offset: float | FloatArray
    spread: float = 1.0
    fine: float = 1.0


class CoreStream(Protocol):
    """One driver on one drive, or several at once. Two calls for n and m steps give what one call for n + m gives.

    A stream can be copied (`copy.deepcopy`) to come back to a state.
    """

    state: Any  # All that changes while driving, a msgspec struct; `CoreModel.resume` goes on from it.

    @property
    def mean(self) -> FloatArray | float:
        """What each driver's coarse part moves about, shape (drivers,), or a number for a single one. [-]"""
        ...

    def take(self, n: int, rate: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Next n values of the coarse and of the fine part, shape (n, drivers), or (n,) for a single driver.

        In lane widths, positive left. `rate` of the coarse part's mean reversion at each step, shape (n,), > 0 [-].
        """
        ...


class CoreModel(Record, frozen=True, tag_field="kind", tag=kebab, eq=False):
    """Parameters of a core model: frozen, numbers only. A new one subclasses this and is listed in `registry`."""

    kind: ClassVar[str]  # Name in the profile file: the class's without `Model`, in lower case with hyphens.

    State: ClassVar[type]  # Type of its streams' state.

    # Whether its fine part is a share of the lane's width, or as large in any lane.
    fine_scales_with_lane: ClassVar[bool] = True

    def __init_subclass__(cls, **settings: Any) -> None:
        super().__init_subclass__(**settings)
        cls.kind = kebab(cls.__name__)

    @property
    def step(self) -> float:
        """Between two samples. [s]"""
        raise NotImplementedError

    @property
    def mean(self) -> float:
        """Mean offset over all drivers that the model stands for. [-]"""
        raise NotImplementedError

    @abstractmethod
    def stream(
        self, seed: np.random.SeedSequence, start: Start | None = None, *, drivers: int | None = None
    ) -> CoreStream:
        """Begin a drive; without `start` as chance has it.

        Or so many drives of as many `drivers` at once: arrays then have an axis of drivers. One driver gives the
        numbers that a drive by itself gives; of several, each has others, from the same sources of chance.
        """

    @abstractmethod
    def resume(self, state: Any) -> CoreStream:
        """Go on from a stream's state (which is not copied)."""


class ModelKind(StrEnum):
    """Core models of this package; `registry` knows those of plug-ins too, and older names."""

    TWO_LEVEL = "two-level"
    """The paper's, to the letter."""
    AUTOREGRESSIVE = "autoregressive"
    """Ours."""


# ---- coarse movement at a varying rate of mean reversion: the same path, run through faster or slower ----
# A process that reverts to its mean twice as fast is the process itself in a time that runs twice as fast (a change of
# time). A series known at even steps of its own time is therefore read off at uneven ones.
class ClockState(msgspec.Struct):
    """Where a changed time is."""

    time: float = 0.0  # Own time of the next value, in steps. [-]
    held: FloatArray | None = None  # Values of the source that are still needed, shape (k, drivers).
    first: int = 0  # Index in the source of the first of them.


def take_at_rate(state: ClockState, source: Callable[[int], FloatArray], n: int, rate: FloatArray | None) -> FloatArray:
    """Next n values of a source whose own time passes at a rate.

    Between the source's values they lie on Catmull-Rom cubics: through the values, with a continuous slope. At rate 1
    from the start on the source's values are handed through, bit by bit.

    Raises `ValueError` if a rate, steps of own time per step, shape (n,), is not above 0 or not finite. ``source(n)``
    gives the next n values, shape (n, drivers); `state` goes on.
    """
    if rate is None and state.time == 0.0:
        return source(n)
    steps = np.ones(n) if rate is None else np.asarray(rate, dtype=np.float64)
    if steps.shape != (n,) or not (np.isfinite(steps).all() and (steps > 0).all()):
        raise ValueError(f"rate: expected {n} finite values > 0")
    # Added up one by one from where the last call ended, so that pieces give the same sums as the whole.
    times = np.cumsum(np.concatenate([[state.time], steps]))
    state.time, times = float(times[-1]), times[:-1]
    held = source(0) if state.held is None else state.held
    if not len(times):
        return held[:0]
    knots = np.floor(times).astype(np.int64)
    fraction = (times - knots)[:, None]
    missing = int(knots[-1]) + 3 - (state.first + len(held))
    if missing > 0:
        held = np.concatenate([held, source(missing)])
    at = knots - state.first
    before, here, there, behind = held[np.maximum(at - 1, 0)], held[at], held[at + 1], held[at + 2]
    bend = 2 * before - 5 * here + 4 * there - behind
    twist = 3 * (here - there) + behind - before
    result = here + 0.5 * fraction * (there - before + fraction * (bend + fraction * twist))
    done = max(0, int(knots[-1]) - 2 - state.first)
    state.held, state.first = held[done:], state.first + done
    return np.asarray(result)


# ---- fine movement: uniform white noise shaped by a kernel, phi = R * k (arXiv:2405.17080, section III) ----
# The amplitude spectrum of the measured fine part, relative to that of the noise, is approximated by a piecewise linear
# damping function over frequency; its inverse transform is the kernel.
N_KNOTS, KERNEL_TAPS = 11, 51
"""Knots of the damping function, and taps of the kernel (odd): 10 s at 5 Hz, one snippet. [-]"""


class ShapedNoise(Record, frozen=True, eq=False, dict=True):
    """Noise with a damping function.

    Raises `DriverProfileError` if a damping is negative or not finite, or the kernel's length even.
    """

    # At frequencies evenly spaced from 0 to half the sampling rate, shape (n_knots,); >= 0. [lane widths]
    damping: FloatArray
    n_taps: int = KERNEL_TAPS  # Length of the kernel, odd.
    taper: float = 0.0  # Shape of the Kaiser window that the kernel is faded out by; 0: cut off, as in the paper. [-]

    def __post_init__(self) -> None:
        damping = frozen_array(self.damping)
        if damping.ndim != 1 or len(damping) < 2 or not np.isfinite(damping).all() or damping.min() < 0:
            raise DriverProfileError(f"fine noise: damping {damping.tolist()}, expected two or more values >= 0")
        if self.n_taps < 1 or self.n_taps % 2 == 0:
            raise DriverProfileError(f"fine noise: kernel of {self.n_taps} taps, expected an odd number")
        set_once(self, damping=damping)

    @cached_property
    def kernel(self) -> FloatArray:
        """Inverse transform of the damping: real, symmetric about its middle, shape (n_taps,). [lane widths]"""
        frequency = np.arange(self.n_taps // 2 + 1) * 2.0 / self.n_taps  # in units of half the sampling rate
        damping = np.interp(frequency, np.linspace(0.0, 1.0, len(self.damping)), self.damping)
        kernel = np.roll(np.fft.irfft(damping, self.n_taps), self.n_taps // 2)
        return np.asarray(kernel * np.kaiser(self.n_taps, self.taper))


NOISE_VARIANCE = 1.0 / 12.0
"""Of uniform noise in [-0.5, 0.5). [-]"""
