"""What drives are called: a drive is its file, and its own label where the file gives one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from xosc_lateral.base.errors import FormatError

FORMAT_ENDINGS = (".csv.gz", ".csv", ".parquet", ".mf4", ".mdf", ".dat", ".mcap", ".osi", ".xml")
"""Ends of file names that say how a file is written; whatever else has a dot belongs to the name (``2026.11.21``)."""


def file_label(path: Path) -> str:
    """A file's name without the ending that gives its format."""
    ending = next((end for end in FORMAT_ENDINGS if path.name.lower().endswith(end)), "")
    return path.name[: len(path.name) - len(ending)] or path.name


def file_labels(paths: Sequence[Path]) -> list[str]:
    """Different labels for several files: with folders where names are equal, whole where these are.

    Raises `FormatError`: a file is named twice.
    """
    if twice := [path for path in paths if paths.count(path) > 1]:
        raise FormatError("the file is named twice", path=twice[0])
    short = [file_label(path) for path in paths]
    longer = [str(path.parent / label) for path, label in zip(paths, short, strict=True)]
    return [
        label if short.count(label) == 1 else long if longer.count(long) == 1 else str(path)
        for path, label, long in zip(paths, short, longer, strict=True)
    ]


def labels_apart(paths: Sequence[Path], labels: Sequence[Iterable[str]]) -> list[dict[str, str]]:
    """For every file, its drives' own labels and what they are called beside the others': with the file where two
    files have the same."""
    every = [label for own in labels for label in set(own)]
    return [
        {label: label if every.count(label) == 1 else f"{name}:{label}" for label in own}
        for name, own in zip(file_labels(paths), labels, strict=True)
    ]
