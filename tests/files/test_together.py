"""Outputs of several files: killed at every step, and with a disk that fills up anywhere, they are there or not."""

from __future__ import annotations

import itertools
import json
import os
import shutil
import signal
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from examples.driver_simulator.simulator import simulate_drive
from tests.kit.esmini_stand_in import StandIn
from tests.kit.recordings import Case, road_file
from xosc_lateral.base.errors import FormatError
from xosc_lateral.cli import main
from xosc_lateral.extras.live import esmini_library
from xosc_lateral.files.atomic import mend, temporary_files, together, write_atomically
from xosc_lateral.files.output_paths import claim, is_own

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")

STEPS = ("open", "os.rename", "os.remove", "os.mkdir", "os.rmdir")
"""Of Python's audit, at which a run may be killed: before a file is opened, moved or removed."""


def content(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def in_child(
    work: Callable[[], object],
    before: Callable[[], object] | None = None,
    largest: int | None = None,
    signalled: tuple[float, int] | None = None,
) -> int:
    """Do it in another process, something else before each step, or where no file is larger [byte], or until it gets a
    signal after so long [s]; its exit code."""
    child = os.fork()
    if child:
        if signalled is not None:
            time.sleep(signalled[0])
            os.kill(child, signalled[1])
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    code, looking = 70, False

    def watch(event: str, values: tuple[object, ...]) -> None:
        nonlocal looking
        written = event != "open" or int(str(values[2])) & (os.O_CREAT | os.O_WRONLY | os.O_RDWR)
        if before is not None and not looking and event in STEPS and written:
            looking = True
            before()
            looking = False

    try:
        sys.stdout = sys.stderr = Path(os.devnull).open("w")  # noqa: SIM115 (for as long as the process)
        sys.addaudithook(watch)
        if largest is not None:
            import resource

            resource.setrlimit(resource.RLIMIT_FSIZE, (largest, resource.RLIM_INFINITY))
        code = int(work() or 0)
    finally:
        os._exit(code)


VERBS = {
    "sample": "sample -p motorway -o {out}/o.csv --duration 20 | 60",
    "template": "template write cut-in -o {out} --set lane_width=3.75 | lane_width=3.5",
    "export": "export c -o {out} --force -p motorway | motorway-vehicle-1",
    "convert": "convert {given}/cut-in.xosc -o {out}/o.xosc --report {out}/r.html --time-limit 3 --seed 1 | 2",
    "reproduce": "reproduce -o {out}/o.xosc {given}/first.xosc | {given}/second.xosc",
    "states": "states {given}/cut-in.xosc -o {out}/o.csv --time-limit 2 | 3",
    "view": "view {given}/cut-in.xosc -o {out}/o.html --image {out}/o.svg --no-open --time-limit 2 | 3",
    "fit": "fit {given}/drive.csv -o {out}/o.json --model two-level --source first | second",
    "evaluate": "evaluate {given}/drive.csv -p motorway --report {out}/o.html --seed 1 | 2",
    "close-loop": "close-loop {given}/drive.csv -p {given}/own.json -o {out}/o.json --report {out} --seed 1 | 2",
    "detect": "detect {given}/cut-in.xosc -o {out}/o.csv --report {out}/o.html --time-limit 12 --seed 1 | 2",
    "import": "import table -o {out}/o.csv {given}/drive.csv | {given}/other.csv",
    "reconstruct": "reconstruct {given}/tracks.csv --road {given}/road.xodr -o {out}/ --force --version 1.2 | 1.1",
    "copy": "profiles export -o {out}/ motorway-vehicle-1 motorway | rural",
    "derive": "profiles derive -o {out}/o.json --mean 0.05 | 0.06",
    "fmu": "export fmu -o {out}/o.fmu --force -p motorway | motorway-vehicle-1",
    "live": "live esmini {given}/cut-in.xosc --player-library {given}/own.json --states {out}/o.csv --step 0.05 "
    "--duration 3 | 4",
    "vary": "vary {given}/cut-in.xosc -o {out}/ --like motorway --force -n 3 --seed 1 | 2",
    "add": "profiles add {given}/own.json --library {out} --force --tag day | night",
}
"""A command whose last word has two values: of a former run, and of the one that is hindered."""


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files that commands read."""
    folder = tmp_path_factory.mktemp("given")
    assert main(["template", "write", "cut-in", "-o", str(folder)]) == 0
    for seed, name in enumerate(("drive", "other"), start=5):
        simulate_drive(300.0, seed).table.to_csv(folder / f"{name}.csv", index=False)
    assert main(["fit", str(folder / "drive.csv"), "-o", str(folder / "own.json"), "--model", "two-level"]) == 0
    for seed, name in enumerate(("first", "second")):
        words = ["convert", str(folder / "cut-in.xosc"), "-o", str(folder / f"{name}.xosc"), "--seed", str(seed)]
        assert main([*words, "--time-limit", "2"]) == 0
    Case(rate=10.0).tracks().to_csv(folder / "tracks.csv", index=False)
    road_file(Case(), folder).rename(folder / "road.xodr")
    return folder


AT_LENGTH = ("evaluate", "close-loop", "derive", "fmu", "live", "vary")
"""Verbs that take seconds a run, or write as others do."""


@pytest.fixture(scope="module", autouse=True)
def a_stand_in_of_esmini() -> Iterator[None]:
    """In place of any library that is named."""
    open_player = esmini_library.open_player
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(esmini_library, "open_player", lambda _, *words, **more: open_player(StandIn(), *words, **more))
        yield


@pytest.fixture(
    scope="module",
    params=[pytest.param(name, marks=[pytest.mark.pages] if name in AT_LENGTH else []) for name in VERBS],
)
def verb(
    request: pytest.FixtureRequest, given: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Callable[[Path], int], dict[str, bytes], dict[str, bytes], Path]:
    """The second command, what it and the first one leave in a folder, and that folder of the first."""
    words, _, other = VERBS[request.param].partition(" | ")

    def first(out: Path) -> int:
        return main([word.format(out=out, given=given) for word in words.split()])

    def second(out: Path) -> int:
        return main([word.format(out=out, given=given) for word in [*words.split()[:-1], other]])

    folder = tmp_path_factory.mktemp("alone")
    old, new = (folder / name / "out" for name in ("old", "new"))
    assert first(old) == 0
    shutil.copytree(old, new)
    assert second(new) == 0
    return second, content(old), content(new), old


@pytest.mark.pages
def test_a_killed_run_leaves_the_old_output_or_the_new_one(
    verb, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What is on the disk before each step that writes is what a kill leaves there."""
    run, old, new, folder = verb
    out, steps = tmp_path / "now" / "out", itertools.count()
    shutil.copytree(folder, out)
    assert in_child(lambda: run(out), lambda: shutil.copytree(out, tmp_path / f"left {next(steps):03}" / "out")) == 0
    assert content(out) == new
    left = sorted(tmp_path.glob("left */out"))
    assert len(left) > 2
    for state in (left.pop(len(left) // 2), left.pop()):
        assert run(state) == 0, capsys.readouterr().err
        assert content(state) == new, state
    for state in left:
        mend([state / name for name in new], is_own)
        assert content(state) in (old, new), state


@pytest.mark.pages
@pytest.mark.parametrize("verb", ["derive", "detect", "fit", "fmu", "live", "reconstruct", "vary"], indirect=True)
def test_a_signal_at_any_time_leaves_the_old_output_or_the_new_one(verb, tmp_path: Path) -> None:
    """After one that a program can answer nothing else is there, either."""
    run, old, new, folder = verb
    begin = time.monotonic()
    assert in_child(lambda: run(shutil.copytree(folder, tmp_path / "whole" / "out"))) == 0
    whole = time.monotonic() - begin
    ended = []
    for number, share in itertools.product((signal.SIGKILL, signal.SIGTERM), (0.2, 0.7)):
        out = shutil.copytree(folder, tmp_path / f"{number} {share}" / "out")
        ended.append(in_child(partial(run, out), signalled=(share * whole, number)))
        assert ended[-1] in (0, -number, 128 + number)
        if ended[-1] < 0:
            mend([out / name for name in new], is_own)
        assert content(out) in ([new] if ended[-1] == 0 else [old, new])
        assert run(out) == 0
        assert content(out) == new
    assert -signal.SIGKILL in ended and {-signal.SIGTERM, 128 + signal.SIGTERM} & {*ended}


@pytest.mark.pages
def test_a_full_disk_leaves_the_old_output_as_it_was(verb, tmp_path: Path) -> None:
    run, old, new, folder = verb
    changed = [len(data) for name, data in new.items() if old.get(name) != data]
    for largest in (40, max(changed) - 1):
        out = tmp_path / str(largest) / "out"
        shutil.copytree(folder, out)
        assert in_child(lambda out=out: run(out), largest=largest) == 1
        assert content(out) == old
    assert run(out) == 0
    assert content(out) == new
    in_child(lambda: run(tmp_path / "fresh"), largest=40)
    assert not (tmp_path / "fresh").exists()


@pytest.mark.parametrize("words", ["rename own night", "tag own --tag night"], ids=["rename", "tag"])
def test_a_profile_of_a_library_is_changed_or_as_it_was(given: Path, tmp_path: Path, words: str) -> None:
    def run(library: Path) -> int:
        return main(["profiles", *words.split(), "--library", str(library)])

    old, steps = tmp_path / "old", itertools.count()
    assert main(["profiles", "add", str(given / "own.json"), "--library", str(old)]) == 0
    out = shutil.copytree(old, tmp_path / "now")
    assert in_child(lambda: run(out), lambda: shutil.copytree(out, tmp_path / f"left {next(steps):03}")) == 0
    new, left = content(out), sorted(tmp_path.glob("left *"))
    assert len(new) == 1 and len(left) > 1 and new != content(old)
    for state in left:
        if (state / "own.json").exists():
            assert run(state) == 0
        else:
            mend([state / "night.json"], is_own)
        assert content(state) == new, state
    full = shutil.copytree(old, tmp_path / "full")
    assert in_child(lambda: run(full), largest=40) == 1
    assert content(full) == content(old)


def test_a_run_at_work_is_not_mended(tmp_path: Path) -> None:
    with together():
        write_atomically(tmp_path / "a.csv", "new")
        claim([tmp_path / "a.csv", tmp_path / "b.csv"])
        write_atomically(tmp_path / "b.csv", "new")
    assert {path.name for path in tmp_path.iterdir()} == {"a.csv", "b.csv"}


def test_what_others_wrote_is_not_taken_for_a_plan(tmp_path: Path) -> None:
    """Nothing but a temporary file beside its output is moved, and only onto that; links stay alone."""
    precious = write_atomically(tmp_path / "precious.csv", "precious")
    (tmp_path / "out").mkdir()
    lure = tmp_path / "out" / ".o.1-00000000.tmp.csv"
    lure.write_text("planted")
    for number, plan in enumerate(
        (
            *('{"../precious.csv": ".o.1-00000000.tmp.csv"}', '{"../precious.csv": "out/x"}', "{", "[1]", '"a"'),
            *('{"../precious.csv": null}', '{".o.1-00000009.tmp.moves": null}'),
        )
    ):
        (tmp_path / "out" / f".o.1-0000000{number}.tmp.moves").write_text(plan)
    (tmp_path / "out" / ".o.1-00000009.tmp.moves").symlink_to(precious)
    mend([tmp_path / "out" / "o.csv"], is_own)
    assert precious.read_text() == "precious"
    assert [path.name for path in (tmp_path / "out").iterdir()] == [".o.1-00000009.tmp.moves"]


def test_a_planted_plan_touches_nothing_but_own_outputs_of_the_command(tmp_path: Path) -> None:
    """Neither a user's file, nor the input, nor an output of another command; one that was ours is written anew."""
    assert main(["template", "write", "cut-in", "-o", str(tmp_path)]) == 0
    (tmp_path / "notes").mkdir()
    users = [tmp_path / name for name in ("thesis.docx", "out.xosc", "notes/n.xosc", "own.xosc")]
    for path in users:
        path.write_text("mine")
        (path.parent / f".{path.stem}.zz-aaaaaaaa.tmp{path.suffix}").write_text("planted")
    names = {os.path.relpath(path, tmp_path): f".{path.stem}.zz-aaaaaaaa.tmp{path.suffix}" for path in users}
    plans = ({**names, "cut-in.xodr": None}, [[[]]], {"out.xosc": 3}, {"out.xosc\0": "x"}, {"out.xosc": "\0"})
    texts = (*map(json.dumps, plans), "[" * 100_000, '{"out.xosc": ' * 50_000)
    for number, text in enumerate(texts):
        (tmp_path / f".out.zz-aaaaaaa{number}.tmp.moves").write_text(text)
    before = {path: path.read_bytes() for path in (*users, tmp_path / "cut-in.xodr", tmp_path / "cut-in.xosc")}
    words = ["convert", str(tmp_path / "cut-in.xosc"), "-o", str(tmp_path / "out.xosc"), "--time-limit", "2"]
    assert main(words) == 1
    assert {path: path.read_bytes() for path in before} == before
    assert main([*words, "--force"]) == 0
    assert b"planted" not in (tmp_path / "out.xosc").read_bytes()
    del before[tmp_path / "out.xosc"]
    assert {path: path.read_bytes() for path in before} == before


def test_of_files_that_fail_together_none_appears(tmp_path: Path) -> None:
    write_atomically(tmp_path / "a.csv", "old")
    with pytest.raises(FormatError), together():
        write_atomically(tmp_path / "a.csv", "new")
        write_atomically(tmp_path / "new" / "b.csv", "new")
        raise FormatError("no")
    assert content(tmp_path) == {"a.csv": b"old"} and not (tmp_path / "new").exists()
    assert not any(temporary_files().fullmatch(path.name) for path in tmp_path.iterdir())
