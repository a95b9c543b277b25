from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.atomic import replace_atomically, write_atomically
from xosc_lateral.files.output_paths import claim, refuse_outputs


def test_text_and_bytes_arrive(tmp_path: Path) -> None:
    assert write_atomically(tmp_path / "a.txt", "grüße").read_bytes() == "grüße".encode()
    assert write_atomically(tmp_path / "a.txt", b"\x00").read_bytes() == b"\x00"
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


def test_a_failing_writer_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    output = write_atomically(tmp_path / "a.txt", "old")

    def fail(path: Path) -> None:
        path.write_text("half")
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        replace_atomically(output, fail)
    assert output.read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


def test_the_temporary_file_has_the_outputs_suffix_and_folder(tmp_path: Path) -> None:
    seen: list[Path] = []

    def write(path: Path) -> None:
        seen.append(path)
        path.write_bytes(b"x")

    replace_atomically(tmp_path / "table.csv.gz", write)
    assert seen[0].parent == tmp_path
    assert seen[0].suffix == ".gz"


def test_outputs_are_readable_for_others(tmp_path: Path) -> None:
    plain = tmp_path / "plain"
    plain.touch()
    written = write_atomically(tmp_path / "a", "x")
    assert stat.S_IMODE(written.stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)


def test_a_missing_folder_is_made(tmp_path: Path) -> None:
    assert write_atomically(tmp_path / "no" / "such" / "a", "x").read_text() == "x"


def test_outputs_that_would_destroy_an_input_or_one_another_are_refused(tmp_path: Path) -> None:
    source, link = write_atomically(tmp_path / "in.xosc", "x"), tmp_path / "link.xosc"
    link.symlink_to(source)
    refuse_outputs([tmp_path / "out.xosc", tmp_path / "out.html", None], [source])
    for output in (source, link, tmp_path / "sub" / ".." / "in.xosc"):
        with pytest.raises(FormatError, match="is an input"):
            refuse_outputs([output], [source])
    with pytest.raises(FormatError, match="named for two outputs"):
        refuse_outputs([tmp_path / "out", tmp_path / "out"])
    with pytest.raises(FormatError, match="is a folder"):
        refuse_outputs([tmp_path], [source])


def test_an_output_whose_folder_can_not_be_made_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    refuse_outputs([tmp_path / "new" / "folder" / "out.html"])
    file = write_atomically(tmp_path / "file", "x")
    for output in (file / "out.html", file / "deeper" / "out.html"):
        with pytest.raises(FormatError, match=r"out\.html: can't be written: .*file is a file, not a folder"):
            refuse_outputs([output])
    monkeypatch.setattr("os.access", lambda *_: False)  # permissions don't bind the user that runs many a test
    with pytest.raises(FormatError, match="no permission to write to"):
        refuse_outputs([tmp_path / "out.html"])


@pytest.mark.skipif(os.name == "nt", reason="POSIX modes")
def test_an_output_keeps_its_mode_and_a_pipe_is_none(tmp_path: Path) -> None:
    secret = write_atomically(tmp_path / "a.json", "{}")
    secret.chmod(0o600)
    assert write_atomically(secret, "[]").stat().st_mode & 0o777 == 0o600
    os.mkfifo(tmp_path / "pipe.json")
    with pytest.raises(FormatError, match="is a fifo, not a file"):
        claim([tmp_path / "pipe.json"], force=True)
