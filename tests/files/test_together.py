"""Outputs of several files: killed at every step, and with a disk that fills up anywhere, they are there or not."""

from __future__ import annotations

import itertools
import os
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from xosc_lateral.base.errors import FormatError
from xosc_lateral.cli import main
from xosc_lateral.files.atomic import mend, temporary_files, together, write_atomically
from xosc_lateral.files.output_paths import claim

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")

STEPS = ("open", "os.rename", "os.remove", "os.mkdir", "os.rmdir")
"""Of Python's audit, at which a run may be killed: before a file is opened, moved or removed."""


def content(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def in_child(work: Callable[[], object], *, kill_at: int | None = None, largest: int | None = None) -> int:
    """Do it in another process, killed before its nth step, or where no file can be larger [byte]; its wait status."""
    child = os.fork()
    if child:
        return os.waitpid(child, 0)[1]
    code = 70
    try:
        steps = itertools.count()

        def watch(event: str, values: tuple[object, ...]) -> None:
            written = event != "open" or int(str(values[2])) & (os.O_CREAT | os.O_WRONLY | os.O_RDWR)
            if event in STEPS and written and kill_at is not None and next(steps) == kill_at:
                os.kill(os.getpid(), signal.SIGKILL)

        sys.stdout = sys.stderr = Path(os.devnull).open("w")  # noqa: SIM115 (for as long as the process)
        sys.addaudithook(watch)
        if largest is not None:
            import resource

            resource.setrlimit(resource.RLIMIT_FSIZE, (largest, resource.RLIM_INFINITY))
        code = int(work() or 0)
    finally:
        os._exit(code)


VERBS: dict[str, tuple[Sequence[str], Sequence[str]]] = {
    "sample": (
        ["sample", "-p", "motorway", "--duration", "20", "-o", "{}/o.csv"],
        ["sample", "-p", "motorway", "--duration", "60", "-o", "{}/o.csv"],
    ),
    "template": (
        ["template", "write", "cut-in", "-o", "{}"],
        ["template", "write", "cut-in", "-o", "{}", "--set", "lane_width=3.5"],
    ),
    "export": (
        ["export", "c", "-p", "motorway", "-o", "{}", "--force"],
        ["export", "c", "-p", "motorway-vehicle-3", "-o", "{}", "--force"],
    ),
}
"""Two commands with the same outputs: of a former run, and of the one that is hindered."""


@pytest.fixture(scope="module", params=VERBS)
def verb(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[list[str], list[str], dict[str, bytes], dict[str, bytes]]:
    """Both commands, and what each leaves in a folder of its own; of `export`, the same names."""
    made = []
    commands = [list(words) for words in VERBS[request.param]]
    for words in commands:
        folder = tmp_path_factory.mktemp("alone") / "out"
        assert main([word.format(folder) for word in words]) == 0
        made.append(content(folder))
    return commands[0], commands[1], made[0], made[1]


def test_a_killed_run_leaves_the_old_output_or_the_new_one(
    verb, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before, after, old, new = verb
    both = {**old, **new}
    for step in range(60):
        out = tmp_path / str(step) / "out"
        assert main([word.format(out) for word in before]) == 0
        status = in_child(lambda out=out: main([word.format(out) for word in after]), kill_at=step)
        if os.WIFEXITED(status):
            assert os.WEXITSTATUS(status) == 0
            assert content(out) == both
            break
        mend([out / name for name in both])
        assert content(out) in (old, both), step
        assert main([word.format(out) for word in after]) == 0, capsys.readouterr().err
        assert content(out) == both, step
    else:
        pytest.fail("it never ended")
    assert step > 5


def test_a_full_disk_leaves_the_old_output_as_it_was(verb, tmp_path: Path) -> None:
    before, after, old, new = verb
    sizes = sorted({0, 40, *(len(data) - 1 for data in new.values())})
    for largest in sizes:
        out = tmp_path / str(largest) / "out"
        assert main([word.format(out) for word in before]) == 0
        status = in_child(lambda out=out: main([word.format(out) for word in after]), largest=largest)
        assert os.WEXITSTATUS(status) == 1
        assert content(out) == old
        assert main([word.format(out) for word in after]) == 0
        fresh = tmp_path / f"{largest} fresh" / "out"
        in_child(lambda out=fresh: main([word.format(out) for word in after]), largest=largest)
        assert not fresh.exists()


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
        ('{"../precious.csv": ".o.1-00000000.tmp.csv"}', '{"../precious.csv": "out/x"}', "{", "[1]", '"a"')
    ):
        (tmp_path / "out" / f".o.1-0000000{number}.tmp.moves").write_text(plan)
    (tmp_path / "out" / ".o.1-00000009.tmp.moves").symlink_to(precious)
    mend([tmp_path / "out" / "o.csv"])
    assert precious.read_text() == "precious"
    assert [path.name for path in (tmp_path / "out").iterdir()] == [".o.1-00000009.tmp.moves"]


def test_of_files_that_fail_together_none_appears(tmp_path: Path) -> None:
    write_atomically(tmp_path / "a.csv", "old")
    with pytest.raises(FormatError), together():
        write_atomically(tmp_path / "a.csv", "new")
        write_atomically(tmp_path / "new" / "b.csv", "new")
        raise FormatError("no")
    assert content(tmp_path) == {"a.csv": b"old"} and not (tmp_path / "new").exists()
    assert not any(temporary_files().fullmatch(path.name) for path in tmp_path.iterdir())
