"""`detect`: false alarms, cut-ins seen and time before the marking, of detectors on scenarios and measured traffic."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace as replaced
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from xosc_lateral.workflows.inputs import DocumentLike, RoadLike, ScenarioInput, scenario_input, several
from xosc_lateral.workflows.opened import HeldPath, is_document, opened, opened_as_one
from xosc_lateral.workflows.options import PathLike, Paths, ProfileLike, declare_options, flag
from xosc_lateral.workflows.options import paths as as_paths
from xosc_lateral.workflows.result import given_profile

if TYPE_CHECKING:
    from xosc_lateral.drivers.evaluation.spectra import Spectrum
    from xosc_lateral.extras.detect.cut_ins import CutIns
    from xosc_lateral.extras.detect.detection import Detection
    from xosc_lateral.extras.detect.detectors import Detector
    from xosc_lateral.extras.detect.observation import Sensor, View
    from xosc_lateral.extras.detect.sight import Sight
    from xosc_lateral.extras.detect.sources import SourceSettings
    from xosc_lateral.extras.detect.tracks import Scene
    from xosc_lateral.extras.detect.tuning import Learner
    from xosc_lateral.files.mapping import MappingLike

ALL_RULES = "all"
TRAINED_RULE = "logistic"


def _known_sensor(text: str) -> str:
    from xosc_lateral.extras.detect.observation import read_sensor

    read_sensor(text)
    return text


@declare_options
def detect(
    sources: DocumentLike | Sequence[DocumentLike], *,
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
    tune: Annotated[str, flag(metavar="N/h|N%",
        help="Set thresholds on the homes: at most so many false alarms an hour (20/h), or so many cut-ins seen before "
        "the marking (95%).")] = "",
    home: Annotated[Paths, flag(kind=list[Path] | None, metavar="SOURCE",
        help="With --tune: what thresholds are set on, and logistic is trained on; each for itself; may be "
        "repeated.")] = (),
    band_of: Annotated[PathLike | None, flag("--band-of", kind=Path | None, metavar="RECORDING", show_default=False,
        help="With --tune: see the homes through the band of a recording, which shows less of fast "
        "movement.")] = None,
    threshold: Annotated[float, flag(help="Score above which a program's answer is an alarm.")] = 0.5,
    answer_time: Annotated[float, flag(help="A program has to answer within [s].", min=0.01, max=3600)] = 10.0,
    like: Annotated[ProfileLike | None, flag(kind=str | None, metavar="PROFILE", show_default=False,
        help="A table of cut-ins instead: the scenario's lane changes varied as by `vary --like`, a drive for each "
        "set.")] = None,
    replace: Annotated[bool, flag("--replace",
        help="With --like: lane changes that are shorter than real ones get their durations, too.")] = False,
    count: Annotated[int, flag("--count", min=1, max=100_000, help="With --like: sets.")] = 100,
    shard: Annotated[str | None, flag("--shard", metavar="K/N", show_default=False,
        help="With --like: the K-th of N parts of the sets.")] = None,
    keep: Annotated[PathLike | None, flag("--keep", kind=Path | None, metavar="FOLDER", show_default=False,
        help="With --like: where the variations and what they are converted to stay.")] = None,
    sight: Annotated[bool, flag(
        help="Range of vision instead: how often a vehicle sees the car before the car ahead.")] = False,
    seed: int = 0,
    road: Annotated[RoadLike | None, flag("--road", kind=Path | None, show_default=False,
        help="OpenDRIVE file of a recording without one.")] = None,
    format: Annotated[str | None, flag("--format", metavar="FORMAT", show_default=False,  # noqa: A002
        help="Of recordings, where their files do not show it: dlr-ht, levelx, osi, tracks ...")] = None,
    columns: MappingLike | None = None,
    library: Paths = (),
    allow: Paths = (),
    road_path: Paths = (),
    time_limit: float | None = None,
) -> Detection | Sight | CutIns:  # fmt: skip
    """Count what cut-in detectors do on scenarios, drive tables and recordings, side by side.

    Parameters
    ----------
    sources : path or paths, or scenarios in memory (see `convert`)
        Scenarios (``.xosc``) and folders of them, nominal or converted; drive tables; recordings and tables of states.
    ego : str, optional
        Alarms are for cut-ins into its lane; "none": into any neighbouring lane. Without: a scenario's vehicle under
        test, else none.
    variants : int
        Lifelike variants of each scenario, with each of the profiles, counted beside the scenario as it is.
    tune : str
        "20/h", "95%": each home (with variants: as written, and lifelike) gives each detector a threshold, which is
        tried on the sources. What is trained at home is set there on vehicles that it was not trained on. A source
        that is a home too is tried with thresholds from its other vehicles.
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
    from xosc_lateral.extras.detect.detection import Detection
    from xosc_lateral.extras.detect.detectors import Detector
    from xosc_lateral.extras.detect.observation import read_sensor, views_of
    from xosc_lateral.extras.detect.scoring import Tally
    from xosc_lateral.extras.detect.sight import sight_of
    from xosc_lateral.extras.detect.sources import SourceSettings, checked, sources_of
    from xosc_lateral.extras.detect.tracks import moves_in_lane
    from xosc_lateral.extras.detect.tuning import in_order, read_goal, set_at_home
    from xosc_lateral.files.mapping import as_mapping
    from xosc_lateral.workflows.conversion.settings import ConvertSettings

    inputs = [
        scenario_input(one, road, f"scenario_{number}" if number > 1 else "scenario")
        if is_document(one)
        else ScenarioInput(
            path, None if road is None else opened_as_one(road), path.held if isinstance(path, HeldPath) else None
        )
        for number, one in enumerate(several(sources), start=1)
        for path in (opened(one, f"table {number}") if not is_document(one) else [Path()])
    ]
    paths, homes, trainers = [one.path for one in inputs], as_paths(home), as_paths(train)
    if not paths:
        raise ValueError("no source to look at")
    if bool(tune) != bool(homes):
        raise ValueError("--tune and --home belong together: to what thresholds are set, and where")
    if {*map(Path.resolve, trainers)} & {*map(Path.resolve, homes)}:
        raise ValueError("--train names a home: without it, logistic is trained there and set on other vehicles")
    if band_of is not None and not homes:
        raise ValueError("--band-of is what homes are seen through: name them with --home, and --tune")
    goal = read_goal(tune) if tune else None
    seen_with = read_sensor(sensor) if isinstance(sensor, str) else sensor
    requested = [detectors] if isinstance(detectors, str) else list(detectors)
    names = (profiles,) if isinstance(profiles, str) else tuple(profiles)
    for word in requested:  # before anything is read that takes long
        _read_detector(word, threshold, answer_time)
    convert = ConvertSettings.of(seed=seed, library=library, allow=allow, road_path=road_path, time_limit=time_limit)
    settings = SourceSettings(convert, variants, names, ego, columns=as_mapping(columns), kind=format)
    if isinstance(road, str | os.PathLike):
        settings = settings.on(Path(road))
    if like is not None:
        from xosc_lateral.extras.detect.cut_ins import cut_ins_like
        from xosc_lateral.workflows.batch.call import read_shard

        if len(paths) != 1 or inputs[0].held is not None:
            raise ValueError("--like varies one scenario, in a file")
        detections = [
            each
            for word in requested
            for each in _detectors(word, threshold, answer_time, trainers, settings, seen_with, seed, at_home=False)
            if isinstance(each, Detector)
        ]
        part = (1, 1) if shard is None else read_shard(shard)
        where = None if keep is None else Path(keep)
        law = given_profile(like, library)
        return cut_ins_like(
            paths[0], law, detections, settings, seen_with, count=count, replaces=replace, part=part, keep=where
        )
    looked_at = [source for one in inputs for source in sources_of(one.path, settings.on(one.road, one.held))]
    bands = () if band_of is None else (Path(band_of),)
    files = [path for path in (*paths, *trainers, *homes, *bands) if path.is_file()]
    if sight:
        return sight_of(looked_at, seed, files)
    known_homes = [source for path in homes for source in sources_of(path, settings)]
    labels = [source.label for source in known_homes]
    if twice := sorted({label for label in labels if labels.count(label) > 1}):
        raise ValueError(f"two homes are called {twice[0]!r}, which rows could not tell apart")
    chosen: list[Detector | Learner] = []
    for word in requested:
        chosen += _detectors(word, threshold, answer_time, trainers, settings, seen_with, seed, at_home=bool(homes))
    tried = [each for each in chosen if isinstance(each, Detector)]
    needs_others = any(detector.needs_observer for detector in tried)
    tallies_at_home = dict[str, list[Tally]]()
    if goal is not None:
        tried = []
        recorded = [band_source(path, settings) for path in bands]
        for source in known_homes:
            scenes = list(checked(source))
            at_home = seen_through(recorded[0], scenes, seen_with) if recorded else seen_with
            views = [(scene, views_of(scene, at_home, seed, with_observers=needs_others)) for scene in scenes]
            within = any(source.is_same(each) for each in looked_at)
            for candidate in chosen:
                carrier, tally = set_at_home(goal, candidate, views, source.label, within=within)
                tried.append(carrier)
                tallies_at_home.setdefault(source.label, []).extend([] if tally is None else [tally])
    tallies, still = list[Tally](), set[str]()
    for source in looked_at:
        itself = tallies_at_home.get(source.label, []) if any(source.is_same(each) for each in known_homes) else []
        elsewhere = [each for each in tried if not (itself and each.home_source == source.label)]
        source_tallies = [Tally(detector, source.label) for detector in elsewhere]
        moves = False
        for scene in checked(source):
            views_here = views_of(scene, seen_with, seed, with_observers=needs_others)
            moves = moves or any(moves_in_lane(view.track, view.truth) for view in views_here)
            for tally in source_tallies:
                tally.add(scene, views_here)
        tallies += in_order([*source_tallies, *itself], labels)
        still |= set() if moves else {source.label}
    return Detection(tallies, looked_at, seen_with, seed, frozenset(still), files, goal, known_homes)


def band_source(path: Path, settings: SourceSettings) -> Spectrum:
    """Spectrum of lane keeping of a recording."""
    from xosc_lateral.extras.detect.band import keeping_spectrum
    from xosc_lateral.extras.detect.sources import checked, sources_of

    (source,) = sources_of(path, replaced(settings, variants=0))
    return keeping_spectrum((track for scene in checked(source) for track in scene.tracks), source.label)


def seen_through(recorded: Spectrum, scenes: Sequence[Scene], sensor: Sensor) -> Sensor:
    """The sensor with the band that a recording leaves of what moves in these scenes."""
    from xosc_lateral.extras.detect.band import band_of, keeping_spectrum

    home = keeping_spectrum((track for scene in scenes for track in scene.tracks), scenes[0].name)
    return replaced(sensor, band=band_of(recorded, home))


def _read_detector(word: str, threshold: float, answer_time: float) -> Detector | float | None:
    """A rule or command; the threshold of one that is still to be trained; None: all of them."""
    from xosc_lateral.extras.detect.command import Command
    from xosc_lateral.extras.detect.detectors import read_rule
    from xosc_lateral.extras.detect.observation import read_numbers

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
    *,
    at_home: bool,
) -> Iterator[Detector | Learner]:
    """Detectors of a word; what is still to be trained at home, as its learner."""
    from xosc_lateral.extras.detect.detectors import RULES, Detector
    from xosc_lateral.extras.detect.logistic import train

    detector = _read_detector(word, threshold, answer_time)
    if isinstance(detector, Detector):
        yield detector
        return
    if detector is None:
        yield from (rule() for rule in RULES.values())
        if not trainers:
            return
        detector = 0.5
    set_first = detector
    if not trainers and at_home:
        yield lambda views, source: train(views, set_first, source)
        return
    if not trainers:
        raise ValueError(f"{TRAINED_RULE} has to be trained: name a source with --train")
    as_they_are = replaced(settings, variants=0)
    views = _training_views(trainers, as_they_are, sensor, seed)
    yield train(views, detector, ", ".join(path.name for path in trainers))


def _training_views(trainers: Sequence[Path], settings: SourceSettings, sensor: Sensor, seed: int) -> Iterator[View]:
    from xosc_lateral.extras.detect.observation import views_of
    from xosc_lateral.extras.detect.sources import checked, sources_of

    for path in trainers:
        for source in sources_of(path, settings):
            for scene in checked(source):
                yield from views_of(scene, sensor, seed, with_observers=False)
