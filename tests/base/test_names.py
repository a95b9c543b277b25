"""Names of others in every language that they leave in: all sequences of three signs, trigraphs, what turns reading."""

from __future__ import annotations

import csv
import io
import json
import subprocess
import unicodedata
from html import escape
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import pandas as pd
import pytest
from lxml import etree
from msgspec.structs import replace

from tests.kit.compiled import build
from tests.kit.profiles import REFINED
from xosc_lateral.base.errors import DriverProfileError, FormatError
from xosc_lateral.base.names import in_c, in_c_comment, in_csv, in_json, in_terminal, unwritable
from xosc_lateral.drivers.model.effects import Acts, Linear
from xosc_lateral.extras.live.export import export_c, export_fmu
from xosc_lateral.files.output_tables import csv_text
from xosc_lateral.files.profiles import read_profile, write_profile

PRINTABLE = [chr(sign) for sign in range(32, 127)]
BIDIRECTIONAL = [chr(sign) for sign in (*range(0x202A, 0x202F), *range(0x2066, 0x206A), 0x200E, 0x200F, 0x061C)]
TRIGRAPHS = [f"??{sign}" for sign in "=/'()!<>-"]
ODD = [
    '");system("touch planted");("',
    "a*/ int x; /*",
    "@SIZES@",
    "@INPUTS@",
    "ends in \\",
    "ends in ??/",
    "ä%s%n",
    "\U0001f697",
]


def sequences() -> list[str]:
    """Texts that hold every sequence of three printable ASCII signs (a de Bruijn sequence, in pieces), and odd ones."""
    size, letters = 3, len(PRINTABLE)
    word, found = [0] * (letters * size), list[int]()

    def extend(t: int, p: int) -> None:
        if t > size:
            if size % p == 0:
                found.extend(word[1 : p + 1])
            return
        word[t] = word[t - p]
        extend(t + 1, p)
        for k in range(word[t - p] + 1, letters):
            word[t] = k
            extend(t + 1, t)

    extend(1, 1)
    text = "".join(PRINTABLE[k] for k in [*found, *found[: size - 1]])
    pieces = [text[start : start + 10_000 + size - 1] for start in range(0, len(text), 10_000)]
    return [*pieces, *BIDIRECTIONAL, *TRIGRAPHS, *ODD]


TEXTS = sequences()


def test_every_sequence_of_three_printable_signs_is_tried() -> None:
    met = {text[k : k + 3] for text in TEXTS for k in range(len(text) - 2)}
    assert sum(len(one) == 3 and one.isascii() and one.isprintable() for one in met) == len(PRINTABLE) ** 3


def test_compiled_strings_say_what_was_said_and_comments_stay_comments(tmp_path: Path) -> None:
    """C99 knows trigraphs; what is printed by the program is compared byte by byte."""
    lines = [f"/* {in_c_comment(text)}\n * {in_c_comment(text)}\n */ fputs({in_c(text)}, stdout);" for text in TEXTS]
    source = tmp_path / "said.c"
    source.write_text("#include <stdio.h>\nint main(void) {\n" + "\n".join(lines) + "\nreturn 0; }\n", "utf-8")
    assert source.read_bytes().isascii()
    program = build([source], tmp_path / "said", "-O0", "-Wno-overlength-strings")
    assert subprocess.run([program], capture_output=True, check=True).stdout == "".join(TEXTS).encode()


def test_documents_give_back_what_was_said() -> None:
    element, root = etree.Element("a", {"name": "".join(TEXTS)}), ElementTree.Element("a", {"name": "".join(TEXTS)})
    for data in (etree.tostring(element), ElementTree.tostring(root)):
        assert etree.fromstring(data, etree.XMLParser(huge_tree=True)).get("name") == "".join(TEXTS)
    seen: list[str] = []
    parser = HTMLParser(convert_charrefs=True)
    parser.handle_data = seen.append  # type: ignore[method-assign]
    parser.feed(f"<p>{escape(' '.join(TEXTS))}</p>")
    parser.close()
    assert "".join(seen) == " ".join(TEXTS)


def test_cells_are_no_formulas_and_lines_of_json_are_what_was_said() -> None:
    short = sorted({text[k : k + 3] for text in TEXTS[:9] for k in range(len(text) - 2)} | set(TEXTS[-40:]))
    rows = list(csv.reader(io.StringIO(csv_text(pd.DataFrame({"name": short})), newline="")))[1:]
    assert [cell for (cell,) in rows] == [in_csv(text) for text in short]
    assert all(cell[:1] not in tuple("=+-@\t\r\n＝＋－＠") for (cell,) in rows)
    assert json.loads(in_json(short)) == short
    assert in_json(short).isprintable() and "ä" in in_json(short)


def test_nothing_on_a_terminal_turns_the_direction_of_reading() -> None:
    shown = in_terminal("first\nCar\u202egpj.exe\x1b[2J")
    assert shown == "first\nCar\\u202egpj.exe\\x1b[2J"
    kinds = {unicodedata.category(sign) for text in TEXTS for sign in in_terminal(text)}
    assert not kinds & {"Cc", "Cf", "Zl", "Zp"}


@pytest.mark.parametrize("name", ["a\nb", "a\x00", "\x1b[2J", "a\u2028b", "\ud800", "a\ufffe"])
def test_a_profile_with_a_name_that_no_language_holds_is_refused(name: str) -> None:
    assert unwritable(name)
    effect = Linear(acts=Acts.LOCATION, column=name, coefficients=(0.1,), errors=(0.1,), reference=(0.0,))
    for wrong in (
        lambda: read_profile("motorway").with_effects(effect),
        lambda: replace(read_profile("motorway"), name=name),
    ):
        with pytest.raises(DriverProfileError, match="is no name"):
            wrong()


def test_half_a_character_in_a_profile_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "half.json"
    write_profile(read_profile("motorway"), path)
    path.write_text(path.read_text().replace('"country": "DE"', '"country": "\\ud800"'))
    with pytest.raises(FormatError, match="half a character"):
        read_profile(path)


@pytest.mark.parametrize(
    "column", ['??/");system("touch planted");//', '"*/ #error @INPUTS@ \u202e', "ends in ??/", "DRIVER \\"]
)
def test_a_driver_is_compiled_whatever_its_columns_and_licences_are_called(column: str, tmp_path: Path) -> None:
    profile = read_profile(REFINED)
    effect = Linear(acts=Acts.LOCATION, column=column, coefficients=(0.1,), errors=(0.1,), reference=(0.0,))
    metadata = replace(profile.metadata, licence=f"{column} @SIZES@ {'x ' * 70}{column}")
    profile = replace(profile.with_effects(effect), name=column, metadata=metadata)
    source = export_c(profile, tmp_path)[1]
    build([source], tmp_path / "driver.so", "-fPIC", "-shared")
    assert export_fmu(profile, tmp_path / "driver.fmu")
    assert column.encode() not in b"".join(path.read_bytes() for path in tmp_path.glob("*.[ch]"))
