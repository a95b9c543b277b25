"""Inputs from seeds, until time is up; what is wrong, by kind; the smallest input of each kind."""

from __future__ import annotations

import json
import random
import re
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol

Spec = dict[str, Any]
"""An input as plain data, so that it can be kept, and made smaller by leaving out."""
Finding = dict[str, Any]
"""stage, kind, context, who, t [s], size, said (whether a message tells it)."""
Kind = tuple[str, str, bool]


class Machine(Protocol):
    """Makes inputs of one sort and judges what the product makes of them."""

    name: str

    def make(self, draw: random.Random) -> Spec: ...
    def look(self, spec: Spec, only: Finding | None = None) -> list[Finding]: ...
    def smaller(self, spec: Spec) -> Iterator[Spec]: ...
    def size(self, spec: Spec) -> float: ...
    def save(self, spec: Spec, folder: Path) -> None: ...


def spec_of(machine: Machine, seed: int) -> Spec:
    """A seed stands for one input."""
    return machine.make(random.Random(f"{machine.name} {seed}"))


def kind_of(finding: Finding) -> Kind:
    return str(finding["stage"]), str(finding["kind"]), bool(finding.get("said", True))


def shrink(
    machine: Machine, spec: Spec, finding: Finding, tries: int = 40, until: float = float("inf")
) -> tuple[Spec, Finding]:
    """A smaller input with a finding of the same kind; `until`: of the monotonic clock. [s]"""
    progress = True
    while progress:
        progress = False
        for one in machine.smaller(spec):
            if tries <= 0 or time.monotonic() > until:
                return spec, finding
            tries -= 1
            again = [found for found in machine.look(one, finding) if kind_of(found) == kind_of(finding)]
            if again:
                spec, finding, progress = one, max(again, key=lambda found: found["size"]), True
                break
    return spec, finding


def by_kind(machine: Machine, lines: list[dict[str, Any]]) -> dict[Kind, list[tuple[int, Spec, Finding]]]:
    """Findings of each kind, once per seed, those of the smallest inputs first."""
    found = defaultdict(list)
    for line in lines:
        worst: dict[Kind, Finding] = {}
        for one in sorted(line["findings"], key=lambda one: one["size"]):
            worst[kind_of(one)] = one
        for kind, one in worst.items():
            found[kind].append((line["seed"], line["spec"], one))
    return {kind: sorted(rows, key=lambda row: (machine.size(row[1]), row[0])) for kind, rows in found.items()}


def find(
    machine: Machine, out: Path, seconds: float, first: int, *, most: int | None = None, tries: int = 12
) -> list[str]:
    """Rows of the table of kinds; two thirds of the time is for seeds from `first` on, the rest for shrinking."""
    out.mkdir(parents=True, exist_ok=True)
    begun, lines = time.monotonic(), []
    with (out / f"{machine.name}.jsonl").open("w", encoding="utf-8") as file:
        while time.monotonic() - begun < 0.67 * seconds and (most is None or len(lines) < most):
            spec = spec_of(machine, first + len(lines))
            lines.append({"seed": first + len(lines), "spec": spec, "findings": machine.look(spec)})
            file.write(json.dumps(lines[-1], default=float) + "\n")
            file.flush()
    kinds, rows = by_kind(machine, lines), []
    count = len(lines)
    for kind, found in sorted(kinds.items(), key=lambda item: (item[0][2], len(item[1]))):  # silent and rare ones first
        seed, spec, one = found[0]
        spec, one = shrink(machine, spec, one, tries, begun + seconds)
        folder = (
            out / "kinds" / re.sub(r"\W+", "_", "_".join((machine.name, *kind[:2], *["silent"] * (not kind[2]))))[:90]
        )
        folder.mkdir(parents=True, exist_ok=True)
        machine.save(spec, folder)
        kept = json.dumps({"seed": seed, "finding": one, "spec": spec}, indent=1, default=float)
        (folder / "finding.json").write_text(kept, encoding="utf-8")
        rows.append(
            f"| {machine.name} | {kind[0]} | {kind[1]} | {'yes' if kind[2] else '**no**'} | {len(found)} of {count} "
            f"| {max(row[2]['size'] for row in found):.3g} | {one.get('context', '')} | {seed}: "
            f"{one.get('who', '')} {one.get('ego', '')} at {one.get('t', 0.0):.2f} s |"
        )
    return rows or [f"| {machine.name} | | nothing | | 0 of {len(lines)} | | | |"]


HEAD = (
    "| machine | stage | kind | told | inputs | largest | where | smallest: seed |\n|---|---|---|---|---|---|---|---|"
)
