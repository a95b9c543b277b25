"""`detect`: false alarms, cut-ins seen and time before the marking, of detectors on scenarios and measured traffic."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from xosc_lateral.base.lazy import pd
from xosc_lateral.files.hashes import parsed_hashes
from xosc_lateral.files.mapping import MappingLike, as_mapping
from xosc_lateral.files.output_paths import claim, output_file
from xosc_lateral.workflows.conversion.settings import ConvertSettings
from xosc_lateral.workflows.detection.command import ANSWER_TIME, Command
from xosc_lateral.workflows.detection.detectors import RULES, Detector, read_rule
from xosc_lateral.workflows.detection.logistic import train
from xosc_lateral.workflows.detection.observation import PERFECT, Sensor, View, read_numbers, read_sensor, views_of
from xosc_lateral.workflows.detection.scoring import Case, Curve, Tally, worst_of
from xosc_lateral.workflows.detection.sources import Source, SourceSettings, checked, sources_of
from xosc_lateral.workflows.detection.truth import moves_in_lane
from xosc_lateral.workflows.result import PathLike, Paths, Result, as_paths, write_page

if TYPE_CHECKING:
    from xosc_lateral.files.pages.figure import Figure

ALL = "all"
TRAINED = "logistic"


def detect(
    sources: Paths,
    *,
    detectors: str | Sequence[str] = (ALL,),
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
    said = [detectors] if isinstance(detectors, str) else list(detectors)
    names = (profiles,) if isinstance(profiles, str) else tuple(profiles)
    for word in said:  # before anything is read that takes long
        _read_detector(word, threshold, answer_time)
    convert = ConvertSettings.of(
        seed=seed, library=library, allow=allow, road=road, road_path=road_path, time_limit=time_limit
    )
    settings = SourceSettings(convert, variants, names, ego, None if road is None else Path(road), as_mapping(columns))
    looked_at = [source for path in paths for source in sources_of(path, settings)]
    trainers = as_paths(train)
    chosen = [
        one for word in said for one in _detectors(word, threshold, answer_time, trainers, settings, seen_with, seed)
    ]
    needs_others = any(detector.needs_observer for detector in chosen)
    tallies, still = list[Tally](), set[str]()
    for source in looked_at:
        own = [Tally(detector, source.label) for detector in chosen]
        moves = False
        for scene in checked(source):
            views = views_of(scene, seen_with, seed, with_observers=needs_others)
            moves = moves or any(moves_in_lane(view.track, view.truth) for view in views)
            for tally in own:
                tally.add(scene, views)
        tallies += own
        still |= set() if moves else {source.label}
    files = [path for path in (*paths, *trainers) if path.is_file()]
    return Detection(tallies, looked_at, seen_with, seed, files, still)


def _read_detector(word: str, threshold: float, answer_time: float) -> Detector | float | None:
    """A rule or command; the threshold of one that is still to be trained; None: all of them."""
    name, _, options = word.partition(":")
    if word == ALL:
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
    found = _read_detector(word, threshold, answer_time)
    if isinstance(found, Detector):
        yield found
        return
    if found is None:
        yield from (rule() for rule in RULES.values())
        if not trainers:
            return
        found = 0.5
    if not trainers:
        raise ValueError(f"{TRAINED} has to be trained: name a source with --train")
    as_they_are = replace(settings, variants=0)
    views = _training_views(trainers, as_they_are, sensor, seed)
    yield train(views, found, ", ".join(path.name for path in trainers))


def _training_views(trainers: Sequence[Path], settings: SourceSettings, sensor: Sensor, seed: int) -> Iterator[View]:
    for path in trainers:
        for source in sources_of(path, settings):
            for scene in checked(source):
                yield from views_of(scene, sensor, seed, with_observers=False)


class Detection(Result):
    """What detectors did on sources."""

    __slots__ = ("_files", "_sources", "_tallies", "curves", "seed", "sensor", "still")

    def __init__(
        self,
        tallies: Sequence[Tally],
        sources: Sequence[Source],
        sensor: Sensor,
        seed: int,
        files: Sequence[Path],
        still: Collection[str],
    ) -> None:
        self._tallies, self._sources, self._files = tuple(tallies), tuple(sources), tuple(files)
        self.sensor, self.seed = sensor, seed
        self.curves: tuple[Curve, ...] = tuple(tally.curve() for tally in tallies)
        """Of each detector on each source, in the order of the sources."""
        self.still = frozenset(still)
        """Sources in which no vehicle moves inside its lane."""

    @property
    def sources(self) -> tuple[str, ...]:
        """Their labels."""
        return tuple(source.label for source in self._sources)

    def headline(self) -> str:
        """One line."""
        detectors = len(self.curves) // len(self._sources)
        hours = sum({curve.source: float(curve.hours.sum()) for curve in self.curves}.values())
        return f"{detectors} detectors on {len(self._sources)} sources, {hours:.2f} h of lane keeping"

    def __str__(self) -> str:
        from xosc_lateral.workflows.detection.text import as_text

        return as_text(self)

    def rows(self, *, every: bool = False) -> list[dict[str, Any]]:
        """A row for each source and detector at the threshold that is set, or at every threshold."""
        found = []
        for curve in self.curves:
            chosen = curve.detector.chosen
            found += _rows(curve, range(len(curve.rate)) if every else [chosen])
        return found

    def to_frame(self) -> pd.DataFrame:
        """One row per source, detector and threshold; `is_set` marks the one that is set. [1/h], [s], shares."""
        return pd.DataFrame(self.rows(every=True))

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""
        return {
            "sources": [{"label": one.label, "files": [path.name for path in one.files]} for one in self._sources],
            "sensor": {"noise": self.sensor.noise, "delay": self.sensor.delay, "rate": self.sensor.rate},
            "rows": [_plain(row) for row in self.rows()],
            "curves": [
                {
                    "source": curve.source,
                    "detector": curve.detector.label(),
                    "quantity": curve.detector.quantity,
                    "threshold": curve.detector.thresholds.tolist(),
                    "false_alarms_per_hour": _listed(curve.rate),
                    "seen": _listed(curve.seen),
                    "seen_before_marking": _listed(curve.in_time),
                    "median_lead_s": _listed(curve.lead(0.5)),
                }
                for curve in self.curves
            ],
            "worst": [
                {"kind": case.kind, "source": source, "detector": detector, "scene": case.scene.name,
                 "vehicle": case.view.track.name, "side": "left" if case.view.side > 0 else "right",
                 "time": round(case.time, 3)}
                for source, detector, case in self.worst()
            ],
            "provenance": self._provenance(),
        }  # fmt: skip

    def worst(self) -> list[tuple[str, str, Case]]:
        """Source, detector and case of the worst ones of all."""
        return worst_of([(one.source, one.detector.label(), case) for one in self._tallies for case in one.cases])

    def plot(self) -> Figure:
        """Cut-ins seen in time, and the median time before the marking, over false alarms an hour."""
        from xosc_lateral.workflows.detection.page import curves_figure

        return curves_figure(self.curves)

    def write(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the table with every threshold: ``.csv``, ``.csv.gz`` or ``.parquet``."""
        from xosc_lateral.files.output_tables import output_suffixes, write_frame

        output = output_file(path, "detection.csv", output_suffixes())
        claim([output], self._files, force=force)
        write_frame(self.to_frame(), output, self._provenance())
        return output

    def write_report(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the HTML page: table, curves, and the worst cases in the player."""
        from xosc_lateral.workflows.detection.page import detection_page

        return write_page(path, "detection.html", lambda: detection_page(self), inputs=self._files, force=force)

    def _provenance(self) -> dict[str, Any]:
        files = [path for one in self._sources for path in one.files if path.is_file()]
        return {"seed": self.seed, "inputs": parsed_hashes(files)}


def _rows(curve: Curve, numbers: Sequence[int]) -> list[dict[str, Any]]:
    detector, rates, seen = curve.detector, curve.rate_interval(), curve.seen_interval()
    in_time, medians = curve.seen_interval(in_time=True), curve.lead_interval()
    low, middle, high = (curve.lead(share) for share in (0.05, 0.5, 0.95))
    fixed: dict[str, Any] = {"source": curve.source, "detector": detector.label()}
    counts = {"vehicles": len(curve.hours), "hours": float(curve.hours.sum()), "cut_ins": len(curve.leads)}
    found = []
    for k in numbers:
        is_set = k == detector.chosen
        found.append({
            **fixed, "threshold": float(detector.thresholds[k]), "is_set": is_set, **counts,
            "false_alarms": int(curve.counts[:, k].sum()),
            "false_alarms_per_hour": float(curve.rate[k]),
            "false_alarms_low": float(rates[0, k]), "false_alarms_high": float(rates[1, k]),
            "seen": float(curve.seen[k]), "seen_low": float(seen[0, k]), "seen_high": float(seen[1, k]),
            "seen_before_marking": float(curve.in_time[k]),
            "seen_before_marking_low": float(in_time[0, k]), "seen_before_marking_high": float(in_time[1, k]),
            "lead_median": float(middle[k]), "lead_5": float(low[k]), "lead_95": float(high[k]),
            "lead_median_low": medians[0] if is_set else np.nan,
            "lead_median_high": medians[1] if is_set else np.nan,
        })  # fmt: skip
    return found


def _listed(values: Any) -> list[float | None]:
    return [None if np.isnan(value) else round(float(value), 6) for value in values]


def _plain(row: dict[str, Any]) -> dict[str, Any]:
    """NaN as None, numbers rounded."""
    return {
        name: (None if np.isnan(value) else round(value, 6)) if isinstance(value, float) else value
        for name, value in row.items()
    }
