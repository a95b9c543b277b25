"""`verify` and `reproduce`: whether outputs still are what would be made, and made again."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pd
from xosc_lateral.files.output_paths import claim, output_file, output_folder
from xosc_lateral.workflows.batch import verify as checks
from xosc_lateral.workflows.conversion.settings import ConvertSettings
from xosc_lateral.workflows.result import PathLike, Paths, Result, as_paths


class Verification(Result):
    """Outputs, and what is wrong with which."""

    __slots__ = ("_done", "checked")

    def __init__(self, checked: Sequence[checks.Checked], done: str) -> None:
        self.checked, self._done = tuple(checked), done

    @property
    def failing(self) -> tuple[checks.Checked, ...]:
        """Outputs with a problem."""
        return tuple(one for one in self.checked if one.problems)

    def headline(self) -> str:
        """One line."""
        return f"{len(self.checked) - len(self.failing)} of {len(self.checked)} {self._done}"

    def __str__(self) -> str:
        lines = [f"{one.output}: {kind}: {what}" for one in self.failing for kind, what in one.problems]
        return "\n".join([*lines, self.headline()])

    def to_frame(self) -> pd.DataFrame:
        """One row per output: `output`, `problem` (the first one's kind; empty: none), `what`."""
        first = [one.problems[0] if one.problems else ("", "") for one in self.checked]
        rows = [
            {"output": str(one.output), "problem": str(kind), "what": what}
            for one, (kind, what) in zip(self.checked, first, strict=True)
        ]
        return pd.DataFrame(rows, columns=["output", "problem", "what"])

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them: of outputs, those with a problem."""
        outputs = [
            {"output": str(one.output), "problems": [{"kind": str(kind), "what": what} for kind, what in one.problems]}
            for one in self.failing
        ]
        return {"checked": len(self.checked), "failing": len(outputs), "outputs": outputs}


def verify(
    outputs: Paths,
    *,
    library: Paths = (),
    allow: Paths = (),
    road_path: Paths = (),
    fast: bool = False,
    workers: int = 0,
) -> Verification:
    """Whether outputs are what their provenance says, and what today's inputs and program would give.

    Each is made again in memory from what it states, within the limits of a batch, and compared byte for byte.

    Parameters
    ----------
    outputs : path or paths
        Converted scenarios, and folders with a manifest.
    library, allow, road_path : path or paths
        As for `convert`: where files are looked for is in no output.
    fast : bool
        Nothing is converted: only the hashes of content, inputs and profiles that an output states itself, and the
        behaviour version, are compared.
    workers : int
        Processes; -1: one per core; 0: this one.

    Raises
    ------
    FormatError
        There is no such file, or a folder has no manifest.
    """
    search = ConvertSettings(library=as_paths(library), allow=as_paths(allow), road_path=as_paths(road_path))
    done = "outputs have the hashes that they state; none was made again" if fast else "outputs are what is made today"
    return Verification(list(checks.verify(as_paths(outputs), search, fast=fast, workers=workers)), done)


def reproduce(
    output: PathLike,
    new: PathLike,
    *,
    library: Paths = (),
    allow: Paths = (),
    road_path: Paths = (),
    workers: int = 1,
    force: bool = False,
) -> Verification:
    """Make an output again from what it carries, or all outputs of a folder with a manifest, and compare the content.

    Parameters
    ----------
    output, new : path
        The output, or the folder; and where to write to.
    library, allow, road_path : path or paths
        As for `convert`: where files are looked for is in no output.
    workers : int
        Processes, for a folder.
    force : bool
        Replace files that this package did not write.

    Raises
    ------
    FormatError
        The output carries no provenance.
    XoscLateralError
        What it was made from can't be converted any more.
    """
    old = Path(output)
    if not old.exists():
        raise FormatError("no such file or folder", path=old)
    search = ConvertSettings(library=as_paths(library), allow=as_paths(allow), road_path=as_paths(road_path))
    target = output_folder(new) if old.is_dir() else output_file(new, old.name, (".xosc",))
    if target.resolve() == old.resolve():
        raise FormatError("is what is to be made again: choose another output", path=target)
    if not old.is_dir():
        claim([target], [old], force=force)
    return Verification(list(checks.reproduce(old, target, search, workers=workers)), "outputs came out the same again")
