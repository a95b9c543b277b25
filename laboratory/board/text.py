"""The board of in-lane realism as text and Markdown."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from laboratory.board.result import Board, ModelScore, Row

FAMILIES = {
    "metrics": "ten metrics",
    "lane_keeping": "lane keeping",
    "spectrum": "spectrum",
    "memory": "autocorrelation",
    "auc": "classifier",
}


def board_text(board: Board) -> str:
    """A table for the terminal."""
    width = max(len(row.title) for row in board.rows)
    lines = [headline(board), f"{'':4}{'model':<{width}}  score  95 % interval  rank  group"]
    for row in board.rows:
        places = f"{row.best_rank}-{row.worst_rank}" if row.best_rank < row.worst_rank else f"{row.best_rank}"
        span = f"{row.low:6.2f} - {row.high:<6.2f}"
        lines.append(f"{row.rank:>2}  {row.title:<{width}}  {row.score:5.2f}  {span}  {places:<5} {row.group:>5}")
    lines += [f"not on the board: {key} ({why})" for key, why in board.absent.items()]
    return "\n".join(lines)


def headline(board: Board) -> str:
    """One line."""
    first = board.rows[0]
    return (
        f"{len(board.rows)} models on {board.hours:.2f} h of {board.vehicles} drives: {first.title} first with "
        f"{first.score:.2f} times the floor; rank correlation between the two halves {board.tau:.2f}"
    )


def board_markdown(board: Board) -> str:
    """The ranking and the sources, for a document."""
    columns = shown_columns(board)
    return _rendered(
        "board.md",
        board=board,
        method=method_text(board),
        columns=list(columns.values()),
        ranking=[(row, [_cell(row, name) for name in columns]) for row in board.rows],
        floors=[f"{head} {board.rows[0].number(name).floor:.3f}" for name, head in columns.items()],
        fitted=lambda row: ", ".join(f"{name} {value:.3g}" for name, value in row.settings.items()),
    )


def method_text(board: Board) -> str:
    """How the board is made, in a paragraph."""
    n_ranked = sum(number.ranked for number in board.rows[0].numbers)
    return _rendered("board_method.md", n_ranked=n_ranked).strip()


def _rendered(template: str, **values: Any) -> str:
    from jinja2 import Environment, StrictUndefined

    environment = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    text = (Path(__file__).parent / "pages" / template).read_text(encoding="utf-8")
    return f"{environment.from_string(text).render(**values).rstrip()}\n"


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
    number = known_number(row, name)
    return "" if number is None else _value(number)


def known_number(row: Row, name: str) -> ModelScore | None:
    """A number that the first model has, where this one has it too."""
    return next((one for one in row.numbers if one.name == name), None)


def _value(number: ModelScore) -> str:
    return f"{number.value:.3f}" if number.value < 10 else f"{number.value:.1f}"
