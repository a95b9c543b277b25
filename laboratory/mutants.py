"""Which share of small changes to our own code the tests of their room notice.

A seeded sample of mutants by cosmic-ray's operators, one place each, of playback, road, model, loop and OpenSCENARIO's
writer. A mutant is met by those tests of its room that run through its line, the most particular ones first, and is
killed by the first that fails. Annotations are no places: nobody evaluates them. Works in a copy of what
is committed; needs cosmic-ray, coverage and pytest-cov, which `make mutants` installs.

    python -m laboratory.mutants --count 200 --seed 1
"""

from __future__ import annotations

import argparse
import ast
import difflib
import os
import random
import shutil
import subprocess
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]

ROOMS = {
    "playback": ("xosc_lateral/world/player", "tests/world/player"),
    "road": ("xosc_lateral/world/road", "tests/world/road"),
    "model": ("xosc_lateral/drivers/model", "tests/drivers/model"),
    "loop": ("xosc_lateral/drivers/loop", "tests/drivers/loop"),
    "writer": ("xosc_lateral/files/openscenario/write", "tests/files"),
}
LEFT_OUT = ("Decorator", "_Is", "ExceptionReplacer")
"""Operators whose mutants fail at once, or are the same program as long as Python keeps small numbers."""

TESTS_AT_MOST = 40
"""A mutant that so many tests do not notice counts as a survivor. [-]"""

HANG = 240.0
"""Tests of one mutant that take longer hang, or the machine is busy: they count neither way. [s]"""


class Mutant(NamedTuple):
    """A changed file: room, path, line, operator, and its text."""

    room: str
    path: Path
    line: int
    operator: str
    code: str


def annotated(source: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Where annotations begin and end: line from 1, column."""
    found: list[ast.expr | None] = []
    for node in ast.walk(ast.parse(source)):
        found += [getattr(node, name, None) for name in ("annotation", "returns")]
    return [((one.lineno, one.col_offset), (one.end_lineno or 0, one.end_col_offset or 0)) for one in found if one]


def places(path: Path) -> dict[tuple[int, int], list[tuple[str, int]]]:
    """Operators, each with the number of its occurrence, by the place that they change."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.operators.provider import OperatorProvider

    source, provider = path.read_text("utf-8"), OperatorProvider()
    tree, spans = get_ast(source), annotated(source)
    found: dict[tuple[int, int], list[tuple[str, int]]] = defaultdict(list)
    for name in sorted(provider):
        if any(word in name for word in LEFT_OUT) or provider[name].arguments():
            continue
        positions = (span for node in ast_nodes(tree) for span in provider[name]().mutation_positions(node))
        for occurrence, (start, _) in enumerate(positions):
            if not any(first <= start < last for first, last in spans):
                found[start].append((name, occurrence))
    return found


def draw(rng: random.Random, room: str, count: int, tree: Path) -> Iterator[Mutant]:
    """Mutants at different places, each place as likely as any other."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.operators.provider import OperatorProvider

    provider = OperatorProvider()
    files = sorted((tree / ROOMS[room][0]).rglob("*.py"))
    sites = [(path, place, ways) for path in files for place, ways in sorted(places(path).items())]
    for path, (line, _), ways in rng.sample(sites, min(count, len(sites))):
        name, occurrence = rng.choice(ways)
        code = mutate_code(path.read_text("utf-8"), provider[name](), occurrence)
        if code is not None:
            yield Mutant(room, path, line, name, code)


def covering(room: str, tree: Path, out: Path) -> dict[str, dict[int, list[str]]]:
    """Tests by file and line that they run through; "" stands for what is run when a module is imported."""
    from coverage import CoverageData

    package, tests = ROOMS[room]
    data = out / f"{room}.coverage"
    if not data.exists():
        words = ["-q", tests, "-p", "no:cacheprovider", f"--cov={package}", "--cov-context=test", "--cov-report="]
        run_tests(words, tree, 3600.0, {"COVERAGE_FILE": str(data)}, check=True)
    known = CoverageData(str(data))
    known.read()
    by_file = {
        str(Path(name).relative_to(tree)): known.contexts_by_lineno(name) for name in sorted(known.measured_files())
    }
    breadth = Counter(test for lines in by_file.values() for tests in lines.values() for test in tests)
    return {
        name: {line: sorted({test.split("|")[0] for test in tests}, key=lambda test: min(
            (breadth[f"{test}|{phase}"] for phase in ("run", "setup")), default=0)) for line, tests in lines.items()}
        for name, lines in by_file.items()
    }  # fmt: skip


def run_tests(words: list[str], tree: Path, limit: float, more: dict[str, str], *, check: bool = False) -> bool | None:
    """Whether the tests pass; None for a hang."""
    environment = (
        os.environ | {"PYTHONPATH": os.pathsep.join([str(tree), *sys.path[1:]]), "OMP_NUM_THREADS": "1"} | more
    )
    command = [sys.executable, "-B", "-m", "pytest", *words]
    try:
        done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, timeout=limit)
    except subprocess.TimeoutExpired:
        return None
    if check and done.returncode:
        raise SystemExit(f"the tests themselves fail:\n{done.stdout[-3000:]}\n{done.stderr[-2000:]}")
    return done.returncode in (0, 5)


def is_killed(mutant: Mutant, tests: dict[int, list[str]], tree: Path) -> bool | None:
    """Whether a test of the room notices; None: it hangs."""
    chosen = [test for test in tests.get(mutant.line, []) if test][:TESTS_AT_MOST]
    if not chosen and "" not in tests.get(mutant.line, []):
        return False
    before = mutant.path.read_text("utf-8")
    listed = tree / "tests.txt"
    listed.write_text("\n".join(chosen or [ROOMS[mutant.room][1]]) + "\n")
    try:
        mutant.path.write_text(mutant.code, "utf-8")
        passed = run_tests(["-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", f"@{listed}"], tree, HANG, {})
        return None if passed is None else not passed
    finally:
        mutant.path.write_text(before, "utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rooms", nargs="*", default=list(ROOMS))
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "mutants")
    given = parser.parse_args()
    tree = given.out.resolve() / "tree"
    shutil.rmtree(tree, ignore_errors=True)
    tree.mkdir(parents=True)
    packed = subprocess.run(["git", "archive", "HEAD"], cwd=ROOT, capture_output=True, check=True).stdout
    subprocess.run(["tar", "x"], cwd=tree, input=packed, check=True)
    shared, here = ROOT.parent / "shared", given.out.resolve() / "shared"
    if shared.exists() and not here.exists():
        here.symlink_to(shared)  # material that some tests need
    tally: dict[str, list[Any]] = {}
    for number, room in enumerate(given.rooms):
        count = given.count // len(given.rooms)
        tests = covering(room, tree, given.out.resolve())
        tally[room] = [0, 0]
        for mutant in draw(random.Random(given.seed + number), room, count, tree):
            begin, path = time.monotonic(), str(mutant.path.relative_to(tree))
            killed = is_killed(mutant, tests.get(path, {}), tree)
            tally[room][0] += killed is True
            tally[room][1] += killed is not None
            word = "HUNG    " if killed is None else "killed  " if killed else "SURVIVED"
            print(f"{word} {path}:{mutant.line} {mutant.operator} ({time.monotonic() - begin:.0f} s)", flush=True)
            if killed is False:
                lines = (text.splitlines() for text in (mutant.path.read_text("utf-8"), mutant.code))
                print("\n".join(line for line in difflib.unified_diff(*lines, lineterm="", n=0)
                                if line[:1] in "+-" and line[:3] not in ("+++", "---")), flush=True)  # fmt: skip
        print(f"{room}: {tally[room][0]} of {tally[room][1]} killed", flush=True)
    killed, tried = (sum(one[k] for one in tally.values()) for k in (0, 1))
    print(f"{killed} of {tried} mutants killed: {100 * killed / max(tried, 1):.0f} %")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
