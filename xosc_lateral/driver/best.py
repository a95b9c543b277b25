"""Our model: drivers that differ, coarse movement with a memory, fine noise, both more lively at times than at others.

Two levels as in the paper's, x = kappa + phi, each repaired where it falls short:

- kappa is the driver's own mean plus an autoregression of order 16 at one step a second, brought to 5 Hz by a low-pass:
  memory beyond one step, and a smooth path instead of a staircase.
- phi is uniform white noise shaped by a kernel, as in the paper, with a spectrum that complements that of kappa.
- A factor on either, the driver's liveliness, differs between drivers and wanders while driving; both are correlated.
- A driver is drawn for a whole drive. A drive that must start at an offset is one of those that pass through it: the
  driver is drawn given the offset, and the movement is conditioned on it, exactly for Gaussian movement.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.autoregression import Autoregression
from xosc_lateral.driver.bands import COARSE_EVERY, building_low_pass
from xosc_lateral.driver.best_stream import BestStream
from xosc_lateral.driver.core import Start
from xosc_lateral.driver.liveliness import Liveliness
from xosc_lateral.driver.noise import NOISE_VARIANCE, ShapedNoise
from xosc_lateral.driver.series import STEP
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]

MEMORY_OF_START = 300
"""Steps after which a drive has forgotten the offset that it was made to start at: 60 s. [-]"""


@dataclass(frozen=True, eq=False)
class BestModel:
    """Parameters of the model.

    Parameters
    ----------
    mean : float
        Mean offset of all drivers. [lane widths]
    between_drivers : float
        Standard deviation of the drivers' means. [lane widths]
    coarse : Autoregression
        Of the coarse movement about the driver's mean, one step a second. [lane widths]
    fine : ShapedNoise
        Damping of the fine noise. [lane widths]
    coarse_liveliness, fine_liveliness : Liveliness
    correlation : float
        Between the logarithms of the two factors. [-]
    limits : tuple of float
        Coarse movement bends back before these: the range of the data, the markings at most. [lane widths]
    step : float
        [s]

    Raises
    ------
    DriverProfileError
        If a number is out of its range.
    """

    kind: ClassVar[str] = "best"

    mean: float
    between_drivers: float
    coarse: Autoregression
    fine: ShapedNoise
    coarse_liveliness: Liveliness
    fine_liveliness: Liveliness
    correlation: float
    limits: tuple[float, float]
    step: float = STEP

    def __post_init__(self) -> None:
        """Check."""
        low, high = self.limits
        if not -1.0 <= low < self.mean < high <= 1.0:
            raise DriverProfileError(f"mean {self.mean} outside the limits {low} and {high}, or these beyond -1 and 1")
        if not (0.0 <= self.between_drivers < 1.0 and -1.0 <= self.correlation <= 1.0):
            raise DriverProfileError(f"between drivers {self.between_drivers}, correlation {self.correlation}")

    @cached_property
    def kernel(self) -> FloatArray:
        """Kernel of the fine noise."""
        return self.fine.kernel

    @cached_property
    def coarse_covariance(self) -> FloatArray:
        """Of the coarse movement about the driver's mean at lags of 0.2 s, mean over the phases; (MEMORY_OF_START,)."""
        n_ticks = MEMORY_OF_START // COARSE_EVERY + 20
        ticks = self.coarse.covariance(n_ticks)
        spread = np.zeros(2 * n_ticks * COARSE_EVERY - 1)
        middle = n_ticks * COARSE_EVERY - 1
        spread[middle::COARSE_EVERY][:n_ticks] = ticks
        spread[middle::-COARSE_EVERY][:n_ticks] = ticks
        kernel = building_low_pass()
        both = np.convolve(kernel, kernel) / COARSE_EVERY
        return np.asarray(np.convolve(spread, both, "same")[middle : middle + MEMORY_OF_START])

    @cached_property
    def fine_covariance(self) -> FloatArray:
        """Of the fine movement at lags of 0.2 s, shape (MEMORY_OF_START,)."""
        kernel = self.kernel
        full = np.convolve(kernel, kernel)[len(kernel) - 1 :] * NOISE_VARIANCE
        result = np.zeros(MEMORY_OF_START)
        result[: len(full)] = full[:MEMORY_OF_START]
        return result

    @cached_property
    def start_factor(self) -> FloatArray:
        """Lower triangle that turns white noise into a stationary past of the coarse movement, (order, order)."""
        order = self.coarse.order
        covariance = self.coarse.covariance(order)
        matrix = covariance[np.abs(np.subtract.outer(np.arange(order), np.arange(order)))]
        return np.asarray(np.linalg.cholesky(matrix + 1e-9 * covariance[0] * np.eye(order)))

    def stream(self, seed: np.random.SeedSequence, start: Start | None = None) -> BestStream:
        """Begin a drive with a driver of its own."""
        return BestStream(self, seed, start)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "kind": self.kind,
            "step": self.step,
            "mean": self.mean,
            "between_drivers": self.between_drivers,
            "limits": list(self.limits),
            "coarse": {"coefficients": self.coarse.coefficients.tolist(), "scale": self.coarse.scale},
            "fine": {"damping": self.fine.damping.tolist(), "n_taps": self.fine.n_taps, "taper": self.fine.taper},
            "coarse_liveliness": asdict(self.coarse_liveliness),
            "fine_liveliness": asdict(self.fine_liveliness),
            "correlation": self.correlation,
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Back from `to_dict`."""
        low, high = values["limits"]
        return cls(
            mean=float(values["mean"]),
            between_drivers=float(values["between_drivers"]),
            coarse=Autoregression(np.array(values["coarse"]["coefficients"]), float(values["coarse"]["scale"])),
            fine=ShapedNoise(
                np.array(values["fine"]["damping"]),
                int(values["fine"]["n_taps"]),
                float(values["fine"].get("taper", 0.0)),
            ),
            coarse_liveliness=Liveliness(**values["coarse_liveliness"]),
            fine_liveliness=Liveliness(**values["fine_liveliness"]),
            correlation=float(values["correlation"]),
            limits=(float(low), float(high)),
            step=float(values["step"]),
        )
