"""`benchmark_realism`: every lateral model of the field on measured drives."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from xosc_lateral.api.inputs import DrivesLike, GivenDrives, PathLike, Paths, ProfileLike, given_drives, given_profile
from xosc_lateral.api.result import Result
from xosc_lateral.formats.output_paths import claim, output_folder

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from xosc_lateral.board.result import Board

FILES = ("board.json", "board.md", "board.html")
"""What is written into the board's folder."""


def benchmark_realism(
    drives: DrivesLike,
    *,
    models: Sequence[str] | None = None,
    profiles: Sequence[ProfileLike] = (),
    seed: int = 0,
    resamples: int = 200,
    classify: bool = True,
    columns: Mapping[str, str] | None = None,
    library: Paths = (),
    progress: Callable[[float, str], None] | None = None,
) -> RealismBoard:
    """Fit every lateral model of the field on half of the drives, score it on the other half, and rank them.

    Parameters
    ----------
    drives, columns
        See `read_drives`.
    models : sequence of str, optional
        Names of `xosc_lateral.baselines.catalogue.MODELS`; without, all.
    profiles : sequence of DriverProfile, path or name
        Scored beside the models, as they are; `library` holds folders with further ones.
    seed : int
        Same inputs and seed: same board.
    resamples : int
        Of the vehicles, for the intervals.
    classify : bool
        Train classifiers too (extra `board`; the slowest part).
    progress : callable, optional
        Told the share that is done, 0 to 1, and what is being done.

    Raises
    ------
    NotEnoughDataError
        Fewer than six vehicles (of one long drive: blocks of two minutes) are left after cutting.
    """
    from xosc_lateral.board import benchmark
    from xosc_lateral.drives.cuts import all_runs

    given = given_drives(drives, columns)
    board = benchmark.benchmark_realism(
        all_runs(given.drives),
        models=models,
        profiles=[given_profile(profile, library) for profile in profiles],
        seed=seed,
        resamples=resamples,
        classify=classify,
        progress=progress,
    )
    return RealismBoard(board, given)


class RealismBoard(Result):
    """Models ranked by how near they come to measured driving, with intervals, floors and sources."""

    __slots__ = ("_board", "_given")

    def __init__(self, board: Board, given: GivenDrives) -> None:
        self._board, self._given = board, given

    def headline(self) -> str:
        """One line."""
        from xosc_lateral.report.board import headline

        return headline(self._board)

    def __str__(self) -> str:
        from xosc_lateral.report.board import board_text

        return board_text(self._board)

    def to_frame(self) -> pd.DataFrame:
        """One row per model and number, with `value`, `floor` and `ratio`."""
        import pandas as pd

        return pd.DataFrame(
            {
                "model": row.key,
                "score": row.score,
                "rank": row.rank,
                "number": number.name,
                "unit": number.unit,
                "value": number.value,
                "floor": number.floor,
                "ratio": number.ratio,
                "ranked": number.ranked,
            }
            for row in self._board.rows
            for number in row.numbers
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""
        from xosc_lateral.report.board_json import board_record

        return board_record(self._board, self._given.inputs)

    def plot(self) -> Figure:
        """The ranking."""
        from xosc_lateral.report.board_figures import ranking_figure

        return ranking_figure(self._board)

    def write(self, folder: PathLike, *, force: bool = False) -> list[Path]:
        """Write board.json, board.md and board.html; nothing is half-written."""
        from xosc_lateral.formats.atomic import write_atomically
        from xosc_lateral.report.board import board_markdown
        from xosc_lateral.report.board_page import board_page

        paths = board_files(folder)
        claim(paths, self._given.files, force=force)
        record = json.dumps(self.to_dict(), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        page = board_page(self._board, self._given.inputs)
        note = f"<!-- made by xosc-lateral, seed {self._board.seed} -->\n"
        for path, text in zip(paths, (record, note + board_markdown(self._board), page), strict=True):
            write_atomically(path, text)
        return paths


def board_files(folder: PathLike) -> list[Path]:
    """Paths of a board's files in a folder."""
    return [output_folder(folder) / name for name in FILES]
