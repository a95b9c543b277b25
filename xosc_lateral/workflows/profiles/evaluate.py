"""`evaluate`: how true a profile is to measured drives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from xosc_lateral.base.lazy import pd
from xosc_lateral.base.note import Note
from xosc_lateral.workflows.options import PROFILE, declare_options, flag
from xosc_lateral.workflows.result import (
    DrivesLike,
    GivenDrives,
    PathLike,
    Paths,
    ProfileLike,
    Result,
    given_drives,
    given_profile,
    naming,
    write_page,
)

if TYPE_CHECKING:
    from xosc_lateral.drivers.drives.drive import Drive, Run
    from xosc_lateral.drivers.evaluation.realism import Realism
    from xosc_lateral.drivers.evaluation.scores import ProfileScores
    from xosc_lateral.drivers.model.profile import DriverProfile
    from xosc_lateral.files.mapping import MappingLike
    from xosc_lateral.files.pages.figure import Figure


@declare_options
def evaluate(
    profile: Annotated[ProfileLike, PROFILE],
    drives: DrivesLike,
    *,
    seed: int = 0,
    classify: Annotated[
        bool, flag("--classify/--no-classify", help="Also train classifiers (extra `classifier`).")
    ] = True,
    columns: MappingLike | None = None,
    library: Paths = (),
) -> Evaluation:
    """Score a profile beside other real drivers, and by the paper's four evaluations.

    Raises `NotEnoughDataError`: Too little is left after cutting to compare.

    Parameters
    ----------
    profile : DriverProfile, path or name
    drives, columns
        See `read_drives`.
    classify : bool
        Train classifiers to separate sampled and measured (extra `classifier`; a minute or two for some hours).
    """
    from xosc_lateral.drivers.drives.drive import all_runs
    from xosc_lateral.drivers.evaluation.scores import score_profile

    driver = given_profile(profile, library)
    tables = given_drives(drives, columns)
    with naming(tables):
        runs = all_runs(tables.drives)
        scores = score_profile(_seen_with(driver, runs, tables.drives), runs, seed=seed, classify=classify)
    return Evaluation(scores, driver, tables)


def _seen_with(driver: DriverProfile, runs: Sequence[Run], drives: Sequence[Drive]) -> DriverProfile:
    """The profile with the sensor of a recording, as far as it is known; the paper's model knows recordings alone."""
    from msgspec.structs import replace

    from xosc_lateral.drivers.fitting.fitting import driver_runs
    from xosc_lateral.drivers.model.core.base import ModelKind

    if driver.model.kind == ModelKind.TWO_LEVEL:
        return driver
    _, sensor = driver_runs(runs, drives)
    return driver if sensor is None else replace(driver, sensor=sensor)


@dataclass(frozen=True, eq=False, repr=False)
class Evaluation(Result):
    """Scores of a profile on measured drives."""

    _scores: ProfileScores
    profile: DriverProfile
    _tables: GivenDrives

    @property
    def ratio(self) -> float:
        """Mean distance of the ten metrics over that between real drivers; 1: as close as these. [-]"""
        return self._scores.snippets.ratio

    @property
    def realism(self) -> Realism:
        """The fair measure: every condition's distances, those between real drivers (`floor`), and classifiers."""
        return self._scores.realism

    @property
    def worst(self) -> tuple[str, float]:
        """The block that does worst, and its ratio to real drivers; see `to_frame`. [-]"""
        from xosc_lateral.workflows.profiles.evaluation_page import worst_block

        return worst_block(self._scores)

    @property
    def messages(self) -> tuple[Note, ...]:
        """Rows of the tables that are in no drive."""
        return self._tables.messages

    def headline(self) -> str:
        """One line."""
        hours = f"{self._scores.hours:.2f} h of {self._scores.drives} drives"
        return f"{self.profile.name} on {hours}: " + ", ".join(
            f"{of} {self.judged(of)}" for of in ("driver", "recording")
        )

    def judged(self, of: str) -> str:
        """The "driver", or the "recording", his sensor's error on both sides: "alike", "unlike" or "not known"."""
        from xosc_lateral.workflows.profiles.evaluation_page import judged

        return judged(self._scores, of)

    def __str__(self) -> str:
        from xosc_lateral.workflows.profiles.evaluation_page import evaluation_text

        text = evaluation_text(self._scores, self.profile, self._tables.inputs)
        return "\n".join([text, *self.message_lines()])

    def to_frame(self) -> pd.DataFrame:
        """One row per metric and snippet length: `seconds`, `metric`, `distance`, `floor`, `ratio`."""
        rows = [
            {"seconds": one.seconds, "metric": name, "distance": distance, "floor": one.floor.by_metric[name]}
            for one in (self._scores.snippets, self._scores.long_snippets)
            if one is not None
            for name, distance in one.distances.by_metric.items()
        ]
        frame = pd.DataFrame(rows)
        return frame.assign(ratio=frame["distance"] / frame["floor"])

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""
        from xosc_lateral.workflows.profiles.evaluation_page import evaluation_record

        record = evaluation_record(self._scores, self.profile, self._tables.inputs)
        return record | {"messages": self.message_records()}

    def plot(self) -> Figure:
        """Violins of the ten metrics, measured beside sampled."""
        from xosc_lateral.workflows.profiles.violins import violin_figure

        shown = self._scores.evaluations[3]
        return violin_figure(shown.real, shown.artificial)

    def write_report(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the HTML page."""
        from xosc_lateral.workflows.profiles.evaluation_page import evaluation_page

        name, tables = f"{self.profile.name}_evaluation.html", self._tables
        made = partial(evaluation_page, self._scores, self.profile, tables.inputs)
        return write_page(path, name, made, inputs=tables.files, force=force)
