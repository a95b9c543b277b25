"""`detect`: false alarms, cut-ins seen and time before the marking, of detectors on scenarios and measured traffic."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from xosc_lateral.workflows.options import PathLike, Paths, declare_options, flag
from xosc_lateral.workflows.options import paths as as_paths

if TYPE_CHECKING:
    from xosc_lateral.files.mapping import MappingLike
    from xosc_lateral.workflows.detection.detection import Detection
    from xosc_lateral.workflows.detection.detectors import Detector
    from xosc_lateral.workflows.detection.observation import Sensor, View
    from xosc_lateral.workflows.detection.sources import SourceSettings

ALL_RULES = "all"
TRAINED_RULE = "logistic"


def _known_sensor(text: str) -> str:
    from xosc_lateral.workflows.detection.observation import read_sensor

    read_sensor(text)
    return text


@declare_options
def detect(
    sources: Paths, *,
    detectors: Annotated[str | Sequence[str], flag("--detector", kind=list[str] | None,
        metavar='NAME[:OPTION=VALUE,...]|"COMMAND"',
        help="lateral-speed (threshold, hold), marking-distance, wandering-zone, time-to-line, fuzzy, logistic "
        "(threshold each), all, or a program of yours; may be repeated. Default: all.")] = (ALL_RULES,),
    ego: Annotated[str | None, flag(metavar="NAME",
        help="Count cut-ins into its lane; none: into any neighbouring lane.")] = None,
    variants: Annotated[int, flag(help="Lifelike variants of each scenario, beside it.", min=0, max=10_000)] = 0,
    profiles: Annotated[str | Sequence[str], flag("--profile", "-p", kind=list[str] | None, metavar="NAME|PATH",
        help="Who drives the variants; may be repeated.")] = ("motorway",),
    train: Annotated[Paths, flag(kind=list[Path] | None, metavar="SOURCE",
        help="What logistic is trained on; may be repeated.")] = (),
    sensor: Annotated[str | Sensor, flag(kind=str, read=_known_sensor, metavar="noise=M,delay=S,rate=HZ",
        help="What detectors see through; usual: 0.05, 0.1, 20.")] = "",
    threshold: Annotated[float, flag(help="Score above which a program's answer is an alarm.")] = 0.5,
    answer_time: Annotated[float, flag(help="A program has to answer within [s].", min=0.01, max=3600)] = 10.0,
    seed: int = 0,
    road: Annotated[PathLike | None, flag("--road", kind=Path | None, show_default=False,
        help="OpenDRIVE file of a recording without one.")] = None,
    columns: MappingLike | None = None,
    library: Paths = (),
    allow: Paths = (),
    road_path: Paths = (),
    time_limit: float | None = None,
) -> Detection:  # fmt: skip
    """Count what cut-in detectors do on scenarios, drive tables and recordings, side by side.

    Parameters
    ----------
    sources : path or paths
        Scenarios (``.xosc``) and folders of them, nominal or converted; drive tables; recordings and tables of states.
    ego : str, optional
        Alarms are for cut-ins into its lane; "none": into any neighbouring lane. Without: a scenario's vehicle under
        test, else none.
    variants : int
        Lifelike variants of each scenario, with each of the profiles, counted beside the scenario as it is.
    road : str or Path, optional
        OpenDRIVE file of a recording or table of states that comes without one, or in place of a scenario's.

    Raises
    ------
    FormatError, PlaybackError, NotEnoughDataError
        A source that can't be read, or holds nothing to count.
    SimulationError
        A command that can't be started, ends, or answers what can't be used.
    ValueError
        A detector, option or sensor that does not exist.
    """
    from xosc_lateral.files.mapping import as_mapping
    from xosc_lateral.workflows.conversion.settings import ConvertSettings
    from xosc_lateral.workflows.detection.detection import Detection
    from xosc_lateral.workflows.detection.observation import read_sensor, views_of
    from xosc_lateral.workflows.detection.scoring import Tally
    from xosc_lateral.workflows.detection.sources import SourceSettings, checked, sources_of
    from xosc_lateral.workflows.detection.tracks import moves_in_lane

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
    from xosc_lateral.workflows.detection.command import Command
    from xosc_lateral.workflows.detection.detectors import read_rule
    from xosc_lateral.workflows.detection.observation import read_numbers

    name, _, options = word.partition(":")
    if word == ALL_RULES:
        return None
    if name == TRAINED_RULE:
        return read_numbers(options, {"threshold": (1e-6, 1.0 - 1e-6)}, TRAINED_RULE).get("threshold", 0.5)
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
    from xosc_lateral.workflows.detection.detectors import RULES, Detector
    from xosc_lateral.workflows.detection.logistic import train

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
        raise ValueError(f"{TRAINED_RULE} has to be trained: name a source with --train")
    as_they_are = replace(settings, variants=0)
    views = _training_views(trainers, as_they_are, sensor, seed)
    yield train(views, detector, ", ".join(path.name for path in trainers))


def _training_views(trainers: Sequence[Path], settings: SourceSettings, sensor: Sensor, seed: int) -> Iterator[View]:
    from xosc_lateral.workflows.detection.observation import views_of
    from xosc_lateral.workflows.detection.sources import checked, sources_of

    for path in trainers:
        for source in sources_of(path, settings):
            for scene in checked(source):
                yield from views_of(scene, sensor, seed, with_observers=False)
