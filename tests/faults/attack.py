"""Mutants against readers: what a reader does with each, within limits of time and memory."""

from __future__ import annotations

import logging
import shutil
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.faults.mutants import Rng, mutate
from tests.faults.reader import NonsenseError, Reader, refusal_of
from xosc_lateral.workflows.batch.workers import JobLimitError, JobLimits, within_limits

LIMITS = JobLimits(timeout=30.0, memory=1000.0)


@dataclass(frozen=True)
class Fault:
    """A mutant that a reader did not take as it should.

    Parameters
    ----------
    reader, file : str
    seed : tuple of int
        Of the generator that made it.
    what : str
        Traceback, limit or nonsense.
    data : bytes
        The mutant.
    """

    reader: str
    file: str
    seed: tuple[int, ...]
    what: str
    data: bytes


@dataclass
class Count:
    """How mutants were taken."""

    refused: int = 0
    accepted: int = 0


def attack(
    reader: Reader, count: int, seed: int, folder: Path, tally: Count, change: Callable[[bytes, Rng], bytes] = mutate
) -> Iterator[Fault]:
    """Try so many mutants of a reader's files; yields the faults."""
    logging.disable(logging.CRITICAL)  # what libraries log about damaged files
    good = folder / "good"
    good.mkdir(parents=True)
    seeds = sorted(Path(path) for path in reader.seeds(good))
    for path in seeds:
        shutil.rmtree(folder / "try", ignore_errors=True)
        shutil.copytree(good, folder / "try")
        refused = refusal_of(reader.use, folder / "try" / path.name)
        if refused:
            raise AssertionError(f"{reader.name}: the good file {path.name} is refused: {refused}")
    for number in range(max(1, round(reader.share * count))):
        path = seeds[number % len(seeds)]
        words = (seed, sum(map(ord, reader.name)), number)
        data = change(path.read_bytes(), np.random.default_rng(words))
        shutil.rmtree(folder / "try")
        shutil.copytree(good, folder / "try")
        target = folder / "try" / path.name
        target.write_bytes(data)
        what = taken(reader, target, tally)
        if what:
            yield Fault(reader.name, path.name, words, what, data)


def taken(reader: Reader, path: Path, tally: Count | None = None) -> str:
    """What is wrong with how a reader takes a file; empty: refused in one line that names it, or used."""
    tally = tally or Count()
    try:
        refusal = within_limits(lambda target: refusal_of(reader.use, target), path, LIMITS)
    except (NonsenseError, JobLimitError) as error:
        return f"{type(error).__name__}: {error}"
    except Exception:
        return traceback.format_exc(limit=-6)
    if not refusal:
        tally.accepted += 1
        return ""
    tally.refused += 1
    if "\n" in refusal:
        return f"more than a line: {refusal!r}"
    family = {other.name for other in path.parent.iterdir()}
    if not any(name in refusal for name in family):
        return f"names no file: {refusal}"
    return ""
