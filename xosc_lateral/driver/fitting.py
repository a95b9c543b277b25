"""Measured drives into a profile."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral import __version__
from xosc_lateral.driver.best_fit import fit_best
from xosc_lateral.driver.core import CoreModel
from xosc_lateral.driver.kinds import ModelKind
from xosc_lateral.driver.profile import DriverProfile, Provenance
from xosc_lateral.driver.series import PAPER_RULES, CutRules, Drive, Run, all_runs
from xosc_lateral.driver.two_level import fit_two_level

FloatArray = NDArray[np.float64]


def fit_profile(
    drives: Sequence[Drive],
    *,
    name: str,
    model: ModelKind | str = ModelKind.BEST,
    rules: CutRules = PAPER_RULES,
    provenance: Provenance | None = None,
) -> DriverProfile:
    """Cut drives into runs and fit a profile without effects.

    Parameters
    ----------
    drives : sequence of Drive
    name : str
        Of the profile.
    model : ModelKind or str
    rules : CutRules
        What is cut out.
    provenance : Provenance, optional
        What is known about the drives; hours, counts and fit settings are filled in.

    Raises
    ------
    NotEnoughDataError
        When too little is left after cutting.
    """
    return fit_runs(all_runs(drives, rules), name=name, model=model, provenance=provenance)


def fit_runs(
    runs: Sequence[Run],
    *,
    name: str,
    model: ModelKind | str = ModelKind.BEST,
    provenance: Provenance | None = None,
) -> DriverProfile:
    """Fit a profile to runs that are cut already."""
    kind = ModelKind(model)
    core = fit_core([run.rel_offset for run in runs], [run.drive for run in runs], model=kind)
    known = provenance or Provenance()
    seconds = sum(len(run) for run in runs) * core.step
    return DriverProfile(
        name=name,
        model=core,
        lane_width=float(np.median(np.concatenate([run.lane_width for run in runs]))),
        provenance=replace(
            known,
            hours=round(seconds / 3600.0, 4),
            drives=len({run.drive for run in runs}),
            runs=len(runs),
            fit={**known.fit, **_fit_notes(kind, core)},
            package_version=__version__,
        ),
    )


def fit_core(
    rel_offsets: Sequence[FloatArray], drives: Sequence[str], *, model: ModelKind | str = ModelKind.BEST
) -> CoreModel:
    """Fit a core model to relative offsets, which may be what is left once effects were taken out.

    Parameters
    ----------
    rel_offsets : sequence of array
        One array per run, evenly at 5 Hz, finite. [-]
    drives : sequence of str
        For each run the drive that it comes from: runs of a drive are of one driver.
    model : ModelKind or str
    """
    if ModelKind(model) is ModelKind.TWO_LEVEL:
        return fit_two_level(rel_offsets)
    return fit_best(rel_offsets, drives)


def _fit_notes(kind: ModelKind, core: CoreModel) -> Mapping[str, Any]:
    return {"model": kind.value, "step_s": core.step}
