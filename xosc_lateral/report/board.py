"""The board of in-lane realism as text, JSON, Markdown and a page with pictures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from xosc_lateral.report.page import KeyFigure, Page
from xosc_lateral.version import __version__

if TYPE_CHECKING:
    from xosc_lateral.board.result import Board, Number, Row
    from xosc_lateral.evaluation.lane_keeping import VarianceParts

FAMILIES = {
    "metrics": "ten metrics",
    "lane_keeping": "lane keeping",
    "spectrum": "spectrum",
    "memory": "memory",
    "auc": "classifier",
}

METHOD = (
    "Every model is fitted on half of the vehicles and scored on the other half, and the other way round. The score is "
    "the geometric mean of five ratios, distance over floor: the ten metrics of windows that start where the real ones "
    "start, and metrics, lane keeping, spectrum and memory of free runs. A floor is the distance of real driving of "
    "other vehicles, with the same start where the model's windows have it and without where they have not. 1 is as "
    "good as other real drivers."
)


def board_text(board: Board) -> str:
    """A table for the terminal."""
    width = max(len(row.title) for row in board.rows)
    lines = [headline(board), f"{'':4}{'model':<{width}}  score  95 % interval  rank"]
    for row in board.rows:
        places = f"{row.best_rank}-{row.worst_rank}" if row.best_rank < row.worst_rank else f"{row.best_rank}"
        span = f"{row.low:6.2f} - {row.high:<6.2f}"
        lines.append(f"{row.rank:>2}  {row.title:<{width}}  {row.score:5.2f}  {span}  {places}")
    lines += [f"not on the board: {key} ({why})" for key, why in board.absent.items()]
    return "\n".join(lines)


def headline(board: Board) -> str:
    """One line."""
    first = board.rows[0]
    return (
        f"{len(board.rows)} models on {board.hours:.2f} h of {board.vehicles} drives: {first.title} first with "
        f"{first.score:.2f} times the floor; rank correlation between the halves {board.tau:.2f}"
    )


def board_record(board: Board, inputs: Mapping[str, str]) -> dict[str, Any]:
    """Plain JSON values: all numbers, floors, intervals, sources."""
    return {
        "made_by": f"xosc-lateral {__version__}",
        "seed": board.seed,
        "inputs": dict(inputs),
        "method": METHOD,
        "data": {
            "drives": board.vehicles,
            "runs": board.runs,
            "hours": round(board.hours, 4),
            "windows": dict(board.windows),
            "unit": board.unit,
            "variance_m2": _variance(board.real_variance),
        },
        "kendall_tau_between_halves": _short(board.tau),
        "resamples": board.resamples,
        "models": [_row_record(row) for row in board.rows],
        "absent": dict(board.absent),
    }


def _row_record(row: Row) -> dict[str, Any]:
    return {
        "name": row.key,
        "title": row.title,
        "source": row.source,
        "departures": row.departures,
        "fitted": {name: _short(value) for name, value in row.settings.items()},
        "rank": row.rank,
        "rank_interval": [row.best_rank, row.worst_rank],
        "score": _short(row.score),
        "score_interval": [_short(row.low), _short(row.high)],
        "score_by_half": [_short(value) for value in row.scores_by_half],
        "variance_m2": _variance(row.variance),
        "numbers": {
            number.name: {
                "value": _short(number.value),
                "floor": _short(number.floor),
                "unit": number.unit,
                "ranked": number.ranked,
            }
            for number in row.numbers
        },
    }


def _variance(parts: VarianceParts) -> dict[str, float | None]:
    return {"between": _short(parts.between), "within": _short(parts.within), "inside": _short(parts.inside)}


def _short(value: float) -> float | None:
    return None if value != value else float(f"{value:.5g}")


def board_markdown(board: Board) -> str:
    """The ranking and the sources, for a document."""
    columns = shown_columns(board)
    lines = [METHOD, "", *_markdown_table(["", "model", "score", "95 %", "ranks", *columns.values()])]
    cells = ([*_head(row), *(_cell(row, name) for name in columns)] for row in board.rows)
    lines += ["| " + " | ".join(line) + " |" for line in cells]
    lines += [
        "",
        f"Floors: {_floors(board, columns)}.",
        f"Kendall's tau between the halves' rankings: {board.tau:.2f}.",
    ]
    lines += [f"Not on the board: {key} ({why})." for key, why in board.absent.items()]
    lines += ["", "| model | fitted | source | departures |", "|---|---|---|---|"]
    for row in board.rows:
        fitted = ", ".join(f"{name} {value:.3g}" for name, value in row.settings.items())
        lines.append(f"| {row.title} | {fitted} | {row.source} | {row.departures} |")
    return "\n".join(lines) + "\n"


def _markdown_table(heads: list[str]) -> list[str]:
    return ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]


def _head(row: Row) -> list[str]:
    places = f"{row.best_rank}-{row.worst_rank}"
    return [str(row.rank), row.title, f"{row.score:.2f}", f"{row.low:.2f}-{row.high:.2f}", places]


def shown_columns(board: Board) -> dict[str, str]:
    """Numbers that the table shows: what is ranked, proper scores and classifiers; name -> heading."""
    found = {}
    for number in board.rows[0].numbers:
        head, _, condition = number.name.partition(", ")
        if number.ranked or head == "auc" or "score" in head:
            unit = "" if number.unit == "-" else f" [{number.unit}]"
            found[number.name] = f"{FAMILIES.get(head, head)}, {condition}{unit}"
    return found


def _cell(row: Row, name: str) -> str:
    number = next((one for one in row.numbers if one.name == name), None)
    return "" if number is None else _value(number)


def _value(number: Number) -> str:
    return f"{number.value:.3f}" if number.value < 10 else f"{number.value:.1f}"


def _floors(board: Board, columns: Mapping[str, str]) -> str:
    return "; ".join(f"{head} {board.rows[0].number(name).floor:.3f}" for name, head in columns.items())


def board_page(board: Board, inputs: Mapping[str, str]) -> Page:
    """The page: ranking, pictures, all numbers, sources."""
    from xosc_lateral.report.board_figures import dynamics_figure, ranking_figure, windows_figure

    first = board.rows[0]
    page = Page("Board of in-lane realism").lead(
        headline(board) + ".",
        [
            KeyFigure(
                f"{first.score:.2f}", first.title, f"95 %: {first.low:.2f} to {first.high:.2f}; 1 is real driving"
            ),
            KeyFigure(f"{board.tau:.2f}", "Kendall's tau", "between the rankings of both halves of the vehicles"),
            KeyFigure(f"{board.hours:.1f} h", f"{board.vehicles} drives", f"{sum(board.windows.values())} windows"),
        ],
    )
    page.section("Ranking", METHOD)
    page.figure(
        ranking_figure(board),
        f"Score with its 95 % interval: the spread of {board.resamples} resamples (unit: {board.unit}) about the "
        "score; strokes: the two halves.",
        "Models in order of their score on a logarithmic axis",
    )
    page.section("What they look like")
    page.figure(
        windows_figure(board), "Ten seconds from the same starts.", "Small multiples of sampled and measured offsets"
    )
    page.figure(dynamics_figure(board), "Free runs: spectrum and memory.", "Power density and autocorrelation")
    columns = shown_columns(board)
    page.section("Numbers")
    rows = [
        {"": row.rank, "model": row.title, "score": round(row.score, 3)}
        | {head: row.number(name).value for name, head in columns.items()}
        for row in board.rows
    ]
    floor = {"": None, "model": "floor: other real drives", "score": 1.0}
    page.table(
        [*rows, floor | {head: first.number(name).floor for name, head in columns.items()}], "Means over the halves"
    )
    parts = [("measured", board.real_variance), *((row.title, row.variance) for row in board.rows)]
    page.table(
        [{"": name, "between": p.between, "within": p.within, "inside": p.inside} for name, p in parts],
        "Variance of the offset between drivers, within drivers between windows of 10 s, and inside windows [m²]",
    )
    page.section("Sources")
    page.table(
        [{"model": row.title, "source": row.source, "departures": row.departures} for row in board.rows],
        "Where each model comes from, and what is not as published",
    )
    if board.absent:
        page.warning("Not on the board: " + "; ".join(f"{key} ({why})" for key, why in board.absent.items()))
    return page.provenance({"seed": board.seed, "inputs": dict(inputs), "resamples": board.resamples})
