"""The gate through which input files are opened: what passes, what is remembered, what is guarded."""

from __future__ import annotations

import hashlib
import io
import os
import sys
from pathlib import Path

import pytest

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.limits import PACKING_RATIO, UNPACKED_SIZE, UNPACKED_UNASKED, Limit
from xosc_lateral.files import source
from xosc_lateral.files.source import (
    edit_in_place,
    file_hash,
    guard_input,
    guarding_inputs,
    last_read,
    open_source,
    read_source,
    refuse_guarded,
)

DATA = b"time,offset\n0.0,0.1\n"
MEGABYTE = 1_000_000


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "drive.csv"
    path.write_bytes(DATA)
    return path


@pytest.mark.parametrize("in_memory", [True, False], ids=["small", "large"])
def test_bytes_come_with_the_hash_of_what_was_parsed(
    table: Path, monkeypatch: pytest.MonkeyPatch, in_memory: bool
) -> None:
    monkeypatch.setattr(source, "IN_MEMORY", MEGABYTE if in_memory else 4)
    content = read_source(table)
    assert content.data == DATA
    assert content.sha256 == last_read(table) == hashlib.sha256(DATA).hexdigest()


def test_a_small_file_that_changes_while_it_is_open_is_parsed_as_it_was(table: Path) -> None:
    with open_source(table) as opened:
        table.write_bytes(b"other")
        assert opened.file.read() == DATA
        assert opened.size == len(DATA)
    assert last_read(table) == hashlib.sha256(DATA).hexdigest()


def test_a_large_file_that_changes_while_it_is_open_is_refused(table: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source, "IN_MEMORY", 4)
    with pytest.raises(FormatError, match=r"drive\.csv: changed while it was being read"), open_source(table):
        table.write_bytes(DATA + b"0.2,0.1\n")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda path: path.mkdir(), "is a folder, not a file"),
        (lambda path: os.mkfifo(path), "is a fifo, not a file"),
        (lambda path: path.symlink_to("/dev/zero"), "is a device, not a file"),
        (lambda path: None, "no such file"),
        (lambda path: path.symlink_to(path.with_name("gone")), "no such file"),
    ],
    ids=["folder", "fifo", "device", "nothing", "dangling link"],
)
def test_only_files_pass(make: object, message: str, tmp_path: Path) -> None:
    path = tmp_path / "input"
    make(path)  # type: ignore[operator]
    with pytest.raises(FormatError, match=message):
        read_source(path)


def test_a_zero_byte_in_a_name_is_one_line_too() -> None:
    with pytest.raises(FormatError, match="null byte"):
        read_source("in\0put.csv")


def test_a_file_above_the_limit_is_refused_with_both_sizes(table: Path) -> None:
    with pytest.raises(FormatError, match=r"drive\.csv: size of a file: 2e-05 MB, at most 1e-05 MB"):
        read_source(table, Limit(1e-5, "MB", "size of a file", "memory"))


def test_a_file_above_the_limit_is_not_hashed(table: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source, "FILE_SIZE", Limit(1e-6 * len(DATA), "MB", "size of a file", "memory"))
    assert file_hash(table) == hashlib.sha256(DATA).hexdigest()
    table.write_bytes(DATA + b"00")
    with pytest.raises(FormatError, match=r"size of a file: 2\.2e-05 MB, at most 2e-05 MB"):
        file_hash(table)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="files of Linux' kernel")
def test_a_file_of_the_kernel_that_says_it_is_empty_counts_by_what_it_holds() -> None:
    path = Path("/proc/self/status")
    assert path.stat().st_size == 0 and b"VmRSS" in read_source(path).data
    with pytest.raises(FormatError, match=r"size of a file: 1\.1e-05 MB, at most 1e-05 MB"):
        read_source(path, Limit(1e-5, "MB", "size of a file", "memory"))


@pytest.mark.parametrize(
    ("unpacked", "packed", "passes"),
    [
        (UNPACKED_UNASKED.bytes, 1, True),
        (UNPACKED_UNASKED.bytes + 1, UNPACKED_UNASKED.bytes, True),
        (UNPACKED_UNASKED.bytes + MEGABYTE, 1, False),
        (UNPACKED_SIZE.bytes + MEGABYTE, UNPACKED_SIZE.bytes, False),
    ],
    ids=["small", "large but hardly packed", "packed a thousand times", "too large however packed"],
)
def test_what_unpacks_to_too_much_is_refused(unpacked: int, packed: int, passes: bool, tmp_path: Path) -> None:
    assert PACKING_RATIO.value > 1.0
    opened = source.Source(tmp_path, io.BytesIO(), int(packed))
    if passes:
        opened.unpacked(int(unpacked))
    else:
        with pytest.raises(FormatError):
            opened.unpacked(int(unpacked))


# ---- inputs are not replaced -----------------------------------------------------------------------------------------
def linked(table: Path, how: str) -> Path:
    other = table.with_name("other.csv")
    if how == "the same":
        return table
    (other.symlink_to if how == "symbolic link" else other.hardlink_to)(table)
    return other


@pytest.mark.parametrize("how", ["the same", "symbolic link", "hard link"])
def test_an_input_is_no_output_whatever_name_it_goes_by(table: Path, how: str) -> None:
    target = linked(table, how)
    with guarding_inputs():
        read_source(table)
        with pytest.raises(FormatError, match="is an input; choose another output"):
            refuse_guarded(target)
    refuse_guarded(target)  # afterwards nothing is held against it


def test_what_was_never_read_may_be_replaced(table: Path, tmp_path: Path) -> None:
    with guarding_inputs():
        refuse_guarded(table)
        refuse_guarded(tmp_path / "new.csv")
        guard_input(tmp_path / "not there.csv")
        guard_input(table)
        with pytest.raises(FormatError, match="is an input"):
            refuse_guarded(table)


def test_an_edit_of_this_very_file_was_asked_for(table: Path) -> None:
    with guarding_inputs():
        read_source(table)
        edit_in_place(table)
        refuse_guarded(table)


def test_without_a_guard_nothing_is_kept(table: Path) -> None:
    read_source(table)
    guard_input(table)
    edit_in_place(table)
    refuse_guarded(table)


def test_the_last_hashes_are_kept_and_the_oldest_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source, "REMEMBERED", 3)
    monkeypatch.setattr(source, "_LAST_READ", {})
    paths = [tmp_path / f"{number}.csv" for number in range(5)]
    for path in paths:
        path.write_bytes(path.name.encode())
        read_source(path)
    with pytest.raises(KeyError):
        last_read(paths[1])
    assert last_read(paths[2]) == hashlib.sha256(b"2.csv").hexdigest()
    read_source(paths[2])  # again: the youngest
    paths[0].write_bytes(b"0.csv")
    read_source(paths[0])
    assert last_read(paths[2])
    with pytest.raises(KeyError):
        last_read(paths[3])
