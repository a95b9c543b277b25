"""What detectors did on sources: counts, intervals, worst cases, as text, table, JSON and page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from xosc_lateral.base.lazy import pd
from xosc_lateral.base.note import Note
from xosc_lateral.base.texts import aligned, counted, hours_in_words
from xosc_lateral.extras.detect.detectors import Detector
from xosc_lateral.extras.detect.observation import Sensor
from xosc_lateral.extras.detect.page import curves_figure, detection_page
from xosc_lateral.extras.detect.scoring import LEAST_HOURS, Case, Curve, Tally, alarms_in_words, plain, worst_of
from xosc_lateral.extras.detect.sources import Source, SourceSettings, checked
from xosc_lateral.extras.detect.tracks import moves_in_lane
from xosc_lateral.extras.detect.tuning import Carried, Goal, not_met
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.files.source import parsed_hashes
from xosc_lateral.workflows.result import PathLike, Result, write_page

HEADINGS = ("source", "detector", "false alarms / h", "seen", "before the marking", "time before it [s]")
FIGURES = {
    "threshold", "false_alarms_per_hour", "false_alarms_low", "false_alarms_high", "seen", "seen_low", "seen_high",
    "seen_before_marking", "seen_before_marking_low", "seen_before_marking_high", "lead_median", "lead_5", "lead_95",
    "lead_median_low", "lead_median_high",
}  # fmt: skip
"""Of a row at one threshold."""
TUNED_HEADINGS = ("source", "detector", "set on", "threshold", *HEADINGS[2:])


@dataclass(frozen=True, eq=False, repr=False)
class Detection(Result):
    """What detectors did on sources, in the order of the sources."""

    tallies: Sequence[Tally]  # of every detector on every source
    origins: Sequence[Source]
    sensor: Sensor
    seed: int
    still: frozenset[str]  # sources in which no vehicle moves inside its lane
    files: Sequence[Path]  # that must not be overwritten
    goal: Goal | None = None  # what thresholds were set to; None: they are the detectors' own
    homes: Sequence[Source] = ()  # on which they were set

    @property
    def sources(self) -> tuple[str, ...]:
        """Their labels."""
        return tuple(source.label for source in self.origins)

    @cached_property
    def curves(self) -> tuple[Curve, ...]:
        """Of each tally."""
        return tuple(tally.curve() for tally in self.tallies)

    @property
    def carriers(self) -> list[Carried]:
        """Detectors with thresholds from homes."""
        return [detector for tally in self.tallies if isinstance(detector := tally.detector, Carried)]

    @property
    def is_set(self) -> bool:
        """Whether every home gave every detector a threshold that meets the goal."""
        return not not_met(self.carriers)

    def headline(self) -> str:
        """See `Result`."""
        detectors = len({curve.detector.title() for curve in self.curves})
        hours = sum({curve.source: float(curve.hours.sum()) for curve in self.curves}.values())
        both = f"{counted(detectors, 'detector')} on {counted(len(self.origins), 'source')}"
        what = f"{both}, {hours_in_words(hours)} of lane keeping"
        return what if self.goal is None else f"{what}; thresholds from {len(self.homes)} homes at {self.goal.text}"

    @property
    def headings(self) -> tuple[str, ...]:
        """Of the table."""
        return HEADINGS if self.goal is None else TUNED_HEADINGS

    def __str__(self) -> str:
        lines = aligned([self.headings, *(cells(row) for row in self.rows())])
        return "\n".join([self.headline(), "", *lines, "", *self.legend(), *self.message_lines()])

    @property
    def messages(self) -> tuple[Note, ...]:
        """What reading the sources told."""
        return tuple(
            Note(line, path=source.label) for source in (*self.origins, *self.homes) for line in source.told_lines
        )

    def legend(self) -> Sequence[str]:
        """What the numbers count, and what can't be read from them."""
        lines = [
            "False alarms: alarms that begin while a vehicle keeps its lane, an hour, seen from one neighbouring lane. "
            "Seen: an alarm before the vehicle's reference point is in the other lane. Time: from the alarm to its "
            "side on the marking, median. Intervals: 95 %, by vehicles drawn anew."
        ]
        if self.goal is not None:
            lines.append(
                f"Set on a home: the threshold that gives {self.goal.what} there; a source set on itself has, for each "
                "vehicle, the threshold of other vehicles."
            )
            lines += [f"{missed}." for missed in not_met(self.carriers)]
        hours = {curve.source: float(curve.hours.sum()) for curve in self.curves}
        hours |= {one.home.source: one.home.hours for one in self.carriers}
        if few := [f"{source} ({hours_in_words(time)})" for source, time in hours.items() if time < 1.0]:
            lines.append(
                f"Less than an hour of lane keeping, so that rates are rough, and none is made of less than "
                f"{60.0 * LEAST_HOURS:.0f} min: {', '.join(few)}."
            )
        silent = sorted(self.still)
        if silent:
            lines.append(
                f"{', '.join(silent)}: no vehicle moves inside its lane, so that what watches movement raises no "
                "false alarm by construction: that says nothing about a detector."
            )
        alone = [curve for curve in self.curves if curve.detector.needs_observer and not len(curve.hours)]
        left = sorted({f"{curve.detector.name} on {curve.source}" for curve in alone})
        if left:
            lines.append(f"Needs other vehicles, which are not there: {', '.join(left)}.")
        return lines

    def rows(self, *, every: bool = False) -> list[dict[str, Any]]:
        """A row for each source and detector at the threshold that is set, or at every threshold."""
        return [
            row
            for curve in self.curves
            for row in _rows(curve, range(len(curve.rate)) if every else [curve.detector.chosen])
        ]

    def to_frame(self) -> pd.DataFrame:
        """One row per source, detector and threshold; `is_set` marks the one that is set. [1/h], [s], shares."""
        return pd.DataFrame(self.rows(every=True))

    def worst(self) -> list[tuple[str, str, Case]]:
        """Source, detector and case of the worst ones of all."""
        return worst_of(
            [
                (tally.source, tally.detector.label(), case)
                for tally in self.tallies
                if is_met(tally.detector)
                for case in tally.cases
            ]
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {
            "sources": [{"label": each.label, "files": [path.name for path in each.files]} for each in self.origins],
            "sensor": {"noise": self.sensor.noise, "delay": self.sensor.delay, "rate": self.sensor.rate},
            **({} if self.goal is None else {
                "goal": self.goal.text,
                "homes": [{"label": one.label, "files": [path.name for path in one.files]} for one in self.homes],
            }),
            "rows": plain(self.rows()), "messages": self.message_records(),
            "curves": [
                {
                    "source": curve.source,
                    "detector": curve.detector.label(),
                    "quantity": curve.detector.quantity,
                    "threshold": curve.detector.thresholds.tolist(),
                    "false_alarms_per_hour": plain(curve.rate.tolist()),
                    "seen": plain(curve.seen().tolist()),
                    "seen_before_marking": plain(curve.seen(0.0).tolist()),
                    "median_lead_s": plain(curve.lead(0.5).tolist()),
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

    def _provenance(self) -> dict[str, Any]:
        """Seed and hashes of all inputs."""
        files = [path for source in (*self.origins, *self.homes) for path in source.files if path.is_file()]
        return {"seed": self.seed, "inputs": parsed_hashes(files)}

    def plot(self) -> Figure:
        """Cut-ins seen in time, and the median time before the marking, over false alarms an hour."""
        return curves_figure(self.curves)

    def write_report(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the HTML page: table, curves, and the worst cases in the player."""
        html = partial(
            detection_page,
            lead=[f"{self.headline()}.", *self.legend()],
            table=[dict(zip(self.headings, cells(row), strict=True)) for row in self.rows()],
            curves=[curve for curve in self.curves if is_met(curve.detector)],
            worst=self.worst(),
            provenance=self._provenance(),
        )
        return write_page(path, "detection.html", html, inputs=self.files, force=force)


def count_all(
    tried: Sequence[Detector],
    sources: Sequence[Source],
    at_home: Mapping[str, Sequence[Tally]],
    homes: Sequence[Source],
    settings: SourceSettings,
) -> tuple[list[Tally], frozenset[str]]:
    """What detectors do on each source, by detector, then by home; and sources in which nobody moves inside a lane.

    `at_home`: what those of a home do on it themselves, on vehicles that had no part in their thresholds.
    """
    tallies, still = list[Tally](), set[str]()
    order = ["", *(source.label for source in homes)]
    titles = list(dict.fromkeys(detector.title() for detector in tried))
    with_observers = any(detector.needs_observer for detector in tried)
    for source in sources:
        itself = at_home.get(source.label, ()) if any(map(source.is_same, homes)) else ()
        mine = [Tally(one, source.label) for one in tried if not (itself and one.home_source == source.label)]
        still.add(source.label)
        for scene in checked(source):
            views = settings.views(scene, with_observers=with_observers)
            if any(moves_in_lane(view.track, view.truth) for view in views):
                still.discard(source.label)
            for tally in mine:
                tally.add(scene, views)
        tallies += sorted(
            [*mine, *itself],
            key=lambda tally: (titles.index(tally.detector.title()), order.index(tally.detector.home_source)),
        )
    return tallies, frozenset(still)


def _rows(curve: Curve, numbers: Sequence[int]) -> list[dict[str, Any]]:
    detector, rates, seen = curve.detector, curve.rate_interval(), curve.seen_interval()
    in_time, medians = curve.seen_interval(0.0), curve.lead_interval()
    low, middle, high = (curve.lead(share) for share in (0.05, 0.5, 0.95))
    fixed: dict[str, Any] = {"source": curve.source, "detector": detector.label()}
    if isinstance(detector, Carried):
        home = detector.home
        fixed |= {
            "detector": detector.title(), "home": home.source, "home_met": home.met,
            "home_false_alarms_per_hour": home.rate, "home_seen_before_marking": home.seen,
        }  # fmt: skip
    counts = {"vehicles": len(curve.hours), "hours": float(curve.hours.sum()), "cut_ins": len(curve.leads)}
    rows = []
    for k in numbers:
        is_set = k == detector.chosen
        rows.append({
            **fixed, "threshold": float(detector.thresholds[k]), "is_set": is_set, **counts,
            "false_alarms": int(curve.counts[:, k].sum()),
            "false_alarms_per_hour": float(curve.rate[k]),
            "false_alarms_low": float(rates[0, k]), "false_alarms_high": float(rates[1, k]),
            "seen": float(curve.seen()[k]), "seen_low": float(seen[0, k]), "seen_high": float(seen[1, k]),
            "seen_before_marking": float(curve.seen(0.0)[k]),
            "seen_before_marking_low": float(in_time[0, k]), "seen_before_marking_high": float(in_time[1, k]),
            "lead_median": float(middle[k]), "lead_5": float(low[k]), "lead_95": float(high[k]),
            "lead_median_low": medians[0] if is_set else np.nan,
            "lead_median_high": medians[1] if is_set else np.nan,
        })  # fmt: skip
    if not is_met(detector):  # figures at a threshold that nothing set would say nothing
        rows = [row | dict.fromkeys(FIGURES & row.keys(), np.nan) for row in rows]
    return rows


def is_met(detector: Detector) -> bool:
    """Whether its threshold is its own, or from a home that could set it."""
    return not isinstance(detector, Carried) or detector.home.met


# ---- cells of the table ----
def cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    """Cells of a row, as texts; intervals of 95 %."""
    alarms = _with_interval(row, "false_alarms_per_hour", "false_alarms_low", "false_alarms_high", 1)
    if row["hours"] < LEAST_HOURS and alarms != "-":
        alarms = alarms_in_words(row["false_alarms"], row["hours"], alarms)
    seen = _share(row, "seen", "seen_low", "seen_high")
    in_time = _share(row, "seen_before_marking", "seen_before_marking_low", "seen_before_marking_high")
    lead = _with_interval(row, "lead_median", "lead_median_low", "lead_median_high", 2)
    home = () if "home" not in row else (
        str(row["home"]), f"{row['threshold']:.3g}" if row["home_met"] else "cannot be set here"
    )  # fmt: skip
    return str(row["source"]), str(row["detector"]), *home, alarms, seen, in_time, lead


def _share(row: Mapping[str, Any], name: str, low: str, high: str) -> str:
    """Percent of the cut-ins; none where there are none."""
    if not row["cut_ins"]:
        return "no cut-in"
    percent = {key: 100.0 * row[key] for key in (name, low, high)}
    return _with_interval(percent, name, low, high, 0, " %")


def _with_interval(row: Mapping[str, Any], name: str, low: str, high: str, digits: int, unit: str = "") -> str:
    value, ends = row[name], (row[low], row[high])
    if np.isnan(value):
        return "-"
    between = "" if np.isnan(ends).any() else f" ({ends[0]:.{digits}f} to {ends[1]:.{digits}f})"
    return f"{value:.{digits}f}{unit}{between}"
