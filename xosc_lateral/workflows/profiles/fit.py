"""`fit`: measured drives into a driver profile; `read_drives`: the drives themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from xosc_lateral.workflows.result import DrivesLike, given_drives, naming

if TYPE_CHECKING:
    from xosc_lateral.drivers.drives.drive import Drive
    from xosc_lateral.drivers.model.profile import DriverProfile
    from xosc_lateral.files.mapping import MappingLike


def read_drives(drives: DrivesLike, columns: MappingLike | None = None) -> list[Drive]:
    """Read and clean drive tables.

    Parameters
    ----------
    drives : path, DataFrame, Drive, or sequence of them
        `time` [s]; `distance_left` and `distance_right` [m], or `offset` and `lane_width` [m]; `speed` [m/s] if known;
        `drive` when there are several; every other numeric column is context.
    columns : mapping of str to str, TableMapping, or path, optional
        Standard name -> foreign header, with a unit if need be: ``{"speed": "v_kmh:km/h"}``.

    Raises
    ------
    FormatError
        A column is missing, or its values can't be in the unit meant.
    NotEnoughDataError
        A table without two rows of time, offset and lane width.
    """
    return given_drives(drives, columns).drives


def fit(
    drives: DrivesLike,
    *,
    name: str,
    model: str = "autoregressive",
    columns: MappingLike | None = None,
    source: str = "",
    licence: str = "",
    sensor_noise: float | None = None,
    left_hand: bool = False,
    neighbours: bool | None = None,
) -> DriverProfile:
    """Fit a driver profile.

    Parameters
    ----------
    drives, columns
        See `read_drives`.
    name : str
        Of the profile.
    model : str
        "two-level": the paper's model to the letter; "autoregressive" (or "best"): ours.
    source, licence : str
        Of the drives, for the provenance.
    sensor_noise : float, optional
        Standard deviation of the sensor's error on the offset, rounding included, where it is known; else found from
        the drives. [m]
    left_hand : bool
        The drives are of left-hand traffic: roads with right-hand traffic get their mirror image.
    neighbours : bool, optional
        Whether the profile holds how drivers keep away from vehicles beside them, from `left_distance` and
        `right_distance`: of 30 drives that had somebody there, or of fewer that are taken as one driver's and say it
        surely enough; not in the two-level model. None: where it can
        be fitted; True: or an error says why not; False: in no case.

    Raises
    ------
    FormatError, NotEnoughDataError, DriverProfileError
    """
    from msgspec.structs import replace

    from xosc_lateral.drivers.drives.frozen import summary_of
    from xosc_lateral.drivers.fitting.fitting import fit_profile
    from xosc_lateral.drivers.model.profile import Provenance

    given = given_drives(drives, columns)
    known = Provenance(
        source=source or ", ".join(given.inputs),
        licence=licence,
        inputs=dict(given.inputs),
        fit=dict(summary_of(given.drives)),
    )
    with naming(given):
        profile = fit_profile(
            given.drives,
            name=name,
            model=model,
            provenance=known,
            sensor_noise=sensor_noise,
            neighbours=neighbours,
        )
    return replace(profile, left_hand=left_hand)
