"""`detect`: false alarms, cut-ins seen and time before the marking, of detectors on scenarios and measured traffic."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from xosc_lateral.files.mapping import MappingLike, as_mapping
from xosc_lateral.workflows.opened import (
    DocumentLike,
    HeldPath,
    RoadLike,
    ScenarioInput,
    is_document,
    opened,
    opened_as_one,
    scenario_input,
    several,
)
from xosc_lateral.workflows.options import PathLike, Paths, ProfileLike, declare_options, flag, roads
from xosc_lateral.workflows.options import paths as as_paths
from xosc_lateral.workflows.result import given_profile

if TYPE_CHECKING:
    from xosc_lateral.extras.detect.cut_ins import CutIns
    from xosc_lateral.extras.detect.detection import Detection
    from xosc_lateral.extras.detect.observation import Sensor
    from xosc_lateral.extras.detect.scoring import Tally
    from xosc_lateral.extras.detect.sight import Sight


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
        "(threshold each), a program of yours, or all that need no training (all, the default); may be "
        "repeated.")] = ("all",),
    ego: Annotated[str | None, flag(metavar="NAME",
        help="Count cut-ins into its lane; none: into any neighbouring lane.")] = None,
    variants: Annotated[int, flag(help="Lifelike variants of each scenario, beside it.", min=0, max=10_000)] = 0,
    profiles: Annotated[str | Sequence[str], flag("--profile", "-p", kind=list[str] | None, metavar="NAME|PATH",
        help="Who drives the variants; may be repeated.")] = ("motorway",),
    sensor: Annotated[str | Sensor, flag(kind=str, read=_known_sensor, metavar="noise=M,delay=S,rate=HZ",
        help="What detectors see through; usual: 0.05, 0.1, 20.")] = "",
    home: Annotated[Paths, flag(kind=list[Path] | None, metavar="SOURCE",
        help="What logistic is trained on; with --tune each for itself, and thresholds are set there; may be "
        "repeated.")] = (),
    tune: Annotated[str, flag(metavar="N/h|N%|N% Ns",
        help="Set thresholds on the homes: at most so many false alarms an hour (20/h), or so many cut-ins seen before "
        "the marking (95%), or so long before it (90% 1s).")] = "",
    band_of: Annotated[ProfileLike | None, flag("--band-of", kind=str | None, metavar="RECORDING|PROFILE",
        show_default=False, help="With --tune: see the homes through the band of a recording, or of that of a profile, "
        "which shows less of fast movement.")] = None,
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
    road: Annotated[RoadLike | None, flag("--road", kind=list[Path] | None, metavar="FILE|FOLDER",
        show_default=False, gives=roads,
        help="OpenDRIVE file of a recording without one; folder with roads known by name, may be repeated.")] = None,
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
        "20/h", "95%", "90% 1s": each home (with variants: as written, and lifelike) gives each detector a threshold,
        which is tried on the sources. What is trained at home is set there on vehicles that it was not trained on. A
        source that is a home too is tried with thresholds from its other vehicles.
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
    from dataclasses import replace as replaced

    from xosc_lateral.extras.detect.cut_ins import cut_ins_like
    from xosc_lateral.extras.detect.detection import Detection, count_all
    from xosc_lateral.extras.detect.observation import keeping_spectrum, read_sensor, spectrum_in
    from xosc_lateral.extras.detect.other_detectors import TRAINED_RULE, read_detectors, train_all
    from xosc_lateral.extras.detect.sight import sight_of
    from xosc_lateral.extras.detect.sources import SourceSettings, checked, sources_of
    from xosc_lateral.extras.detect.tuning import read_goal, tune_all
    from xosc_lateral.workflows.batch.call import read_shard
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
    paths, home_paths, goal = [one.path for one in inputs], as_paths(home), read_goal(tune) if tune else None
    requested = [detectors] if isinstance(detectors, str) else list(detectors)
    chosen = [each for word in requested for each in read_detectors(word)]
    is_trained = any(word.partition(":")[0] == TRAINED_RULE for word in requested)
    if not paths:
        raise ValueError("no source to look at")
    if is_trained and not home_paths:
        raise ValueError(f"{TRAINED_RULE} has to be trained: name a source with --home")
    if bool(home_paths) != (goal is not None or is_trained):
        raise ValueError("--tune and --home belong together: to what thresholds are set, and where")
    if band_of is not None and goal is None:
        raise ValueError("--band-of is what homes are seen through: name them with --home, and --tune")
    if like is not None and (len(paths) != 1 or inputs[0].held is not None):
        raise ValueError("--like varies one scenario, in a file")
    convert = ConvertSettings.of(seed=seed, library=library, allow=allow, road_path=road_path, time_limit=time_limit)
    settings = SourceSettings(
        convert, variants, (profiles,) if isinstance(profiles, str) else tuple(profiles), ego,
        columns=as_mapping(columns), kind=format, sensor=read_sensor(sensor) if isinstance(sensor, str) else sensor,
    )  # fmt: skip
    if isinstance(road, str | os.PathLike):
        settings = settings.on(Path(road))
    as_they_are = replaced(settings, variants=0)
    looked_at = [source for one in inputs for source in sources_of(one.path, settings.on(one.road, one.held))]
    bands = [Path(one) for one in (band_of,) if isinstance(one, str | Path)]
    bands = [one for one in bands if one.is_dir() or one.suffix not in ("", ".json")]  # others are profiles
    files = [path for path in (*paths, *home_paths, *bands) if path.is_file()]
    if sight:
        return sight_of(looked_at, seed, files)
    homes = [one for path in home_paths for one in sources_of(path, as_they_are if goal is None else settings)]
    done_there: dict[str, list[Tally]] = {}
    if goal is None:
        tried = train_all(chosen, homes, settings)
    else:
        recorded = spectrum_in(given_profile(band_of, library)) if band_of is not None and not bands else None
        for source in [one for path in bands for one in sources_of(path, as_they_are)]:
            recorded = keeping_spectrum((one for scene in checked(source) for one in scene.tracks), source.label)
        tried, done_there = tune_all(goal, chosen, homes, looked_at, settings, recorded)
    if like is not None:
        part, law = (1, 1) if shard is None else read_shard(shard), given_profile(like, library)
        where = None if keep is None else Path(keep)
        return cut_ins_like(paths[0], law, tried, settings, count=count, replaces=replace, part=part, keep=where)
    tallies, still = count_all(tried, looked_at, done_there, homes, settings)
    return Detection(tallies, looked_at, settings.sensor, seed, still, files, goal, homes if goal else ())
