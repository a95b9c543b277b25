"""Which share of small changes to our own code the tests of their room notice.

A seeded sample of mutants of the rooms below, one place each: by cosmic-ray's operators, in C by `IN_C`. A mutant is
met by those tests of its room that run through its line, the most particular ones first (all, the quickest first, where
none is seen to: another process runs it, or it is compiled), and is killed by the first that fails. Annotations and
what classes are declared to be are no places. Works in a copy of what is committed; needs cosmic-ray, coverage and
pytest-cov, which `make mutants` installs.

    python -m laboratory.mutants --count 200 --seed 1
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import difflib
import importlib
import os
import random
import re
import shutil
import signal
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

BATCH, FILES, LIVE = "xosc_lateral/workflows/batch", "xosc_lateral/files", "xosc_lateral/extras/live"
ROOMS = {
    "playback": ("xosc_lateral/world/player/**/*.py", "tests/world/player"),
    "paths": ("xosc_lateral/world/motion/*.py", "tests/world/motion"),
    "road": ("xosc_lateral/world/road/*.py", "tests/world/road"),
    "model": ("xosc_lateral/drivers/model/**/*.py", "tests/drivers/model"),
    "fitting": ("xosc_lateral/drivers/fitting/**/*.py", "tests/drivers/fitting"),
    "loop": ("xosc_lateral/extras/loop/**/*.py", "tests/extras/loop"),
    "live": (f"{LIVE}/*.py", "tests/extras/live"),
    "c": (f"{LIVE}/*/[df]*.c", "tests/extras/live/test_c_driver.py tests/extras/live/test_fmu.py"),
    "batch": (f"{BATCH}/*.py", "tests/workflows/batch"),
    "records": (
        f"{BATCH}/[jmv]*.py {FILES}/openscenario/provenance.py {FILES}/atomic.py {FILES}/source.py {FILES}/held.py",
        "tests/workflows/batch tests/files/test_atomic.py tests/files/test_source.py tests/files/test_states.py "
        "tests/files/test_output_paths.py tests/files/test_together.py",
    ),
    "writer": (f"{FILES}/openscenario/write/*.py", "tests/files"),
    "surroundings": ("xosc_lateral/world/surroundings/*.py", "tests/world/surroundings"),
    "conversion": ("xosc_lateral/workflows/conversion/*.py", "tests/workflows/conversion"),
    "detection": ("xosc_lateral/extras/detect/**/*.py", "tests/extras/detect"),
    "recordings": ("xosc_lateral/extras/recordings/**/*.py", "tests/extras/recordings"),
}
"""Files and tests by room."""

IN_C = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==", "&&": "||", "||": "&&",
        "+": "-", "-": "+", "*": "/", "/": "*", "fmin": "fmax", "fmax": "fmin", "1": "2", "0": "1"}  # fmt: skip
TOKEN_IN_C = re.compile(r"(?<= )(?:[<>]=?|[=!]=|&&|[|]{2}|[-+*/])(?= )|(?<![.\w])(?:fmin|fmax|[01](?:[.]0)?)\b(?![.])")

LEFT_OUT = ("Decorator", "_Is", "ExceptionReplacer")
"""Operators whose mutants fail at once, or are the same program as long as Python keeps small numbers."""

SECONDS_AT_MOST = 60.0
"""A mutant that tests of so long together, as measured with coverage, do not notice counts as a survivor. [s]"""

START_TIME, SLOWER = 60.0, 3.0
"""Tests that take longer than this and so many times their usual time hang. [s], [-]"""

QUIETLY = ("-p", "no:cacheprovider", "-p", "no:xdist", "-m", "not lint")

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
    if path.suffix == ".c":
        tokens = ((one, source.count("\n", 0, one.start()) + 1) for one in TOKEN_IN_C.finditer(blank(source)))
        return {(line, one.start()): [(one[0], one.start())] for one, line in tokens}
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


def blank(source: str) -> str:
    """C without what is said in comments, texts and lines of the preprocessor, in the same places."""
    said = re.compile(r'/\*.*?\*/|"(?:\\.|[^"\\])*"|^#(?:[^\n]*\\\n)*[^\n]*', re.DOTALL | re.MULTILINE)
    return said.sub(lambda one: re.sub(r"[^\n]", " ", one[0]), source)


def draw(rng: random.Random, room: str, count: int, tree: Path) -> Iterator[Mutant]:
    """Mutants at different places, each place as likely as any other."""
    files = sorted(path for pattern in ROOMS[room][0].split() for path in tree.glob(pattern))
    sites = [(path, place, ways) for path in files for place, ways in sorted(places(path).items())]
    rng.shuffle(sites)
    drawn = 0
    for path, (line, _), ways in sites:
        name, occurrence = rng.choice(ways)
        code = changed(path, name, occurrence)
        if code is not None:
            drawn += 1
            yield Mutant(room, path, line, name, code)
            if drawn == count:
                return


def changed(path: Path, name: str, occurrence: int) -> str | None:
    """A file's text after an operator; some changes are no Python: a star between parameters is no product."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.operators.provider import OperatorProvider

    source = path.read_text("utf-8")
    if path.suffix == ".c":
        new = IN_C[name.removesuffix(".0")] + (".0" if name.endswith(".0") else "")
        return source[:occurrence] + new + source[occurrence + len(name) :]
    code = mutate_code(source, OperatorProvider()[name](), occurrence)
    try:
        ast.parse(code or "(")
    except SyntaxError:
        return None
    return code


def covering(room: str, tree: Path, out: Path) -> tuple[dict[str, dict[int, list[str]]], dict[str, float]]:
    """Tests by file and line that they run through ("" stands for what is run when a module is imported), the most
    particular ones first, and the seconds that each takes."""
    from coverage import CoverageData

    patterns, tests = ROOMS[room]
    folders = {pattern.partition("*")[0].rpartition("/")[0] for pattern in patterns.split()}
    data, times = out / f"{room}.coverage", out / f"{room}.xml"
    if not times.exists():
        words = ["-q", *tests.split(), *QUIETLY, *(f"--cov={folder}" for folder in sorted(folders))]
        words += ["--cov-context=test", "--cov-report=", f"--junitxml={times}"]
        command = [sys.executable, "-m", "pytest", *words]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tree), *sys.path[1:]])}
        environment |= {"COVERAGE_FILE": str(data)}
        done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True)
        if done.returncode:
            times.unlink(missing_ok=True)
            raise SystemExit(f"the tests themselves fail:\n{done.stdout[-3000:]}\n{done.stderr[-2000:]}")
    seconds: dict[str, float] = defaultdict(float)
    for case in ElementTree.parse(times).iter("testcase"):
        seconds[f"{case.get('classname', '').replace('.', '/')}.py::{case.get('name')}"] += float(case.get("time", 0.0))
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
    return chosen, seconds


def affordable(tests: list[str], seconds: dict[str, float]) -> list[str]:
    """The first of them, as many as a mutant is worth."""
    spent, chosen = 0.0, []
    for test in tests:
        spent += seconds[test]
        if spent <= SECONDS_AT_MOST or not chosen:
            chosen.append(test)
    return chosen


class Begun:
    """Counts tests as they begin."""

    tests = 0

    def pytest_runtest_logstart(self) -> None:
        self.tests += 1


def failing(tests: list[str], tree: Path, limit: float) -> int:
    """The number of the first test that fails, 0 if all pass, in a process of their own that has the libraries loaded
    already; who takes longer than `limit` [s] does not end, which is noticed, too."""
    child = os.fork()
    if child == 0:
        code = 255
        try:
            os.setsid()
            sink = os.open(os.devnull, os.O_RDWR)
            for descriptor in range(3):
                os.dup2(sink, descriptor)
            os.chdir(tree)
            sys.path[:] = [str(tree), *(path for path in sys.path if Path(path or ".").resolve() != ROOT)]
            os.environ["PYTHONPATH"] = os.pathsep.join(sys.path)
            for name in [name for name in sys.modules if name.split(".")[0] in ("laboratory", "xosc_lateral", "tests")]:
                del sys.modules[name]
            begun = Begun()
            failed = pytest.main(["-q", "-x", *QUIETLY, *tests], plugins=[begun]) not in (0, 5)
            code = min(begun.tests or 255, 255) if failed else 0
        finally:
            os._exit(code)
    end = time.monotonic() + limit
    while not (ended := os.waitpid(child, os.WNOHANG))[0] and time.monotonic() < end:
        time.sleep(0.05)
    with contextlib.suppress(ProcessLookupError):  # what it began goes, too
        os.killpg(child, signal.SIGKILL)
    status = ended[1] if ended[0] else os.waitpid(child, 0)[1]
    return os.WEXITSTATUS(status) if os.WIFEXITED(status) else 255


def is_killed(mutant: Mutant, tests: dict[int, list[str]], seconds: dict[str, float], tree: Path) -> bool:
    """Whether a test of the room notices."""
    chosen = [test for test in tests.get(mutant.line, []) if test] or sorted(seconds, key=lambda test: seconds[test])
    chosen = affordable(chosen, seconds)
    before = mutant.path.read_text("utf-8")
    limit = START_TIME + SLOWER * sum(seconds[test] for test in chosen)
    try:
        mutant.path.write_text(mutant.code, "utf-8")
        first = failing(chosen, tree, limit)
    finally:
        mutant.path.write_text(before, "utf-8")
    if first and failing(chosen[:first], tree, limit):
        raise SystemExit(f"the tests of {mutant.path}:{mutant.line} fail by themselves")
    return first > 0


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
