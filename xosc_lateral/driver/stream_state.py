"""The state of an offset stream as plain values."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from xosc_lateral.driver.effects.response import ResponseState
from xosc_lateral.driver.records import Record
from xosc_lateral.errors import DriverProfileError

FORMAT = "xosc-lateral offset stream"

VERSION = 2
"""Of the state's format."""


class SeedState(Record, frozen=True):
    """A seed sequence."""

    entropy: int | Sequence[int] | None
    spawn_key: tuple[int, ...]


class ResponseStreamState(Record, frozen=True):
    """The response to one effect's columns: where it is, rows that are ready, and how many of these are dropped."""

    response: ResponseState
    ready: tuple[tuple[float, ...], ...]
    drop: int


class StreamState(Record, frozen=True, kw_only=True):
    """Where an `OffsetStream` is.

    Parameters
    ----------
    profile : str
        Hash of what its offsets depend on.
    seed : SeedState
    factor : int
        Steps per model step.
    start : float, optional
        [m]
    time : float
        [s]
    known : tuple of str, optional
        Context columns that count; None before the first context.
    widths : tuple of float
        Lane widths of rows ahead. [m]
    recalled, looked, row, phase : int
        Rows before the drive, steps looked ahead, next model step, step within it.
    samples, curve : tuple of float
        Model samples about the present piece, and its coefficients. [m]
    responses : tuple of ResponseStreamState
        Of the effects whose columns are known.
    process : DriveState as plain values
    """

    profile: str
    seed: SeedState
    factor: int
    start: float | None
    time: float
    known: tuple[str, ...] | None
    widths: tuple[float, ...]
    recalled: int
    looked: int
    row: int
    phase: int
    samples: tuple[float, ...]
    curve: tuple[float, ...]
    responses: tuple[ResponseStreamState, ...] = msgspec.field(name="answers")
    process: Any


def sealed(values: Mapping[str, Any]) -> dict[str, Any]:
    """A state's plain values with format, version and the hash of all of it."""
    state = {"format": FORMAT, "version": VERSION, **values}
    return {**state, "sha256": _hash(state)}


def _hash(state: Mapping[str, Any]) -> str:
    """SHA-256 of a state, whatever the order and the layout of its JSON."""
    return hashlib.sha256(json.dumps(state, sort_keys=True).encode()).hexdigest()


def unsealed(state: Mapping[str, Any]) -> dict[str, Any]:
    """A state's values without format and version.

    Raises `DriverProfileError` if it is no state of a stream, of another version, or not what was written: nobody edits
    a generator's state.
    """
    if not isinstance(state, Mapping) or state.get("format") != FORMAT:
        raise DriverProfileError(f'not a state of an offset stream: "format" is not "{FORMAT}"')
    if state.get("version") != VERSION:
        raise DriverProfileError(
            f"a state written by another version of xosc-lateral (format {state.get('version')!r}; this one reads "
            f"{VERSION})"
        )
    written = {name: value for name, value in state.items() if name != "sha256"}
    if state.get("sha256") != _hash(written):
        raise DriverProfileError("the state of an offset stream is damaged: its sha256 is another")
    return {name: value for name, value in written.items() if name not in ("format", "version")}
