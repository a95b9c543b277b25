"""Mutants of any file: bytes, numbers, words, lines and columns, drawn from a seed."""

from __future__ import annotations

import gzip
import io
import re
import zipfile
from collections.abc import Callable

import numpy as np

Rng = np.random.Generator

HOSTILE_NUMBERS = (
    *("0", "-1", "1e15", "-1e15", "1e308", "-1e308", "1e-308", "nan", "inf", "-inf", "1e400", "", " ", "1e-900000000"),
    *("9223372036854775808", "18446744073709551616", "1" + "0" * 400, "0x10", "1_000", "1,5", "٣", "2024-01-01"),
    *("9" * 5000, "[" * 3000, "500", "-3", "1e9", "1e-9", "true", "null", "[]", "{}", '"1"'),
)
HOSTILE_WORDS = (
    *("", " ", "é", "漢字", "😀", r"a$\foo$", "=1+1", "+x", "@y", "../../etc/passwd", "a\x00b", "a\nb", "a" * 5000),
    *(
        "<a>",
        "&amp;",
        "${1/0}",
        "$unknown",
        "${$a+$b}",
        "*",
        "%s",
        "{0}",
        "\u202e",
        "\x1b[2J",
        "\ufeff",
        "nan",
        "None",
        "-",
    ),
)
_NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][+-]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_][\w.]{2,}")
_QUOTED = re.compile(rb"\"[^\"\n]*\"|'[^'\n]*'")


def mutate(data: bytes, rng: Rng) -> bytes:
    """One to three changes of the bytes; packed files are changed outside or inside."""
    if data[:2] == b"\x1f\x8b" and rng.random() < 0.7:
        return gzip.compress(mutate(gzip.decompress(data), rng), mtime=0)
    if data[:2] == b"PK" and rng.random() < 0.7:
        return _mutate_zip(data, rng)
    for _ in range(int(rng.integers(1, 4))):
        data = _CHANGES[int(rng.integers(len(_CHANGES)))](data, rng)
    return data


def _mutate_zip(data: bytes, rng: Rng) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(packed, "w") as new:
        for name in old.namelist():
            new.writestr(name, mutate(old.read(name), rng))
    return packed.getvalue()


def _place(data: bytes, rng: Rng) -> int:
    """Anywhere, half of the time near one of the ends, where formats keep what they are about."""
    n = len(data)
    if rng.random() < 0.5 or n < 64:
        return int(rng.integers(n + 1))
    near = int(min(n, rng.exponential(60)))
    return near if rng.random() < 0.5 else n - near


def _flip(data: bytes, rng: Rng) -> bytes:
    changed = bytearray(data)
    for _ in range(int(rng.integers(1, 20))):
        if changed:
            changed[min(_place(data, rng), len(changed) - 1)] = int(rng.integers(256))
    return bytes(changed)


def _cut(data: bytes, rng: Rng) -> bytes:
    at = _place(data, rng)
    return data[:at] if rng.random() < 0.7 else data[at:]


def _delete(data: bytes, rng: Rng) -> bytes:
    at = _place(data, rng)
    return data[:at] + data[at + int(rng.exponential(200)) :]


def _repeat(data: bytes, rng: Rng) -> bytes:
    at, length = _place(data, rng), int(rng.exponential(500))
    return data[: at + length] + data[at:]


def _insert(data: bytes, rng: Rng) -> bytes:
    at = _place(data, rng)
    junk = (rng.bytes(int(rng.integers(1, 50))), b"\x00" * 100, "漢字😀".encode(), b"\xff\xfe", b"\n" * 50)
    return data[:at] + junk[int(rng.integers(len(junk)))] + data[at:]


def _swap_token(
    pattern: re.Pattern[bytes], choices: tuple[str, ...], quote: bytes = b""
) -> Callable[[bytes, Rng], bytes]:
    def change(data: bytes, rng: Rng) -> bytes:
        found = [match.span() for match in pattern.finditer(data[:200_000])]
        if not found:
            return data
        begin, end = found[int(rng.integers(len(found)))]
        token = quote + choices[int(rng.integers(len(choices)))].encode() + quote
        if rng.random() < 0.15:  # everywhere
            return data.replace(data[begin:end], token)
        return data[:begin] + token + data[end:]

    return change


def _lines(data: bytes, rng: Rng) -> bytes:
    lines = data.split(b"\n")
    a, b = (int(rng.integers(len(lines))) for _ in range(2))
    match int(rng.integers(4)):
        case 0:
            lines[a], lines[b] = lines[b], lines[a]
        case 1:
            lines.insert(b, lines[a])
        case 2:
            del lines[a]
        case 3:
            rng.shuffle(lines[1:])
    return b"\n".join(lines)


def _column(data: bytes, rng: Rng) -> bytes:
    """A whole column of a text table becomes one value, or goes."""
    rows = [line.split(b",") for line in data.split(b"\n")]
    if len(rows[0]) < 2:
        return data
    k = int(rng.integers(len(rows[0])))
    value = HOSTILE_NUMBERS[int(rng.integers(len(HOSTILE_NUMBERS)))].encode()
    gone = rng.random() < 0.3
    first = 1 if rng.random() < 0.8 else 0
    for row in rows[0 if gone else first :]:
        if k < len(row):
            if gone:
                del row[k]
            else:
                row[k] = value
    return b"\n".join(b",".join(row) for row in rows)


def _encoding(data: bytes, rng: Rng) -> bytes:
    text = data.decode("utf-8", "replace")
    name = ("utf-16", "utf-32", "utf-8-sig", "cp037", "shift_jis")[int(rng.integers(5))]
    return text.encode(name, "replace")


_CHANGES: tuple[Callable[[bytes, Rng], bytes], ...] = (
    *(_flip, _cut, _delete, _repeat, _insert, _lines, _column, _column, _encoding),
    *(_swap_token(_NUMBER, HOSTILE_NUMBERS),) * 4,
    *(_swap_token(_WORD, HOSTILE_WORDS),) * 2,
    *(_swap_token(_QUOTED, (*HOSTILE_WORDS, *HOSTILE_NUMBERS), b'"'),) * 2,
)
