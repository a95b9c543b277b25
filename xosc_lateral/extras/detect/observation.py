"""What a detector sees: vehicles beside a lane, through a sensor that is as good as wanted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray, rate, true_slices
from xosc_lateral.base.errors import DriverProfileError, NotEnoughDataError
from xosc_lateral.drivers.drives.lane_changes import RATE_WINDOW
from xosc_lateral.drivers.evaluation.spectra import SEGMENTS, Spectrum, spectrum
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.seeds import of_name
from xosc_lateral.extras.detect.tracks import STEP, LaneTrack, Rows, Scene, Truth, truth_of

# ---- a recording's band: recordings are smoothed on their way into a file, sampled traffic is not ----
# ---- a recording's band: what is recorded was smoothed on its way into a file, what is sampled was not ----
ROWS = round(0.2 / STEP)
"""Rows to one of the spectrum's, whose windows are made for 5 Hz. [rows]"""
LEAST_FREQUENCY = 0.1
"""Slower movement is seen as it is: lane changes of up to 10 s are made of it, and drivers differ in it. [Hz]"""


@dataclass(frozen=True, eq=False)
class SensorBand:
    """Share of the amplitude that is seen at each frequency; shape (n,) each. [Hz], [-]"""

    frequency: FloatArray
    gain: FloatArray

    def at(self, frequency: FloatArray) -> FloatArray:
        """Gain at frequencies, linear over their logarithm, 1 up to `LEAST_FREQUENCY`."""
        floor = np.maximum(frequency, 1e-9)
        inside = np.interp(np.log(floor), np.log(np.r_[LEAST_FREQUENCY, self.frequency]), np.r_[1.0, self.gain])
        return np.where(frequency <= LEAST_FREQUENCY, 1.0, inside)

    def seen(self, position: FloatArray) -> FloatArray:
        """A lateral position every `STEP` as it is seen, without delay; shape (n,). [m]

        Beyond its ends it goes on as its mirror image about its last value, so that an end is no edge.
        """
        n = len(position)
        whole = np.concatenate([2.0 * position[0] - position[:0:-1], position, 2.0 * position[-1] - position[-2::-1]])
        trend = np.linspace(whole[0], whole[-1], len(whole))
        gain = self.at(np.asarray(np.fft.rfftfreq(len(whole), STEP), dtype=np.float64))
        return np.asarray((trend + np.fft.irfft(gain * np.fft.rfft(whole - trend), len(whole)))[n - 1 : 2 * n - 1])


def keeping_spectrum(tracks: Iterable[LaneTrack], source: str) -> Spectrum:
    """Of the offset in lane keeping; raises `NotEnoughDataError` where no stretch is long enough."""
    runs = []
    for track in tracks:
        whole = np.concatenate([[0.0], np.cumsum(track.offset)])
        for rows in true_slices(truth_of(track).keeping):
            edges = np.arange(rows.start, rows.stop + 1, ROWS)  # means of the rows between: no aliases
            if len(edges) > SEGMENTS[-1]:
                runs.append(np.diff(whole[edges]) / ROWS)
    if not runs:
        raise NotEnoughDataError(
            f"{source}: no vehicle keeps its lane for {SEGMENTS[-1] * ROWS * STEP:.0f} s, for its band"
        )
    return spectrum(runs, ROWS * STEP)


def band_of(recorded: Spectrum, home: Spectrum) -> SensorBand:
    """What a recording shows of movement like home's: the root of the ratio of both spectra, at most 1."""
    there, here = np.round(recorded.frequency, 5), np.round(home.frequency, 5)  # as a record holds them
    rows = np.isin(there, here) & (recorded.frequency > LEAST_FREQUENCY)
    frequency, density = recorded.frequency[rows], home.density[np.isin(here, there[rows])]
    with np.errstate(divide="ignore"):
        gain = np.sqrt(recorded.density[rows] / density)
    return SensorBand(frequency, np.minimum(np.nan_to_num(gain, nan=1.0), 1.0))


RECORDED_SPECTRUM = "recorded_spectrum"
"""Key of a profile's record: the spectrum of its recording."""


def spectrum_in(profile: DriverProfile) -> Spectrum:
    """Of lane keeping in a profile's recording, from its record; `DriverProfileError`: that holds none."""
    known: Any = profile.provenance.fit.get(RECORDED_SPECTRUM)
    try:
        frequency, density = (np.array(known[name], dtype=np.float64) for name in ("frequency_hz", "m2_per_hz"))
        if frequency[0] > 0.0 and (np.diff(frequency) > 0.0).all() and (density[: len(frequency)] >= 0.0).all():
            return Spectrum(frequency, np.broadcast_to(density, frequency.shape), np.zeros(len(frequency), np.int64))
    except (IndexError, KeyError, TypeError, ValueError):  # anybody may write there what they like
        pass
    raise DriverProfileError(f"{profile.name} does not hold the spectrum of its recording: name the recording")


# ---- the sensor ----
# Lateral speed is the change of position over the last `RATE_WINDOW`, lateral acceleration that of the lateral speed:
# what is known of one second, as a tracker knows it.
WATCHED_DISTANCE = 150.0
"""Vehicles farther ahead are not watched: 5 s at 30 m/s, as in `recordings.encounters`. [m]"""


@dataclass(frozen=True, slots=True)
class Sensor:
    """What worsens the lateral position that a detector sees; as it is, nothing does.

    Notes
    -----
    `USUAL_SENSOR` is a long-range radar with a camera: 0.05 m is 0.1 deg at 30 m, the azimuth accuracy that Continental
    states for its ARS 408-21 (cycle 72 ms; as quoted, the data sheet could not be opened); 0.1 s is two cycles of 50 ms
    until an object list is out. Look at several: `--sensor` takes any.
    """

    noise: float = 0.0  # standard deviation of each measured position, white [m]
    delay: float = 0.0  # until it is known [s]
    rate: float = 1.0 / STEP  # positions a second, held in between [Hz]
    band: SensorBand | None = None  # through which positions are seen; None: all that there is

    def taken(self, first: int, n: int) -> IntArray:
        """Row that is known at each of n rows from instant number `first` on; -1 before the first one. Shape (n,)."""
        known = STEP * (first + np.arange(n)) - self.delay
        sampled = np.floor(known * self.rate + 1e-6) / self.rate
        return np.asarray(np.floor(sampled / STEP + 1e-6).astype(np.int64) - first)


USUAL_SENSOR = Sensor(noise=0.05, delay=0.1, rate=20.0)
PERFECT_SENSOR = Sensor()


def read_sensor(text: str) -> Sensor:
    """A sensor from ``noise=0.05,delay=0.1,rate=20`` or ``usual``; raises `ValueError`."""
    if text == "usual":
        return USUAL_SENSOR
    limits = {"noise": (0.0, 2.0), "delay": (0.0, 5.0), "rate": (0.5, 1.0 / STEP)}
    numbers = read_numbers(text, limits, "a sensor")
    return Sensor(numbers.get("noise", 0.0), numbers.get("delay", 0.0), numbers.get("rate", 1.0 / STEP))


def seen_through(recorded: Spectrum, scenes: Sequence[Scene], sensor: Sensor) -> Sensor:
    """The sensor with the band that a recording leaves of what moves in these scenes."""
    home = keeping_spectrum((track for scene in scenes for track in scene.tracks), scenes[0].name)
    return replace(sensor, band=band_of(recorded, home))


def read_numbers(text: str, limits: Mapping[str, tuple[float, float]], what: str) -> dict[str, float]:
    """``NAME=VALUE,...`` with names and inclusive limits; raises `ValueError`."""
    numbers = dict[str, float]()
    for word in filter(None, text.split(",")):
        name, equals, value = word.partition("=")
        if not equals or name not in limits:
            raise ValueError(f"{word!r}: {what} has {', '.join(f'{one}=VALUE' for one in limits) or 'no options'}")
        low, high = limits[name]
        try:
            numbers[name] = float(value)
        except ValueError:
            numbers[name] = np.nan
        if not low <= numbers[name] <= high:
            raise ValueError(f"{word!r}: expected a number from {low:g} to {high:g}, its unit left out")
    return numbers


@dataclass(frozen=True, eq=False, slots=True)
class SensedTrack:
    """A track as the sensor gives it; arrays of shape (n,). What was not yet measured is as at the first moment."""

    taken: IntArray  # row that each row knows
    offset: FloatArray  # from its lane's centre, positive left [m]
    speed: FloatArray  # lateral, positive left [m/s]
    acceleration: FloatArray  # lateral, positive left [m/s2]


def measure(track: LaneTrack, sensor: Sensor, rng: np.random.Generator) -> SensedTrack:
    """What a sensor gives of a track."""
    taken = np.maximum(sensor.taken(track.first, len(track)), 0)
    position = track.lateral if sensor.band is None else sensor.band.seen(track.lateral)
    if sensor.noise > 0.0:
        position = position + sensor.noise * rng.standard_normal(len(track))
    lateral = position[taken]
    speed = rate(lateral, STEP, RATE_WINDOW, past=True)
    return SensedTrack(taken, lateral - track.base[taken], speed, rate(speed, STEP, RATE_WINDOW, past=True))


@dataclass(frozen=True, eq=False, slots=True)
class Observer:
    """The vehicle in the next lane that would be cut in on; arrays of shape (n,), NaN where there is none."""

    gap: FloatArray  # from its front to the other's rear, negative side by side [m]
    closing: FloatArray  # its speed minus the other's [m/s]
    clearance: FloatArray  # between the sides of both, negative where they overlap across [m]
    speed: FloatArray  # [m/s]
    length: FloatArray  # [m]


@dataclass(frozen=True, eq=False, slots=True)
class View:
    """A vehicle seen from the lane on one side of it; arrays of shape (n,)."""

    number: int  # of the track in its scene
    track: LaneTrack
    side: int  # of that lane: 1: left, -1: right
    truth: Truth
    measured: SensedTrack
    watched: BoolArray  # there is such a lane and, with an ego, the ego in it
    observer: Observer | None  # None: the source has no other vehicles

    @property
    def towards(self) -> FloatArray:
        """From its lane's centre towards that lane. [m]"""
        return self.side * self.measured.offset

    @property
    def lateral_speed(self) -> FloatArray:
        """Towards that lane. [m/s]"""
        return self.side * self.measured.speed

    @property
    def lateral_acceleration(self) -> FloatArray:
        """Towards that lane. [m/s2]"""
        return self.side * self.measured.acceleration

    @property
    def room(self) -> FloatArray:
        """From the vehicle's side to the marking, negative beyond it. [m]"""
        width = self.track.lane_width[self.measured.taken]
        return np.asarray(0.5 * (width - self.track.box.width) - self.towards)


def views_of(scene: Scene, sensor: Sensor, seed: int, *, with_observers: bool = True) -> list[View]:
    """Every vehicle but the ego, from both sides where it is ever watched from there."""
    root = (seed, of_name(scene.name))
    several, views = len({track.name for track in scene.tracks}) > 1, []
    rows = Rows(scene) if scene.ego is not None or (with_observers and several) else None
    for number, track in enumerate(scene.tracks):
        if track.name == scene.ego:
            continue
        truth = truth_of(track)
        measured = measure(track, sensor, np.random.default_rng((*root, number)))
        for side in (1, -1):
            watched, observer = track.has_lane(side), None
            if rows is not None:
                observer = _observer(rows, number, side, measured.taken)
            if scene.ego is not None:
                assert observer is not None
                watched = watched & np.isfinite(observer.gap)
            if watched.any():
                views.append(View(number, track, side, truth, measured, watched, observer))
    return views


def _observer(rows: Rows, number: int, side: int, taken: IntArray) -> Observer:
    """The ego where it is in the next lane, not ahead; else the nearest vehicle behind in that lane."""
    track, mine = rows.tracks[number], slice(rows.begin[number], rows.begin[number + 1])
    box, a = track.box, {name: values[mine] for name, values in rows.columns.items()}
    nearest, values = np.full(len(track), np.inf), np.full((5, len(track)), np.nan)
    for others in rows.beside(number, side):
        b = {name: of_all[others] for name, of_all in rows.columns.items()}
        dx, dy, cos, sin = a["x"] - b["x"], a["y"] - b["y"], np.cos(b["heading"]), np.sin(b["heading"])
        ahead = dx * cos + dy * sin + box.center_x - b["center_x"]
        lengths = 0.5 * (box.length + b["length"])
        better = (others >= 0) & (ahead > -lengths) & (ahead < np.minimum(nearest, WATCHED_DISTANCE))
        nearest[better] = ahead[better]
        widths = 0.5 * (a["lane_width"] + b["lane_width"])
        apart = widths - side * (a["offset"] - b["offset"]) - 0.5 * (box.width + b["width"])
        columns = ahead - lengths, b["speed"] - a["speed"], apart, b["speed"], b["length"]
        values[:, better] = np.array(columns)[:, better]
    return Observer(*values[:, taken])
