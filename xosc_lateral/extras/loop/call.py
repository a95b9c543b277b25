"""`close_loop`: what a profile lacks, found, added and scored held out."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from threadpoolctl import threadpool_limits

from xosc_lateral.base.lazy import pd
from xosc_lateral.base.note import Note
from xosc_lateral.files.atomic import together, write_atomically
from xosc_lateral.files.json_text import canonical_json
from xosc_lateral.files.mapping import MappingLike, as_mapping
from xosc_lateral.files.output_paths import claim, output_folder
from xosc_lateral.workflows.options import declare_options, flag, texts
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
)

if TYPE_CHECKING:
    from xosc_lateral.drivers.model.profile import DriverProfile
    from xosc_lateral.extras.loop.close import LoopResult
    from xosc_lateral.extras.loop.shown import Shown
    from xosc_lateral.files.pages.figure import Figure


@declare_options
def close_loop(
    drives: DrivesLike,
    profile: Annotated[ProfileLike | None, flag("--profile", "-p", kind=str | None, metavar="NAME|PATH",
        help="Profile to start from; default: one is fitted.")] = None,
    *,
    seed: int = 0,
    name: str = "refined",
    leave_out: Annotated[Collection[str], flag(kind=list[str] | None, metavar="COLUMN",
        help="Context column to ignore; may be repeated.")] = (),
    roles: Annotated[Mapping[str, str] | None, flag("--role", kind=list[str] | None, read=texts, metavar="COLUMN=ROLE",
        help="What a column is: road, weather, traffic, time, own, driver or unknown; may be repeated.")] = None,
    columns: MappingLike | None = None,
    library: Paths = (),
    progress: Callable[[float, str], None] | None = None,
) -> ClosedLoop:  # fmt: skip
    """Find what measured drives do and a profile doesn't, trace it to an effect, add it, score it held out.

    Parameters
    ----------
    drives, columns
        See `read_drives`.
    name : str
        Of the refined profile.
    roles : mapping of str to str, optional
        What columns are: column -> road, weather, traffic, time, own, driver or unknown. Road, weather and traffic are
        never dismissed as consequences of the car's movement, own movement and time are never causes. Default: what a
        mapping file says in `[roles]`, then by name and values.
    progress : callable, optional
        Told the share that is done, 0 to 1, and what is being done.

    Raises
    ------
    NotEnoughDataError
        Too little road-following is left after cutting.
    FormatError
        A role that there is not, or of a column that the drives lack.
    """
    from msgspec.structs import replace as with_fields

    from xosc_lateral.drivers.model.profile import Provenance
    from xosc_lateral.extras.loop import close

    base = None if profile is None else given_profile(profile, library)
    inputs = given_drives(drives, columns)
    fitted_on = set() if base is None else set(base.provenance.inputs.values())
    # products of small matrices gain nothing from threads, and lose a factor of ten to them where all cores are busy
    with naming(inputs), threadpool_limits(1, user_api="blas"):
        result = close.close_loop(
            inputs.drives,
            base,
            seed=seed,
            in_sample=bool(fitted_on) and fitted_on <= set(inputs.inputs.values()),
            name=name,
            provenance=Provenance(source=", ".join(inputs.inputs), inputs=dict(inputs.inputs)),
            excluded=list(leave_out),
            roles=_roles_of(inputs, columns, roles),
            progress=progress or (lambda share, what: None),
        )
    if base is not None:
        result = replace(result, refined=with_fields(result.refined, left_hand=base.left_hand))
    return ClosedLoop(result, inputs)


def plan_loop(
    drives: DrivesLike,
    *,
    seed: int = 0,
    leave_out: Collection[str] = (),
    roles: Mapping[str, str] | None = None,
    columns: MappingLike | None = None,
) -> LoopPlan:
    """What drives can show, before any effect is sought: the smallest effects that `close_loop` would find.

    Parameters
    ----------
    drives, columns
        See `read_drives`.
    leave_out, roles
        See `close_loop`.

    Raises
    ------
    NotEnoughDataError
        Too little road-following is left after cutting.
    FormatError
        A role that there is not, or of a column that the drives lack.
    """
    from xosc_lateral.extras.loop import close

    inputs = given_drives(drives, columns)
    known_roles = _roles_of(inputs, columns, roles)
    with naming(inputs), threadpool_limits(1, user_api="blas"):
        shown = close.plan_loop(inputs.drives, seed=seed, excluded=list(leave_out), roles=known_roles)
    return LoopPlan(shown)


def _roles_of(inputs: GivenDrives, columns: MappingLike | None, roles: Mapping[str, str] | None) -> dict[str, str]:
    """Roles by column: those told, else a mapping file's, which serves many tables: of columns there are."""
    there = {"lane_width"}.union(*(drive.context for drive in inputs.drives))
    of_file = {name: role for name, role in as_mapping(columns).roles.items() if name in there}
    return {**of_file, **(roles or {})}


class LoopPlan(Result):
    """What drives can show: for every column, time, step, cycle, regimes and drives, the smallest effect."""

    __slots__ = ("_shown",)

    def __init__(self, shown: Sequence[Shown]) -> None:
        self._shown = tuple(shown)

    def headline(self) -> str:
        """One line."""
        from xosc_lateral.extras.loop.loop_words import shown_words

        return shown_words(self._shown)

    def __str__(self) -> str:
        from xosc_lateral.extras.loop.loop_words import shown_text

        return shown_text(self._shown)

    def to_frame(self) -> pd.DataFrame:
        """One row per look: `what`, `acts`, `tested`, `why`, `smallest`, `bound`, `more_minutes`."""
        return pd.DataFrame(self.to_dict()["shown"])

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""
        from xosc_lateral.extras.loop.loop_report import finite, shown_records

        return {"shown": finite(shown_records(self._shown))}


class ClosedLoop(Result):
    """What was missing, how sure and how big; the refined profile; the error before and after."""

    __slots__ = ("_given", "_proofs", "_result")

    def __init__(self, result: LoopResult, inputs: GivenDrives) -> None:
        self._result, self._given = result, inputs
        self._proofs: tuple[str, ...] | None = None

    @property
    def messages(self) -> tuple[Note, ...]:
        """Rows of the tables that are in no drive."""
        return self._given.messages

    @property
    def profile(self) -> DriverProfile:
        """The refined profile."""
        return self._result.refined

    @property
    def base(self) -> DriverProfile:
        """The profile before."""
        return self._result.base

    @property
    def findings(self) -> tuple[str, ...]:
        """Names of the effects that were found."""
        return tuple(finding.effect for finding in self._result.findings)

    @property
    def proofs(self) -> tuple[str, ...]:
        """For each effect on the mean that was found: a scenario converted with it and without, in words."""
        from xosc_lateral.workflows.conversion.proof import proofs_of

        if self._proofs is None:
            added = [effect for effect in self.profile.effects if effect not in self.base.effects]
            self._proofs = tuple(map(str, proofs_of(self.profile, added)))
        return self._proofs

    @property
    def error_before(self) -> float:
        """On held-out stretches. [m]"""
        return self._result.error_before

    @property
    def error_after(self) -> float:
        """On held-out stretches. [m]"""
        return self._result.error_after

    @property
    def floor(self) -> float:
        """Sampling error of the measured drives: how far random halves of them are from all of them. [m]"""
        return self._result.floor

    def headline(self) -> str:
        """One line."""
        names = ", ".join(self.findings) or "no effect added"
        error = f"error {self.error_before:.4f} -> {self.error_after:.4f} m"
        if (own_errors := self._result.own_errors) is not None:
            error = f"where they act, error {own_errors[0]:.4f} -> {own_errors[1]:.4f} m; over everything {error}"
        return f"{names}; {error} ({self.floor:.4f} m between halves of the drives)"

    def __str__(self) -> str:
        from xosc_lateral.extras.loop.loop_words import loop_text

        return "\n".join([loop_text(self._result), *self.message_lines()])

    def to_frame(self, table: Literal["findings", "shown"] = "findings") -> pd.DataFrame:
        """One row per finding: `effect`, `kind`, `columns`, `lag_s`, `response_s`, `shape`, `size_m`, `p_value`, ...

        Or what these drives can show (`table="shown"`), one row per look, as `plan_loop` has it, with bounds.
        """
        if table == "shown":
            return pd.DataFrame(self.to_dict()["shown"])
        names = ["effect", "kind", "columns", "lag_s", "response_s", "shape", "size_m", "p_value"]
        return pd.DataFrame(self.to_dict()["findings"], columns=[*names, "error_before", "error_after"])

    def to_dict(self) -> dict[str, Any]:
        """`report.json`: plain values, as ``--json`` prints them."""
        from xosc_lateral.extras.loop.loop_report import finite, loop_record

        record: dict[str, Any] = finite(loop_record(self._result, self._given.files))
        record["provenance"]["inputs"] = dict(self._given.inputs)
        return record | {"messages": self.message_records()}

    def plot(self) -> Figure:
        """Residual by context, before and after; of drives without context, spectra."""
        from xosc_lateral.extras.loop.loop_figures import residual_figure, spectrum_figure

        residual = residual_figure(self._result, "mean")
        return residual if residual.panels else spectrum_figure(self._result)

    def write_report(self, folder: PathLike, *, force: bool = False) -> Path:
        """Write `report.html` and `report.json` into a folder."""
        from xosc_lateral.extras.loop.loop_report import loop_page

        output = output_folder(folder)
        claim(self.report_files(output), self._given.files, force=force)
        with together():
            write_atomically(output / "report.json", canonical_json(self.to_dict()) + "\n")
            write_atomically(output / "report.html", loop_page(self._result, self._given.files, self.proofs))
        return output

    @staticmethod
    def report_files(folder: Path) -> tuple[Path, Path]:
        """Files that `write_report` writes."""
        return folder / "report.json", folder / "report.html"
