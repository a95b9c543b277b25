"""What a writer hands back."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from xosc_lateral.scenario.place import Unsupported


@dataclass(frozen=True, slots=True)
class WrittenScenario:
    """What was written.

    Parameters
    ----------
    path : Path
    sha256 : str
        Of the file's bytes.
    content_sha256 : str
        Of the file without its provenance.
    converted : tuple of str
        Entities that move otherwise than in the input.
    removed : tuple of Unsupported
        Controllers and actions that are no longer in the file although they are no motion, with reasons.
    data : bytes
        The file's bytes; empty if they were written.
    notes : tuple of str
        What the version or the player that it was made for lacks, a line each.
    """

    path: Path
    sha256: str
    content_sha256: str
    converted: tuple[str, ...]
    removed: tuple[Unsupported, ...]
    data: bytes
    notes: tuple[str, ...] = ()
