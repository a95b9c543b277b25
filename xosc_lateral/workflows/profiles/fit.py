"""`fit`: measured drives into a profile; `read_drives`: the drives themselves; `evaluate`: how true one is to them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from msgspec.structs import replace

from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.profile import DriverProfile, Maneuvers, Provenance
from xosc_lateral.workflows.options import PROFILE, declare_options, flag
from xosc_lateral.workflows.result import DrivesLike, PathLike, Paths, ProfileLike, given_drives, given_profile, naming

if TYPE_CHECKING:
    from xosc_lateral.drivers.drives.drive import Drive, Run
    from xosc_lateral.files.mapping import MappingLike
    from xosc_lateral.workflows.profiles.evaluation_page import Evaluation


PRIOR_PROFILE = "rural"
"""Profile of the library whose fast movement stands in where a recording shows none: fitted to differential GNSS."""

LEAST_NOISE, MOST_NOISE = 1e-4, 2.0
"""Of a sensor's error, its standard deviation: a tenth of what the finest recordings resolve, half a lane. [m]"""


def read_drives(drives: DrivesLike, columns: MappingLike | None = None) -> list[Drive]:
    """Read and clean drive tables.

    Raises `FormatError`: A column is missing, or its values can't be in the unit meant; `NotEnoughDataError`: A table
    without two rows of time, offset and lane width.

    Parameters
    ----------
    drives : path, DataFrame, Drive, or sequence of them
        `time` [s]; `distance_left` and `distance_right` [m], or `offset` and `lane_width` [m]; `speed` [m/s] if known;
        `drive` when there are several; every other numeric column is context.
    columns : mapping of str to str, TableMapping, or path, optional
        Standard name -> foreign header, with a unit if need be: ``{"speed": "v_kmh:km/h"}``.
    """
    return given_drives(drives, columns).drives


def _known_model(text: str) -> str:
    from xosc_lateral.drivers.model.core.registry import model_named

    try:
        return model_named(text).model.kind
    except DriverProfileError as error:
        raise ValueError(str(error)) from error


@declare_options
def fit(
    drives: DrivesLike, *,
    model: Annotated[str, flag(read=_known_model, metavar="[two-level|autoregressive|PLUG-IN]",
        help="two-level: Neis and Beyerer; autoregressive: the default; best: the same.")] = "autoregressive",
    corrected: Annotated[bool, flag("--corrected",
        help="Two-level model: freed of its fit's bias, by simulation.")] = False,
    columns: MappingLike | None = None,
    name: Annotated[str, flag(help="Name of the profile; default: the file's name.")] = "",
    source: Annotated[str, flag(help="Description of the drives, for the provenance.")] = "",
    licence: Annotated[str, flag(help="Licence of the drives, for the provenance.")] = "",
    sensor_noise: Annotated[float | None, flag(min=LEAST_NOISE, max=MOST_NOISE,
        help="Standard deviation of the sensor's error, rounding included [m]; default: estimated.")] = None,
    left_hand: Annotated[bool, flag("--left-hand", help="Drives of left-hand traffic.")] = False,
    neighbours: Annotated[bool | None, flag("--neighbours/--no-neighbours",
        help="Whether to fit how drivers keep away from vehicles beside them; default: where they are known.")] = None,
    valid_below: Annotated[float | None, flag(metavar="HZ", min=0.02, max=2.5,
        help="Frequency up to which tables show driving that do not state it: smoothed tracks. [Hz]")] = None,
    prior: Annotated[ProfileLike | None, flag(
        kind=str, read=lambda text: None if text == "none" else text, metavar="PROFILE|none",
        help="Whose fast movement it has above the band that the tables show; rural: only where they state one.",
    )] = PRIOR_PROFILE,
    maneuvers: Annotated[Maneuvers | PathLike | None, flag(kind=Path, read=Path, metavar="RECORDING",
        help="Recording whose lane changes the profile holds too, as a law: what `reconstruct` reads.")] = None,
    road: Annotated[PathLike | None, flag(kind=Path, read=Path, metavar="FILE",
        help="Road of a recording that holds none, of drives or --maneuvers: OpenDRIVE, SUMO's network.")] = None,
    library: Paths = (),
) -> DriverProfile:  # fmt: skip
    """Fit a driver profile.

    Raises `FormatError`, `NotEnoughDataError`, `DriverProfileError`.

    Parameters
    ----------
    drives, columns
        See `read_drives`.
    neighbours : bool, optional
        Whether the profile holds how drivers keep away from vehicles beside them; not in the two-level model. None:
        where it can be fitted; True: or an error says why not; False: in no case.
    prior : DriverProfile, path or name, optional
        Whose fast movement the profile has above the band that the drives show: `rural` where tables state a band
        below 0.5 Hz and no other table has one above it, another one also where the sensor hides the driver.
    """
    from xosc_lateral.drivers.drives.cleaning import summary_of
    from xosc_lateral.drivers.fitting.fitting import fit_profile
    from xosc_lateral.drivers.fitting.models.two_level import correct_two_level
    from xosc_lateral.drivers.model.core.base import ModelKind
    from xosc_lateral.drivers.model.core.registry import model_named
    from xosc_lateral.drivers.model.core.two_level.model import TwoLevelModel
    from xosc_lateral.files.source import parsed_hashes

    if sensor_noise is not None and not LEAST_NOISE <= sensor_noise <= MOST_NOISE:
        expected = f"expected {LEAST_NOISE:g} to {MOST_NOISE:g} m, or nothing, where it is to be estimated"
        raise ValueError(f"sensor_noise of {sensor_noise:g} m: {expected}")
    if corrected and model_named(model).model.kind != ModelKind.TWO_LEVEL:
        raise DriverProfileError(f"model {model}: only the two-level model has a corrected fit")
    tables = given_drives(drives, columns, None if maneuvers is not None else road).valid_below(valid_below)
    by_default = isinstance(prior, str) and prior == PRIOR_PROFILE
    lines = tables.evidence()
    with naming(tables):
        known = Provenance(
            source=source or ", ".join(tables.inputs),
            licence=licence,
            inputs=dict(tables.inputs),
            fit=summary_of(tables.drives, tables.left_out) | ({"evidence": lines} if lines else {}),
        )
        profile = fit_profile(
            tables.drives,
            name=name or (tables.files[0].name.split(".")[0] if tables.files else "profile"),
            model=model,
            provenance=known,
            sensor_noise=sensor_noise,
            neighbours=neighbours,
            prior=None if prior is None or by_default else given_profile(prior, library),
            stand_in=(lambda: given_profile(PRIOR_PROFILE, library)) if by_default else None,
        )
    if corrected and isinstance(profile.model, TwoLevelModel):
        provenance = replace(profile.provenance, fit={**profile.provenance.fit, "corrected": True})
        profile = replace(profile, model=correct_two_level(profile.model), provenance=provenance)
    if maneuvers is not None:
        profile = replace(profile, maneuvers=_law_of(maneuvers, road))
    if isinstance(maneuvers, str | Path):
        inputs = {**profile.provenance.inputs, **parsed_hashes([Path(maneuvers)])}
        profile = replace(profile, provenance=replace(profile.provenance, inputs=inputs))
    return replace(profile, left_hand=left_hand)


def _law_of(maneuvers: Maneuvers | PathLike, road: PathLike | None) -> Maneuvers:
    """Of a recording, which an extra reads."""
    from xosc_lateral.base.plugins import service

    if isinstance(maneuvers, Maneuvers):
        return maneuvers
    law: Maneuvers = service("read_maneuvers")(maneuvers, road)
    return law


def fit_warnings(profile: DriverProfile, sensor_noise: float | None = None) -> list[str]:
    """What to know about a fitted profile, and the error of its sensor as far as it was given [m], in lines."""
    from xosc_lateral.drivers.fitting import fitting

    return fitting.fit_warnings(profile, sensor_noise, given_profile(PRIOR_PROFILE))


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
    from xosc_lateral.drivers.fitting.fitting import driver_runs
    from xosc_lateral.drivers.model.core.base import ModelKind

    if driver.model.kind == ModelKind.TWO_LEVEL:
        return driver
    _, sensor = driver_runs(runs, drives)
    return driver if sensor is None else replace(driver, sensor=sensor)
