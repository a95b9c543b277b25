"""Readers in a process of their own: what they give and raise comes back; what breaks or never ends is one line."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.limits import Limit
from xosc_lateral.extras.recordings.formula import FormulaError, evaluate
from xosc_lateral.files import apart as module
from xosc_lateral.files.apart import apart
from xosc_lateral.files.source import guarding_inputs, last_read, read_source, refuse_guarded
from xosc_lateral.files.tables import read_table


@apart
def process_of(path: Path) -> int:
    read_source(path)
    return os.getpid()


@apart
def misbehaved(path: Path, how: str) -> object:
    match how:
        case "crash":
            return ctypes.string_at(0)
        case "exit":
            os._exit(3)
        case "hang":
            threading.Event().wait()
        case "memory":
            return len(bytes(10**11))
        case "program":
            return os.system(f"touch {path}.planted")
        case "popen":
            return subprocess.run(["touch", f"{path}.planted"], check=True)
        case "sympy":
            return __import__("sympy")
        case "print":
            print("a library's words")
        case "wrong":
            raise FormatError("no good", path=path, line=3, element="A")
    return how


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "a.txt"
    path.write_text("1")
    return path


def test_a_file_that_was_read_elsewhere_counts_as_an_input_here(file: Path) -> None:
    with guarding_inputs():
        assert process_of(file) != os.getpid()
        assert len(last_read(file)) == 64
        with pytest.raises(FormatError, match="is an input"):
            refuse_guarded(file)
    assert process_of(file) == process_of(file)  # one process reads many files


@pytest.mark.pages
@pytest.mark.parametrize(
    ("how", "what"),
    [
        ("crash", "broke down"),
        ("exit", "broke down"),
        ("hang", "took longer than 1 s"),
        ("memory", "memory"),
        ("program", "os.system: readers of files may not"),
        ("popen", "subprocess.Popen: readers of files may not"),
        ("sympy", "sympy"),
    ],
)
def test_what_a_library_must_not_do_ends(
    how: str, what: str, file: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    process_of(file)  # it has started
    monkeypatch.setattr(module, "PARSER_TIME", Limit(1, "s", "time", "a test"))
    with pytest.raises((FormatError, PermissionError, ImportError), match=what):
        misbehaved(file, how)
    assert not list(file.parent.glob("*.planted"))
    monkeypatch.undo()
    assert misbehaved(file, "print") == "print"
    assert capfd.readouterr().out == ""


def test_an_error_keeps_its_place(file: Path) -> None:
    with pytest.raises(FormatError) as raised:
        misbehaved(file, "wrong")
    assert (raised.value.path, raised.value.line, raised.value.element) == (file, 3, "A")
    assert str(raised.value) == f"{file}:3: A: no good"


def test_a_process_waits_longer_than_a_file_may_take(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PARSER_TIME", Limit(1, "s", "time", "a test"))
    process = process_of(file)
    time.sleep(2.5)
    assert process_of(file) == process


@pytest.mark.pages
def test_a_process_that_was_ended_meanwhile_is_replaced(file: Path) -> None:
    process = process_of(file)
    os.kill(process, signal.SIGKILL)
    time.sleep(0.2)
    assert process_of(file) != process


def test_threads_read_beside_each_other(file: Path) -> None:
    found: list[int] = []
    threads = [threading.Thread(target=lambda: found.append(process_of(file))) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert len(found) == 3


@pytest.mark.pages
def test_nothing_is_imported_from_the_working_folder(tmp_path: Path) -> None:
    (tmp_path / "numpy.py").write_text("open('planted', 'w')")
    pd.DataFrame({"time": [0.0, 0.2], "x": [1.0, 2.0]}).to_parquet(tmp_path / "a.parquet")
    code = "from pathlib import Path; from xosc_lateral.files.tables import read_table; read_table(Path('a.parquet'))"
    done = subprocess.run([sys.executable, "-P", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "planted").exists()


def test_a_parquet_file_that_unpacks_without_bound_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bomb.parquet"
    pq.write_table(pa.table({"x": pa.array(np.zeros(60_000_000))}), path, compression="zstd")
    assert path.stat().st_size < 400_000
    with pytest.raises(FormatError, match="decompression bomb"):
        read_table(path)


def test_what_pandas_wrote_comes_back(tmp_path: Path) -> None:
    table = pd.DataFrame({"time": [0.0, 0.2], "n": pd.array([1, None], dtype="Int64"), "w": ["a", None]})
    table["c"], table["t"] = table["w"].astype("category"), pd.to_datetime(["2026-01-01", "2026-01-02"])
    table.to_parquet(tmp_path / "a.parquet")
    pd.testing.assert_frame_equal(read_table(tmp_path / "a.parquet"), pd.read_parquet(tmp_path / "a.parquet"))


# ---- formulas --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "text",
    ["X1*2+1", "X", "-X1**2/3", "where(X1>1, X1, -X1)", "sqrt(abs(X1))%3", "2", "(X1>0)&(X1<3)", "1e-3*X1-4e2",
     "exp(X1)+log(X+5)"],
)  # fmt: skip
def test_formulas_are_computed_as_numexpr_does(text: str) -> None:
    import numexpr

    raw = np.linspace(-2, 4, 13)
    expected = np.broadcast_to(numexpr.evaluate(text, {"X": raw, "X1": raw}), raw.shape)
    np.testing.assert_allclose(evaluate(text, raw), expected.astype(float), rtol=1e-12)


@pytest.mark.parametrize(
    "text",
    ["__import__('os')", "X1.__class__", "X1[0]", "lambda: 1", "'a'*9", "(", "-" * 3000 + "X", "[1]", "eval('1')",
     "X1 if X1 else 2", "sin(X1, X1, X1, X1)", "", "X2", "1j", "9" * 5000, "f'{X1}'", "X1 := 2", "*X1",
     "sin(*X1)", "sin(out=X1)"],
)  # fmt: skip
def test_what_is_no_arithmetic_is_refused(text: str) -> None:
    with pytest.raises(FormulaError):
        evaluate(text, np.zeros(3))


def test_towers_of_powers_end() -> None:
    assert np.isinf(evaluate("X1*0+9**9**9**9", np.zeros(3))).all()
