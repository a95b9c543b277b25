"""Which share of small changes to our own code the tests of their room notice.

A seeded sample of mutants by cosmic-ray's operators, one place each, of playback, road, surroundings, model, loop,
OpenSCENARIO's writer, conversion, detection and recordings. A mutant is met by those tests of its room that run through
its line, the most particular ones first, and is killed by the first that fails. Annotations and what classes are
declared to be are no places. Works in a copy of what is committed; needs cosmic-ray, coverage and pytest-cov, which
`make mutants` installs.

    python -m laboratory.mutants --count 200 --seed 1
"""

from __future__ import annotations

import argparse
import ast
import difflib
import importlib
import os
import random
import resource
import shutil
import subprocess
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[1]

ROOMS = {
    "playback": ("xosc_lateral/world/player", "tests/world/player"),
    "road": ("xosc_lateral/world/road", "tests/world/road"),
    "model": ("xosc_lateral/drivers/model", "tests/drivers/model"),
    "loop": ("xosc_lateral/extras/loop", "tests/extras/loop"),
    "writer": ("xosc_lateral/files/openscenario/write", "tests/files"),
    "surroundings": ("xosc_lateral/world/surroundings", "tests/world/surroundings"),
    "conversion": ("xosc_lateral/workflows/conversion", "tests/workflows/conversion"),
    "detection": ("xosc_lateral/extras/detect", "tests/extras/detect"),
    "recordings": ("xosc_lateral/extras/recordings", "tests/extras/recordings"),
}
LEFT_OUT = ("Decorator", "_Is", "ExceptionReplacer")
"""Operators whose mutants fail at once, or are the same program as long as Python keeps small numbers."""

SECONDS_AT_MOST = 60.0
"""A mutant that tests of so long together, as measured with coverage, do not notice counts as a survivor. [s]"""

START_TIME, SLOWER = 60.0, 10.0
"""Tests that compute for longer than this and so many times their usual time hang. [s], [-]"""

QUIETLY = ("-p", "no:cacheprovider", "-p", "no:xdist")

LIBRARIES = ("numpy", "scipy.stats", "scipy.optimize", "pandas", "pyarrow.parquet", "lxml.etree", "msgspec", "numba")
"""What every test's process would load anew."""


class Mutant(NamedTuple):
    """A changed file: room, path, line, operator, and its text."""

    room: str
    path: Path
    line: int
    operator: str
    code: str


def declared(source: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Where annotations and what classes are declared to be (frozen, with slots) begin and end: line from 1, column."""
    parts: list[ast.expr | None] = []
    for node in ast.walk(ast.parse(source)):
        parts += [getattr(node, name, None) for name in ("annotation", "returns")]
        if isinstance(node, ast.ClassDef):
            parts += [*node.decorator_list, *(keyword.value for keyword in node.keywords)]
    return [((part.lineno, part.col_offset), (part.end_lineno or 0, part.end_col_offset or 0))
            for part in parts if part]  # fmt: skip


def places(path: Path) -> dict[tuple[int, int], list[tuple[str, int]]]:
    """Operators, each with the number of its occurrence, by the place that they change."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.operators.provider import OperatorProvider

    source, provider = path.read_text("utf-8"), OperatorProvider()
    tree, spans = get_ast(source), declared(source)
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
    rng.shuffle(sites)
    drawn = 0
    for path, (line, _), ways in sites:
        name, occurrence = rng.choice(ways)
        code = mutate_code(path.read_text("utf-8"), provider[name](), occurrence)
        if code is not None and is_python(code):
            drawn += 1
            yield Mutant(room, path, line, name, code)
            if drawn == count:
                return


def is_python(code: str) -> bool:
    """Some changes are none: a star between parameters is no product."""
    try:
        ast.parse(code)
    except SyntaxError:
        return False
    return True


def covering(room: str, tree: Path, out: Path) -> tuple[dict[str, dict[int, list[str]]], dict[str, float]]:
    """Tests by file and line that they run through ("" stands for what is run when a module is imported), the most
    particular ones first, and the seconds that each takes."""
    from coverage import CoverageData

    package, tests = ROOMS[room]
    data, times = out / f"{room}.coverage", out / f"{room}.xml"
    if not times.exists():
        words = [
            "-q",
            tests,
            *QUIETLY,
            f"--cov={package}",
            "--cov-context=test",
            "--cov-report=",
            f"--junitxml={times}",
        ]
        command = [sys.executable, "-m", "pytest", *words]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tree), *sys.path[1:]])}
        environment |= {"COVERAGE_FILE": str(data)}
        done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True)
        if done.returncode:
            times.unlink(missing_ok=True)
            raise SystemExit(f"the tests themselves fail:\n{done.stdout[-3000:]}\n{done.stderr[-2000:]}")
    seconds: dict[str, float] = defaultdict(float)
    for case in ElementTree.parse(times).iter("testcase"):
        seconds[f"{case.get('classname')}::{case.get('name')}"] += float(case.get("time", 0.0))
    known = CoverageData(str(data))
    known.read()
    by_file = {
        str(Path(name).relative_to(tree)): {
            line: {context.split("|")[0] for context in contexts}
            for line, contexts in known.contexts_by_lineno(name).items()
        }
        for name in sorted(known.measured_files())
    }
    breadth = Counter(test for lines in by_file.values() for tests in lines.values() for test in tests)
    order = {test: number for number, test in enumerate(sorted(breadth, key=lambda test: (breadth[test], test)))}
    chosen = {
        name: {line: sorted(tests, key=order.__getitem__) for line, tests in lines.items()}
        for name, lines in by_file.items()
    }
    return chosen, {test: seconds[test.replace(".py::", "::").replace("/", ".")] for test in breadth}


def affordable(tests: list[str], seconds: dict[str, float]) -> list[str]:
    """The first of them, as many as a mutant is worth."""
    spent, chosen = 0.0, []
    for test in tests:
        spent += seconds[test]
        if spent <= SECONDS_AT_MOST or not chosen:
            chosen.append(test)
    return chosen


def passes(tests: list[str], tree: Path, limit: float) -> bool:
    """Whether tests pass, in a process of their own that has the libraries loaded already; who computes for longer than
    `limit` [s] does not end, which is noticed, too."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit)))
            sink = os.open(os.devnull, os.O_RDWR)
            for descriptor in range(3):
                os.dup2(sink, descriptor)
            os.chdir(tree)
            sys.path[:] = [str(tree), *(path for path in sys.path if Path(path or ".").resolve() != ROOT)]
            os.environ["PYTHONPATH"] = os.pathsep.join(sys.path)
            for name in [name for name in sys.modules if name.split(".")[0] in ("laboratory", "xosc_lateral", "tests")]:
                del sys.modules[name]
            code = int(pytest.main(["-q", "-x", *QUIETLY, *tests]))
        finally:
            os._exit(code)
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status) in (0, 5)


def is_killed(mutant: Mutant, tests: dict[int, list[str]], seconds: dict[str, float], tree: Path) -> bool:
    """Whether a test of the room notices."""
    chosen = affordable([test for test in tests.get(mutant.line, []) if test], seconds)
    if not chosen and "" not in tests.get(mutant.line, []):
        return False
    before = mutant.path.read_text("utf-8")
    limit = START_TIME + SLOWER * sum(seconds[test] for test in chosen)
    try:
        mutant.path.write_text(mutant.code, "utf-8")
        noticed = not passes(chosen or [ROOMS[mutant.room][1]], tree, limit if chosen else 3600.0)
    finally:
        mutant.path.write_text(before, "utf-8")
    if noticed and chosen and not passes(chosen, tree, limit):
        raise SystemExit(f"the tests of {mutant.path}:{mutant.line} fail by themselves")
    return noticed


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
    subprocess.run([sys.executable, "-m", "compileall", "-q", "--invalidation-mode", "checked-hash", "."], cwd=tree)
    for library in LIBRARIES:
        importlib.import_module(library)
    tally: dict[str, list[int]] = {}
    for room in given.rooms:
        tests, seconds = covering(room, tree, given.out.resolve())
        tally[room] = [0, 0]
        for mutant in draw(random.Random(f"{given.seed} {room}"), room, given.count // len(given.rooms), tree):
            begin, path = time.monotonic(), str(mutant.path.relative_to(tree))
            killed = is_killed(mutant, tests.get(path, {}), seconds, tree)
            tally[room][0] += killed
            tally[room][1] += 1
            word = "killed  " if killed else "SURVIVED"
            print(f"{word} {path}:{mutant.line} {mutant.operator} ({time.monotonic() - begin:.0f} s)", flush=True)
            if not killed:
                lines = (text.splitlines() for text in (mutant.path.read_text("utf-8"), mutant.code))
                print("\n".join(line for line in difflib.unified_diff(*lines, lineterm="", n=0)
                                if line[:1] in "+-" and line[:3] not in ("+++", "---")), flush=True)  # fmt: skip
        print(f"{room}: {tally[room][0]} of {tally[room][1]} killed", flush=True)
    killed, tried = (sum(one[k] for one in tally.values()) for k in (0, 1))
    print(f"{killed} of {tried} mutants killed: {100 * killed / max(tried, 1):.0f} %")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
