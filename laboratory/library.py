"""The shipped profile library, built from the public recording.

    python -m laboratory.build_library tasi-0.15.4-py3-none-any.whl --gnss ASta_040719_platoon3.csv.gz \
        --gnss ASta_050719_platoon1.csv.gz -o FOLDER

Levels, spreads, effects and slow movement of the motorway profiles come from the motorway recording, which its provider
smoothed; fast movement and its growth with speed from cars with differential GNSS, of which `rural` is made alone.

The same files give the same bytes on the same kind of processor. Every profile is scored before it is written: for
the population a fit to half of the vehicles is scored on the other half; for the single vehicle a fit to the first part
of the drive is held against the last part of its own drive and those of others; for `rural` a fit to the first file on
the other ones. What is written is fitted to all.
"""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from laboratory.comparison import driver_distances
from xosc_lateral.base.arrays import significant
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.drives.drive import PASS_BAND_EDGES, STEP, Drive, Run, all_runs
from xosc_lateral.drivers.evaluation.lane_keeping import figures_of
from xosc_lateral.drivers.evaluation.metrics import snippet_metrics
from xosc_lateral.drivers.evaluation.scores import SNIPPET, score_profile, scores_to_dict
from xosc_lateral.drivers.evaluation.snippets import sample_runs, snippets_of
from xosc_lateral.drivers.evaluation.spectra import spectrum
from xosc_lateral.drivers.fitting.bands import FastPart, fast_part_of_runs
from xosc_lateral.drivers.fitting.closing import looked_at
from xosc_lateral.drivers.fitting.fitting import driver_runs, fit_population, fit_profile, fit_runs
from xosc_lateral.drivers.fitting.joined_bands import measured, with_fast_movement
from xosc_lateral.drivers.model.profile import POPULATION as ANSWERS
from xosc_lateral.drivers.model.profile import DriverProfile, Metadata, Provenance
from xosc_lateral.drivers.model.sensor import SensorModel
from xosc_lateral.extras.detect.observation import RECORDED_SPECTRUM
from xosc_lateral.extras.recordings.importers.dlr_ht import HIGHEST_FREQUENCY, import_dlr_ht
from xosc_lateral.extras.recordings.importers.openacc import import_openacc
from xosc_lateral.extras.recordings.reconstruct import read_maneuvers
from xosc_lateral.files.drives import drives_of_table, read_drives
from xosc_lateral.files.source import parsed_hash

FloatArray = NDArray[np.float64]

SOURCE = "DLR Highway Traffic v1.1.0 (A39 near Braunschweig, 7 October 2024, 5 min, 6.4 km), DLR"
SEED = 20241007  # the day of the recording
SINGLE = "motorway-vehicle-1"
LONG_DRIVE = 140.0  # [s]; of road-following, for the profile of one vehicle
SPREAD_FACTOR = 1.35  # a single vehicle's profile whose spread is off by more than this is not shipped
FITTED_SHARE = 0.6  # of a single vehicle's drive; the rest is held out


RURAL = "rural"
RURAL_SOURCE = "OpenACC, AstaZero campaign (rural road, 4 and 5 July 2019), Joint Research Centre"
RURAL_NOTES = "Cars driven by hand on a rural road at 50 to 90 km/h, measured by differential GNSS: the population."
GNSS = "OpenACC AstaZero, differential GNSS, 4 drives"
MOTORWAY = "DLR Highway Traffic"
NO_DATA = "No data are shipped: a profile holds fitted numbers, no track of any vehicle."
RURAL_LICENCE = (
    "Measured by the Joint Research Centre of the European Commission, (c) European Union, CC BY 4.0: any use, "
    f"commercial too, with this credit; changed: lane centre estimated, model fitted. {NO_DATA}"
)
MOTORWAY_LICENCE = (
    "Slow movement, levels and effects: measured by the German Aerospace Center (DLR Highway Traffic, "
    "doi:10.5281/zenodo.14012005), a data set said by others to be under CC BY-NC-SA 4.0, whose first file lies in the "
    "wheel of tasi under Apache-2.0. Fast movement: measured by the Joint Research Centre of the European Commission, "
    f"(c) European Union, CC BY 4.0. {NO_DATA} The profile itself comes under the licence of this package; where data "
    "for non-commercial use may not even be fitted to, use `rural`, which owes nothing to them."
)
SHORT_LICENCES = {
    "motorway": "Apache-2.0; data CC BY-NC-SA 4.0 (as others say), CC BY 4.0",
    RURAL: "Apache-2.0; data CC BY 4.0",
}
"""By road, for lists."""

POPULATION = "motorway"
POPULATION_NOTES = "All vehicles on a two-lane German motorway in the morning: the population."


def build_library(source: Path, gnss: Sequence[Path], *, model: str = "best") -> list[DriverProfile]:
    """All shipped profiles, from the wheel of `tasi` (or the data set's zip or CSV) and files of OpenACC's AstaZero.

    All vehicles were seen by the same cameras: driver and sensor are told apart once, every profile knows the sensor.

    Raises
    ------
    FormatError, NotEnoughDataError
        If the source is no such recording or too little is left of it.
    """
    imported = import_dlr_ht(source)
    kind = dict(zip(imported.table["drive"], imported.table["vehicle_class"], strict=True))
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "dlr-ht.parquet"
        dataclasses.replace(imported, sources=(source,)).write(table)
        drives = read_drives(table)
    runs = all_runs(drives)
    rural, fast = _rural(gnss, model)
    seen = Seen(runs, *driver_runs(runs, drives), fast)
    inputs = {path.name: parsed_hash(path) for path in (source, *gnss)}
    known = Provenance(source=f"{SOURCE}; {RURAL_SOURCE}", licence=MOTORWAY_LICENCE, inputs=inputs)
    population = replace(_population_profile(seen, known, model), maneuvers=read_maneuvers(source), beside=ANSWERS)
    fit = {**population.provenance.fit, RECORDED_SPECTRUM: recorded_spectrum(runs)}
    population = replace(population, provenance=replace(population.provenance, fit=fit))
    profiles = [population, _single_profile(seen, kind, known, model), rural]
    return [replace(profile, metadata=shipped_metadata(profile)) for profile in profiles]


def recorded_spectrum(runs: Sequence[Run]) -> dict[str, list[float]]:
    """Of lane keeping as recorded: what `detect --band-of PROFILE` sees homes like."""
    found = spectrum([run.offset for run in runs], STEP)
    densities = [significant(float(density), 4) for density in found.density]
    return {"frequency_hz": [round(float(hertz), 5) for hertz in found.frequency], "m2_per_hz": densities}


def _rural(gnss: Sequence[Path], model: str) -> tuple[DriverProfile, FastPart]:
    """The profile of the cars with differential GNSS, scored on the files that a fit to the first has not seen."""
    inputs = {path.name: parsed_hash(path) for path in gnss}
    known = Provenance(source=RURAL_SOURCE, licence=RURAL_LICENCE, inputs=inputs, notes=RURAL_NOTES)
    first, others = _gnss_drives(gnss[:1]), _gnss_drives(gnss[1:])
    half = fit_profile(first, name=RURAL, model=model)
    evaluation = {
        "held_out": f"{gnss[0].name.split('.')[0]} fitted, the others not",
        "power_ratio": _power_ratios(half, all_runs(others)),
    }
    drives = _gnss_drives(gnss)
    profile = fit_profile(drives, name=RURAL, model=model, provenance=replace(known, evaluation=evaluation))
    bands = tuple(replace(band, source=GNSS) for band in profile.validity.bands)
    profile = replace(profile, validity=replace(profile.validity, bands=bands, roads=("rural road",)))
    runs = driver_runs(all_runs(drives), drives)[0]
    return profile, fast_part_of_runs(runs, profile.validity.highest_frequency or PASS_BAND_EDGES, GNSS)


BANDS = (0.04, 0.08, 0.12, 0.2, 0.32, 0.5, 1.0)
"""In which power is compared. [Hz]"""


def _power_ratios(profile: DriverProfile, runs: Sequence[Run]) -> dict[str, float]:
    """Power of free runs over that of real ones, band by band. [-]"""
    real, made = (
        spectrum(paths, STEP)
        for paths in ([run.offset for run in runs], sample_runs(profile, runs, SEED, same_start=False))
    )
    ratios = {}
    for low, high in pairwise(BANDS):
        band = (real.frequency >= low) & (real.frequency < high)
        ratios[f"{low:g}-{high:g} Hz"] = round(float(made.density[band].sum() / real.density[band].sum()), 2)
    return ratios


def _gnss_drives(files: Sequence[Path]) -> list[Drive]:
    table = import_openacc(files).table
    return drives_of_table(table, None, Path(files[0].name))


@dataclass(frozen=True, eq=False)
class Seen:
    """Runs as recorded, the driver's part of each, and what the cameras added to all.

    Parameters
    ----------
    recorded, driven : list of Run
    sensor : SensorModel or None
    fast : FastPart
        What the recording does not show.
    """

    recorded: list[Run]
    driven: list[Run]
    sensor: SensorModel | None
    fast: FastPart

    def completed(self, profile: DriverProfile, runs: Sequence[Run]) -> DriverProfile:
        """A profile of some runs with fast movement, and what it is valid for."""
        known = replace(measured(runs), roads=("motorway",))
        return with_fast_movement(profile, known, HIGHEST_FREQUENCY, self.fast, MOTORWAY)

    def of(self, holds: Callable[[Run], bool]) -> Seen:
        """Some of the runs."""
        chosen = [k for k, run in enumerate(self.recorded) if holds(run)]
        recorded, driven = ([runs[k] for k in chosen] for runs in (self.recorded, self.driven))
        return Seen(recorded, driven, self.sensor, self.fast)


def shipped_metadata(profile: DriverProfile) -> Metadata:
    """What all shipped profiles have in common, and whose they are."""
    single = "-vehicle-" in profile.name
    words = f"{profile.name} {profile.provenance.notes}".lower() if single else profile.name
    vehicle = next((kind for kind in ("truck", "car", "van") if kind in words), "")
    tags = ("single-vehicle" if single else "population", *([vehicle] if vehicle else []))
    road, country, date = ("motorway", "DE", "2024-10-07")
    if profile.name == RURAL:
        road, country, date, vehicle = "rural", "SE", "2019-07-04/2019-07-05", "car"
    return Metadata(
        version="2", vehicle=vehicle, road=road, country=country, date=date, licence=SHORT_LICENCES[road], tags=tags
    )


def _population_profile(seen: Seen, known: Provenance, model: str) -> DriverProfile:
    """Score on held-out vehicles, then fit to all."""
    chosen = _fitted_half(seen.recorded)
    fitted = seen.of(lambda run: run.drive in chosen)
    half = fit_population(fitted.driven, name=POPULATION, model=model, sensor=seen.sensor)
    evaluation = _evaluation(seen.completed(half, fitted.driven), seen.of(lambda run: run.drive not in chosen).recorded)
    provenance = replace(known, notes=POPULATION_NOTES, evaluation=evaluation)
    whole = fit_population(seen.driven, name=POPULATION, model=model, provenance=provenance, sensor=seen.sensor)
    return looked_at(seen.completed(whole, seen.driven), seen.driven)


def _fitted_half(runs: Sequence[Run]) -> set[str]:
    """Names of half of the vehicles, at random."""
    vehicles = np.unique([run.drive for run in runs])
    return set(np.random.default_rng(SEED).permutation(vehicles)[: len(vehicles) // 2].tolist())


def _evaluation(half: DriverProfile, others: Sequence[Run]) -> dict[str, Any]:
    """Scores of a profile of half of the vehicles on the others."""
    scores = scores_to_dict(score_profile(half, others, seed=SEED, classify=False))
    return {
        "held_out": "half of the vehicles, not fitted",
        "seed": SEED,
        "snippets": scores["snippets"],
        "long_snippets": scores["long_snippets"],
        "spectrum_error_db": scores["spectrum"]["error_db"],
        "margins": scores["margins"],
    }


# ---- single vehicles -------------------------------------------------------------------------------------------------
def _single_profile(seen: Seen, kind: Mapping[str, str], known: Provenance, model: str) -> DriverProfile:
    """The most ordinary of the vehicles with long drives that stay themselves, beside the others of these."""
    long = _long_drives(seen)
    whole = {name: fit_runs(mine, name=name, model=model) for name, mine in long.items()}
    long = {name: mine for name, mine in long.items() if _describes(whole[name], mine)}
    steady = by_ordinariness({name: snippets_of(mine, SNIPPET, STEP).offset for name, mine in long.items()})
    name, parts = steady[0], {name: split_in_time(long[name]) for name in steady}
    late = [sliding_snippets(parts[one][1]) for one in steady]
    evaluation = _own_distance(driver_distances([fit_runs(parts[name][0], name=name, model=model)], late, SEED)[0], 0)
    notes = (
        f"One {kind[name]}, {_place_and_spread(long[name])}: the most ordinary of {len(steady)} long, steady drives."
    )
    fit = {"vehicle": name, "vehicle_class": kind[name]}
    provenance = replace(known, notes=notes, evaluation=evaluation, fit=fit)
    fitted = fit_runs(long[name], name=SINGLE, model=model, provenance=provenance)
    return looked_at(seen.completed(replace(fitted, sensor=seen.sensor), long[name]), long[name])


def _long_drives(seen: Seen) -> dict[str, list[Run]]:
    """Runs of each vehicle that was seen for long."""
    by_vehicle: dict[str, list[Run]] = {}
    for run in seen.driven:
        by_vehicle.setdefault(run.drive, []).append(run)
    long = {name: mine for name, mine in by_vehicle.items() if sum(map(len, mine)) * STEP >= LONG_DRIVE}
    return long


def _own_distance(distance: NDArray[np.float64], k: int) -> dict[str, Any]:
    """How near a profile, fitted to the early part, is to its own late part, and to the others'."""
    others = np.delete(distance, k)
    nearer = int((distance[k] < others).sum())
    return {
        "held_out": f"last {100 * (1 - FITTED_SHARE):.0f} % of the drive, not fitted",
        "own_distance": round(float(distance[k]), 4),
        "distances_to_others": [round(float(value), 4) for value in others],
        "told_apart": f"nearer to its own held-out part than to those of {nearer} of {len(others)} others",
    }


def _describes(profile: DriverProfile, runs: Sequence[Run]) -> bool:
    """Whether free runs of the profile spread about as widely as the drive did: two minutes don't always suffice."""
    measured = float(np.concatenate([run.offset for run in runs]).std())
    return 1.0 / SPREAD_FACTOR <= figures_of(profile)[0].spread / measured <= SPREAD_FACTOR


def by_ordinariness(snippets: Mapping[str, FloatArray]) -> list[str]:
    """Names of drivers that stay themselves, the most ordinary first: nearest to the mean of all of these.

    Drivers are compared by the mean of their ten metrics, in units of what one driver's mean changes by from the first
    half of the drive to the second. The half of the drivers that changes most is left out: a profile of somebody who
    drives differently every minute is a profile of nobody.

    Parameters
    ----------
    snippets : mapping of str to array, shape (n, m)
        Driver -> snippets in the order of time, at least two. [m]

    Raises
    ------
    NotEnoughDataError
        If there are fewer than four drivers.
    """
    names = sorted(snippets)
    if len(names) < 4:
        raise NotEnoughDataError(f"{len(names)} vehicles with {LONG_DRIVE:g} s of road-following; 4 are needed")
    metrics = [snippet_metrics(snippets[name]) for name in names]
    change = np.array([one[: len(one) // 2].mean(axis=0) - one[len(one) // 2 :].mean(axis=0) for one in metrics])
    unit = np.sqrt((change**2).mean(axis=0))
    steady = np.argsort(((change / unit) ** 2).sum(axis=1), kind="stable")[: len(names) // 2]
    points = np.array([metrics[k].mean(axis=0) for k in steady]) / unit
    order = np.argsort(((points - points.mean(axis=0)) ** 2).sum(axis=1), kind="stable")
    return [names[steady[k]] for k in order]


def split_in_time(runs: Sequence[Run]) -> tuple[list[Run], list[Run]]:
    """Runs before and after the moment by which `FITTED_SHARE` of the driving is done."""
    left = round(FITTED_SHARE * sum(map(len, runs)))
    before, after = [], []
    for run in runs:
        cut = min(max(left, 0), len(run))
        left -= len(run)
        before += [run.part(slice(0, cut))] if cut > 1 else []
        after += [run.part(slice(cut, len(run)))] if len(run) - cut > 1 else []
    return before, after


def sliding_snippets(runs: Sequence[Run]) -> FloatArray:
    """Snippets of 10 s every second: a short drive has few that don't overlap."""
    length = round(SNIPPET / STEP) + 1
    windows = [
        np.lib.stride_tricks.sliding_window_view(run.offset, length)[:: round(1 / STEP)]
        for run in runs
        if len(run) >= length
    ]
    if not windows:
        raise NotEnoughDataError(f"no {SNIPPET:g} s without a cut in the last part of {runs[0].drive if runs else '?'}")
    return np.concatenate(windows)


def _place_and_spread(runs: Sequence[Run]) -> str:
    """What strikes the eye, in words."""
    offset = np.concatenate([run.offset for run in runs])
    mean, spread = float(offset.mean()), float(np.mean([run.offset.std() for run in runs]))
    side = "left" if mean > 0 else "right"
    place = "to the lane centre" if abs(mean) < 0.08 else f"{abs(mean):.2f} m to the {side} of the lane centre"
    calm = "steady" if spread < 0.13 else "restless" if spread > 0.22 else "ordinary"
    return f"keeps {place}, {calm} (std {spread:.2f} m in the recording)"
