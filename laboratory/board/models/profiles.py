"""The package's own models on the board: the paper's two levels, the same refined by the loop, and ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.drives.drive import Drive, Run
from xosc_lateral.drivers.evaluation.snippets import sample_recorded, sensor_noise
from xosc_lateral.drivers.fitting.fitting import driver_runs, fit_population, fit_runs
from xosc_lateral.drivers.model.core.base import ModelKind
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import sample_offsets
from xosc_lateral.drivers.model.seeds import child

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ProfileModel:
    """A driver profile in the board's protocol."""

    profile: DriverProfile

    def sample(
        self, segments: Sequence[Segment], starts: FloatArray | None, rng: np.random.Generator
    ) -> list[FloatArray]:
        """See `LateralModel.sample`.

        What was recorded is driver and sensor, so a profile that knows its sensor is sampled with it.
        """
        seed = int(rng.integers(2**32))
        if starts is not None:
            return sample_recorded(self.profile, segments, starts, seed)
        root = np.random.SeedSequence(seed)
        paths = [sample_offsets(self.profile, segment, child(root, number)) for number, segment in enumerate(segments)]
        noise = sensor_noise(self.profile, paths, seed)
        return [path + error for path, error in zip(paths, noise, strict=True)]

    @property
    def settings(self) -> Mapping[str, float]:
        """Counts of what the profile contains [-]; its file has the numbers."""
        return {"effects": float(len(self.profile.effects))}


class TwoLevel(ProfileModel):
    """The paper's Markov chain with filtered noise on top."""

    title: ClassVar[str] = "two levels (Neis and Beyerer)"
    source: ClassVar[str] = (
        "N. Neis, J. Beyerer, A Two-Level Stochastic Model for the Lateral Movement of Vehicles Within Their Lane, "
        "IEEE ITSC 2023, pp. 1896-1903, arXiv:2405.17080"
    )
    departures: ClassVar[str] = "docs/model.md says how each gap in the paper's description is filled"

    @classmethod
    def fit(cls, runs: Sequence[Run]) -> Self:
        """See `xosc_lateral.drivers.fitting.fitting.fit_runs`."""
        return cls(fit_runs(runs, name="two-level", model=ModelKind.TWO_LEVEL))


class TwoLevelRefined(ProfileModel):
    """The paper's model, repaired by the loop: what it lacks on the training drives is found and added."""

    title: ClassVar[str] = "two levels, refined by the loop"
    source: ClassVar[str] = "this project: `close-loop --profile two-level.json`, docs/closing_the_loop.md"
    departures: ClassVar[str] = ""

    @classmethod
    def fit(cls, runs: Sequence[Run]) -> Self:
        """Fit the paper's model and close the loop on the same runs."""
        from xosc_lateral.extras.loop.close import close_loop

        base = fit_runs(runs, name="two-level", model=ModelKind.TWO_LEVEL)
        return cls(close_loop(drives_of(runs), base, seed=0, name="two-level-refined").refined)


class Autoregressive(ProfileModel):
    """Ours."""

    title: ClassVar[str] = "autoregression with drivers (ours)"
    source: ClassVar[str] = "this project: `fit`, docs/model.md"
    departures: ClassVar[str] = ""

    @classmethod
    def fit(cls, runs: Sequence[Run]) -> Self:
        """What `fit` does: the sensor's part is taken out, then what is known to act on drivers, then the drivers."""
        cleaned, sensor = driver_runs(runs)
        return cls(fit_population(cleaned, name="autoregressive", model=ModelKind.AUTOREGRESSIVE, sensor=sensor))


def drives_of(runs: Sequence[Run]) -> list[Drive]:
    """Runs back as drives that are cut already."""
    drives = []
    for name in sorted({run.drive for run in runs}):
        own = sorted((run for run in runs if run.drive == name), key=lambda run: float(run.time[0]))
        context = {key: np.concatenate([run.context[key] for run in own]) for key in own[0].context}
        drives.append(
            Drive(
                name=name,
                time=np.concatenate([run.time for run in own]),
                offset=np.concatenate([run.offset for run in own]),
                lane_width=np.concatenate([run.lane_width for run in own]),
                context=context,
                levels=own[0].levels,
                run=np.concatenate([np.full(len(run), number, dtype=np.int64) for number, run in enumerate(own)]),
                empty=own[0].empty,
            )
        )
    return drives
