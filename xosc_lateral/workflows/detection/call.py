"""`detect`: false alarms, cut-ins seen and time before the marking, of detectors on scenarios and measured traffic."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from xosc_lateral.files.mapping import MappingLike, as_mapping
from xosc_lateral.workflows.conversion.settings import ConvertSettings
from xosc_lateral.workflows.detection.command import ANSWER_TIME, Command
from xosc_lateral.workflows.detection.detection import Detection
from xosc_lateral.workflows.detection.detectors import RULES, Detector, read_rule
from xosc_lateral.workflows.detection.logistic import train
from xosc_lateral.workflows.detection.observation import PERFECT, Sensor, View, read_numbers, read_sensor, views_of
from xosc_lateral.workflows.detection.scoring import Tally
from xosc_lateral.workflows.detection.sources import SourceSettings, checked, sources_of
from xosc_lateral.workflows.detection.tracks import moves_in_lane
from xosc_lateral.workflows.result import PathLike, Paths, as_paths

if TYPE_CHECKING:
    pass

ALL_RULES = "all"
TRAINED = "logistic"


def detect(
    sources: Paths,
    *,
    detectors: str | Sequence[str] = (ALL_RULES,),
    ego: str | None = None,
    variants: int = 0,
    profiles: str | Sequence[str] = ("motorway",),
    train: Paths = (),
    sensor: str | Sensor = PERFECT,
    threshold: float = 0.5,
    answer_time: float = ANSWER_TIME,
    seed: int = 0,
    road: PathLike | None = None,
    columns: MappingLike | None = None,
    library: Paths = (),
    allow: Paths = (),
    road_path: Paths = (),
    time_limit: float | None = None,
) -> Detection:
    """Count what cut-in detectors do on scenarios, drive tables and recordings, side by side.

    Parameters
    ----------
    sources : path or paths
        Scenarios (``.xosc``) and folders of them, nominal or converted; drive tables; recordings and tables of states.
    detectors : str or sequence of str
        ``NAME`` or ``NAME:OPTION=VALUE,...`` of a built-in one, ``"all"`` of them, or a command of your own.
    ego : str, optional
        Alarms are for cut-ins into its lane; "none": into any neighbouring lane. Without: a scenario's vehicle under
        test, else none.
    variants : int
        Lifelike variants of each scenario, with each of the profiles, counted beside the scenario as it is.
    profiles : str or sequence of str
        Names or paths.
    train : path or paths
        Sources that `logistic` is trained on; not used for anything else.
    sensor : str or Sensor
        ``noise=0.05,delay=0.1,rate=20`` [m], [s], [Hz], or "usual", which is this.
    threshold : float
        Score above which a command's answer is an alarm.
    answer_time : float
        Within which a command has to answer a step. [s]
    seed : int
        Of variants and of the sensor's noise: the same inputs and seed, the same numbers.
    road : str or Path, optional
        OpenDRIVE file of a recording or table of states that comes without one, or in place of a scenario's.
    columns : mapping, TableMapping or path, optional
        What columns of tables are called.
    library, allow, road_path, time_limit
        As in `convert`.

    Raises
    ------
    FormatError, PlaybackError, NotEnoughDataError
        A source that can't be read, or holds nothing to count.
    SimulationError
        A command that can't be started, ends, or answers what can't be used.
    ValueError
        A detector, option or sensor that does not exist.
    """
    paths = as_paths(sources)
    if not paths:
        raise ValueError("no source to look at")
    seen_with = read_sensor(sensor) if isinstance(sensor, str) else sensor
    requested = [detectors] if isinstance(detectors, str) else list(detectors)
    names = (profiles,) if isinstance(profiles, str) else tuple(profiles)
    for word in requested:  # before anything is read that takes long
        _read_detector(word, threshold, answer_time)
    convert = ConvertSettings.of(
        seed=seed, library=library, allow=allow, road=road, road_path=road_path, time_limit=time_limit
    )
    settings = SourceSettings(convert, variants, names, ego, None if road is None else Path(road), as_mapping(columns))
    looked_at = [source for path in paths for source in sources_of(path, settings)]
    trainers = as_paths(train)
    chosen = [
        detector
        for word in requested
        for detector in _detectors(word, threshold, answer_time, trainers, settings, seen_with, seed)
    ]
    needs_others = any(detector.needs_observer for detector in chosen)
    tallies, still = list[Tally](), set[str]()
    for source in looked_at:
        source_tallies = [Tally(detector, source.label) for detector in chosen]
        moves = False
        for scene in checked(source):
            views = views_of(scene, seen_with, seed, with_observers=needs_others)
            moves = moves or any(moves_in_lane(view.track, view.truth) for view in views)
            for tally in source_tallies:
                tally.add(scene, views)
        tallies += source_tallies
        still |= set() if moves else {source.label}
    files = [path for path in (*paths, *trainers) if path.is_file()]
    return Detection(tallies, looked_at, seen_with, seed, frozenset(still), files)


def _read_detector(word: str, threshold: float, answer_time: float) -> Detector | float | None:
    """A rule or command; the threshold of one that is still to be trained; None: all of them."""
    name, _, options = word.partition(":")
    if word == ALL_RULES:
        return None
    if name == TRAINED:
        return read_numbers(options, {"threshold": (1e-6, 1.0 - 1e-6)}, TRAINED).get("threshold", 0.5)
    return read_rule(word) or Command(word, threshold, answer_time)


def _detectors(
    word: str,
    threshold: float,
    answer_time: float,
    trainers: Sequence[Path],
    settings: SourceSettings,
    sensor: Sensor,
    seed: int,
) -> Iterator[Detector]:
    detector = _read_detector(word, threshold, answer_time)
    if isinstance(detector, Detector):
        yield detector
        return
    if detector is None:
        yield from (rule() for rule in RULES.values())
        if not trainers:
            return
        detector = 0.5
    if not trainers:
        raise ValueError(f"{TRAINED} has to be trained: name a source with --train")
    as_they_are = replace(settings, variants=0)
    views = _training_views(trainers, as_they_are, sensor, seed)
    yield train(views, detector, ", ".join(path.name for path in trainers))


def _training_views(trainers: Sequence[Path], settings: SourceSettings, sensor: Sensor, seed: int) -> Iterator[View]:
    for path in trainers:
        for source in sources_of(path, settings):
            for scene in checked(source):
                yield from views_of(scene, sensor, seed, with_observers=False)
