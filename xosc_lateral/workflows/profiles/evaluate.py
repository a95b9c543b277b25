"""`evaluate`: how true a profile is to measured drives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

from xosc_lateral.workflows.options import PROFILE, declare_options, flag
from xosc_lateral.workflows.result import (
    DrivesLike,
    Paths,
    ProfileLike,
    given_drives,
    given_profile,
    naming,
)

if TYPE_CHECKING:
    from xosc_lateral.drivers.drives.drive import Drive, Run
    from xosc_lateral.drivers.model.profile import DriverProfile
    from xosc_lateral.files.mapping import MappingLike
    from xosc_lateral.workflows.profiles.evaluation_page import Evaluation


@declare_options
def evaluate(
    profile: Annotated[ProfileLike, PROFILE],
    drives: DrivesLike,
    *,
    seed: int = 0,
    classify: Annotated[
        bool, flag("--classify/--no-classify", help="Also train classifiers (extra `classifier`).")
    ] = True,
    columns: MappingLike | None = None,
    library: Paths = (),
) -> Evaluation:
    """Score a profile beside other real drivers, and by the paper's four evaluations.

    Raises `NotEnoughDataError`: Too little is left after cutting to compare.

    Parameters
    ----------
    profile : DriverProfile, path or name
    drives, columns
        See `read_drives`.
    classify : bool
        Train classifiers to separate sampled and measured (extra `classifier`; a minute or two for some hours).
    """
    from xosc_lateral.drivers.drives.drive import all_runs
    from xosc_lateral.drivers.evaluation.scores import score_profile
    from xosc_lateral.workflows.profiles.evaluation_page import Evaluation

    driver = given_profile(profile, library)
    tables = given_drives(drives, columns)
    with naming(tables):
        runs = all_runs(tables.drives)
        scores = score_profile(_seen_with(driver, runs, tables.drives), runs, seed=seed, classify=classify)
    return Evaluation(scores, driver, tables)


def _seen_with(driver: DriverProfile, runs: Sequence[Run], drives: Sequence[Drive]) -> DriverProfile:
    """The profile with the sensor of a recording, as far as it is known; the paper's model knows recordings alone."""
    from msgspec.structs import replace

    from xosc_lateral.drivers.fitting.fitting import driver_runs
    from xosc_lateral.drivers.model.core.base import ModelKind

    if driver.model.kind == ModelKind.TWO_LEVEL:
        return driver
    _, sensor = driver_runs(runs, drives)
    return driver if sensor is None else replace(driver, sensor=sensor)
