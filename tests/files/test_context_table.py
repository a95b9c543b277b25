from __future__ import annotations

from pathlib import Path

import pytest

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.tables import read_context

BAD = {
    "no time": ("t,wind\n0,1\n1,2\n", "no column 'time'"),
    "time in words": ("time,wind\nnow,1\nthen,2\n", "column 'time': times have to be numbers"),
    "time stands": ("time,wind\n0,1\n0,2\n", "times have to increase"),
    "time unknown": ("time,wind\nnan,1\n1,2\n", "times have to increase"),
    "infinite": ("time,wind\n0,1\n2.5,inf\n", "column 'wind': inf at 2.5 s is not finite"),
    "words": ("time,wind,gusts\n0,1,2\n1,2,\n3,2,strong\n", "column 'gusts': 'strong' at 3 s is not a number; leave"),
    "dates": ("time,wind,day\n0,1,2026-01-01\n", "column 'day': '2026-01-01' at 0 s is not a number"),
    "no values": ("time,wind\n0,\n1,\n", "no column with values besides 'time'"),
    "time alone": ("time\n0\n1\n", "no column with values besides 'time'"),
    "ragged": ("time,wind\n0,1\n1,2,3,4\n", "can't be read as a table"),
    "empty": ("", "can't be read as a table"),
}


@pytest.mark.parametrize("case", BAD)
def test_broken_tables_are_refused_in_one_line(tmp_path: Path, case: str) -> None:
    text, message = BAD[case]
    path = tmp_path / "wind.csv"
    path.write_text(text)
    with pytest.raises(FormatError, match=message) as caught:
        read_context(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_rows_without_a_value_are_left_to_interpolation(tmp_path: Path) -> None:
    path = tmp_path / "wind.csv"
    path.write_text("time,wind,rain\n0,1,\n1,,0.5\n2,3,\n")
    context = read_context(path)
    assert [list(part) for part in context["wind"]] == [[0.0, 2.0], [1.0, 3.0]]
    assert [list(part) for part in context["rain"]] == [[1.0], [0.5]]
