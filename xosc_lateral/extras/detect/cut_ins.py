"""A table of cut-ins: a scenario's lane changes as real drivers take them, set by set, and what detectors say."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.texts import aligned, counted
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.extras.detect.detectors import Detector
from xosc_lateral.extras.detect.observation import View
from xosc_lateral.extras.detect.scoring import Tally, alarms_in_words, cut_ins_of, plain
from xosc_lateral.extras.detect.sources import SourceSettings, converted
from xosc_lateral.extras.detect.tracks import STEP, LaneChange
from xosc_lateral.extras.detect.vary import Variations, vary
from xosc_lateral.files.atomic import write_atomically
from xosc_lateral.files.pages.chart import ENRICHED
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.files.pages.page import Page
from xosc_lateral.files.source import parsed_hashes
from xosc_lateral.workflows.batch.request import Request, concrete, document_kind
from xosc_lateral.workflows.result import PathLike, Result, write_page

FACTS = {"duration": "s", "gap": "m", "entry": "m/s", "end": "m"}
"""Of a cut-in, with units: from begin to end of its movement; free space to who is cut in on when its side is on the
marking; how fast it moves sideways then; how far left of the middle of the new lane it ends."""
CASE = ["set", "vehicle", "duration"]
"""Columns that tell one cut-in from the others."""
SHARES = (0.05, 0.5, 0.95)
DETECTOR_HEADINGS = ("detector", "seen", "before the marking", "time before it [s]", "false alarms")


def cut_ins_like(
    scenario: Path, law: DriverProfile, detectors: Sequence[Detector], settings: SourceSettings, *,
    count: int, replaces: bool = False, part: tuple[int, int] = (1, 1), keep: Path | None = None,
) -> CutIns:  # fmt: skip
    """Vary a scenario's lane changes by a profile's law, convert each set, and run detectors on what is written.

    - `law`: whose maneuvers; it drives the vehicles too
    - `replaces`: lane changes that are shorter than the law's get its durations, too
    - `part`: of the sets, which of how many
    - `keep`: folder for the variations and all that they are converted to

    Raises `NotEnoughDataError`: nobody is cut in on.
    """
    seed, rows, ego = settings.convert.seed, list[dict[str, Any]](), settings.ego
    chosen = None if ego is None else frozenset({ego} - {"none"})
    with TemporaryDirectory() as temporary:
        folder = Path(temporary) if keep is None else keep
        folder.mkdir(parents=True, exist_ok=True)
        allowed = (*settings.convert.allow, scenario.parent)
        made = vary(scenario, f"{folder}/", like=law, count=count, seed=seed, replace=replaces, allow=allowed)
        convert = replace(
            settings.convert, profile=law, ego=chosen, allow=(*allowed, folder), step=STEP
        )  # as it is played
        sets = concrete(Request(made.distribution, convert), document_kind(made.distribution))
        for number, (source, suffix, requested, _) in islice(enumerate(sets), part[0] - 1, None, part[1]):
            conversion, scene = converted(source, requested, number, f"{scenario.stem}{suffix}", ego)
            if keep is not None and conversion.data is not None:
                write_atomically(keep / f"{source.stem}{suffix}_lifelike.xosc", conversion.data)
            views = settings.views(scene)
            tallies = [Tally(detector, scene.name) for detector in detectors]
            for tally in tallies:
                tally.add(scene, views)
            for view in views:
                for change in cut_ins_of(view):
                    facts = {"set": number, "vehicle": view.track.name, **facts_of(view, change)}
                    rows += [facts | _result(tally) for tally in tallies]
    if not rows:
        raise NotEnoughDataError(f"{scenario}: in none of {count} variations anybody cuts in")
    return CutIns(scenario, law.name, seed, made, tuple(rows), keep)


def facts_of(view: View, change: LaneChange) -> dict[str, float]:
    """`FACTS` of a cut-in."""
    track, crossing, end = view.track, change.crossing, min(change.end, len(view.track) - 1)
    before = max(crossing - 2, 0)
    passed = float(track.time[crossing] - track.time[before])
    entry = abs(float(track.lateral[crossing] - track.lateral[before])) / passed if passed else np.nan
    gap = np.nan if view.observer is None else float(view.observer.gap[crossing])
    values = float(track.time[end] - track.time[change.begin]), gap, entry, float(track.lateral[end] - track.base[end])
    return {name: round(value, 4) for name, value in zip(FACTS, values, strict=True)}


def _result(tally: Tally) -> dict[str, Any]:
    """Of a detector on one set."""
    k, detector = tally.detector.chosen, tally.detector
    lead = float(tally.leads[-1][k]) if tally.leads else np.nan
    return {
        "detector": detector.label(), "seen": bool(np.isfinite(lead)), "seen_before_marking": bool(lead > 0.0),
        "lead": round(lead, 4), "false_alarms": int(sum(counts[k] for counts in tally.counts.values())),
        "lane_keeping": round(sum(tally.seconds.values()), 2),
    }  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class CutIns(Result):
    """Cut-ins, set by set, and what detectors made of them."""

    usual_table = "cut-ins.csv"
    scenario: Path
    profile: str
    seed: int
    variations: Variations
    rows: Sequence[Mapping[str, Any]]  # one per cut-in and detector
    kept: Path | None  # where the files are

    def headline(self) -> str:
        """One line."""
        sets = {row["set"] for row in self.rows}
        return f"{len(sets)} cut-ins like {self.profile}, seed {self.seed}: {self.scenario.name}"

    def __str__(self) -> str:
        lines = aligned([("", "5 %", "median", "95 %"), *self._facts()])
        table = aligned([DETECTOR_HEADINGS, *self._detectors()])
        remarks = str(self.variations).splitlines()[1:]
        where = [] if self.kept is None else [f"files: {self.kept}"]
        return "\n".join([self.headline(), *remarks, "", *lines, "", *table, "", *self.legend(), *where])

    def legend(self) -> Sequence[str]:
        """What the numbers are, and what can't be read from them."""
        return [
            "Gap: to who is cut in on, when the side is on the marking; entry: lateral speed then; end: left of the "
            "middle of the new lane. Durations are drawn from lane changes of one motorway at 90 to 130 km/h, few of "
            "them close: what is written shorter is varied about itself."
        ]

    def _facts(self) -> Iterator[tuple[str, ...]]:
        frame = self.cases()
        for name, unit in FACTS.items():
            values = frame[name].dropna().to_numpy()
            if len(values):
                yield f"{name} [{unit}]", *(f"{value:.2f}" for value in np.quantile(values, SHARES))

    def _detectors(self) -> Iterator[tuple[str, ...]]:
        for detector, rows in self.to_frame().groupby("detector", sort=False):
            leads = rows["lead"].dropna().to_numpy()
            low, middle, high = np.quantile(leads, SHARES) if len(leads) else [np.nan] * 3
            hours = float(rows["lane_keeping"].sum()) / 3600.0
            count = int(rows["false_alarms"].sum())
            alarms = alarms_in_words(count, hours, f"{count / hours:.1f}") if hours else "-"
            lead = f"{middle:.2f} ({low:.2f} to {high:.2f})" if len(leads) else "-"
            yield str(detector), f"{rows['seen'].mean():.0%}", f"{rows['seen_before_marking'].mean():.0%}", lead, alarms

    def _finding(self) -> str:
        """Who sees most of the cut-ins before the marking and who fewest, in a sentence."""
        early = (
            self.to_frame()
            .assign(lead=lambda rows: rows["lead"].where(rows["seen_before_marking"]))
            .groupby("detector", sort=False)
        )
        seen = early["lead"].count().sort_values(ascending=False, kind="stable")
        best, worst, count = str(seen.index[0]), str(seen.index[-1]), len(self.cases())
        lead = f", {early['lead'].median()[best]:.2f} s before it in the median" if seen[best] else ""
        alarms = counted(int(early["false_alarms"].sum()[best]), "false alarm")
        others = f"; {worst} sees {seen[worst]}" if worst != best else ""
        return f"{best} sees {seen[best]} of {count} cut-ins before the marking{lead}, with {alarms}{others}."

    def _case_by_case(self) -> Iterator[dict[str, Any]]:
        """Rows of the page: a cut-in with its figures, and when each detector sees it."""
        names = {row["detector"]: row["detector"].partition(" (")[0] for row in self.rows}
        if len({*names.values()}) < len(names):  # two of one name, with other settings
            names = {label: label for label in names}
        for (number, vehicle, _), rows in self.to_frame().groupby(CASE, sort=False):
            facts = {"set": number, "vehicle": vehicle, "false alarms": int(rows["false_alarms"].sum())}
            facts |= {f"{name} [{unit}]": rows[name].iloc[0] for name, unit in FACTS.items()}
            yield facts | dict(zip(rows["detector"].map(names), rows["lead"], strict=True))

    def cases(self) -> pd.DataFrame:
        """One row per cut-in, whatever detectors made of it."""
        return self.to_frame().drop_duplicates(CASE)

    def to_frame(self) -> pd.DataFrame:
        """One row per cut-in and detector: set, vehicle, `FACTS`, seen, lead [s], false alarms, lane keeping [s]."""
        return pd.DataFrame(list(self.rows))

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {"scenario": str(self.scenario), "profile": self.profile, "variations": self.variations.to_dict(),
                "rows": plain(list(self.rows)), "provenance": self._provenance()}  # fmt: skip

    @property
    def files(self) -> tuple[Path, ...]:
        """That were read."""
        return (self.scenario,)

    def _provenance(self) -> dict[str, Any]:
        """Seed and hashes of all inputs."""
        return {"seed": self.seed, "profile": self.profile, "inputs": parsed_hashes(self.files)}

    def plot(self) -> Figure:
        """How each figure is spread over the sets."""
        frame = self.cases()
        figure = Figure(1, len(FACTS), height=120.0)
        for panel, (name, unit) in zip(figure.row(0), FACTS.items(), strict=True):
            values = np.sort(frame[name].dropna().to_numpy())
            panel.line(values, 100.0 * np.arange(1, len(values) + 1) / max(len(values), 1), ENRICHED)
            panel.x.label, panel.y.label, panel.y.limits = f"{name} [{unit}]", "cut-ins up to it [%]", (0.0, 105.0)
        return figure

    def write_report(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the HTML page: the table, and the spread of each figure."""
        return write_page(path, "cut-ins.html", self._page, inputs=[self.scenario], force=force)

    def _page(self) -> str:
        page = Page("Cut-ins as drivers take them")
        page.lead(self._finding())
        page.section("Spread")
        page.figure(self.plot(), "How many cut-ins have at most such a value")
        page.text(f"{self.headline()}.", *str(self.variations).splitlines()[1:], *self.legend())
        page.section("Detectors")
        page.table([dict(zip(DETECTOR_HEADINGS, one, strict=True)) for one in self._detectors()], "Over all sets")
        page.section("Cut-ins")
        page.table(
            list(self._case_by_case()),
            "How long before the side is on the marking each detector sees the cut-in [s], set by set; –: never",
        )
        return page.html(self._provenance())
