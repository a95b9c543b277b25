"""A company's tables: one saved mapping for names, units, signs, words and encodings, and a first version of it."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from xosc_lateral.base.errors import FormatError
from xosc_lateral.cli import main
from xosc_lateral.files.drives import read_drives
from xosc_lateral.files.mapping import as_mapping, read_mapping
from xosc_lateral.files.recognised import recognised
from xosc_lateral.files.tables import read_table

MAPPING = """
encoding = "cp1252"
[columns]
time = "Zeit [ms]:ms"
offset = "Querablage:-cm"
lane_width = {column = "Spur: Breite", unit = "cm"}
speed = "Geschw_kmh:km/h"
is_truck = "Fahrzeugtyp"
[values.is_truck]
LKW = 1
"Pkw " = 0
[roles]
curvature = "road"
"""


def _company(folder: Path, name: str = "fahrt.csv", seed: int = 0, encoding: str = "cp1252") -> Path:
    """Decimal commas, semicolons, milliseconds, centimetres to the right, umlauts."""
    rng = np.random.default_rng(seed)
    n = 400
    offset = np.cumsum(rng.normal(0.0, 0.4, n)) - 20.0
    table = pd.DataFrame(
        {
            "Zeit [ms]": np.arange(n) * 100,
            "Querablage": [f"{value:.2f}".replace(".", ",") for value in offset],
            "Spur: Breite": np.full(n, 375),
            "Geschw_kmh": [f"{value:.1f}".replace(".", ",") for value in 100.0 + rng.normal(0.0, 1.0, n)],
            "Fahrzeugtyp": ["LKW" if seed else "PKW"] * n,
            "Größe": np.arange(n),
        }
    )
    path = folder / name
    path.write_bytes(table.to_csv(index=False, sep=";").encode(encoding))
    return path


def test_a_saved_mapping_reads_what_map_can_and_what_it_cannot(tmp_path: Path) -> None:
    path, mapping = _company(tmp_path), tmp_path / "company.toml"
    mapping.write_text(MAPPING, encoding="utf-8")
    (drive,) = read_drives(path, mapping)
    raw = pd.read_csv(path, sep=";", decimal=",", encoding="cp1252")
    np.testing.assert_allclose(drive.time, 0.1 * np.arange(400), atol=1e-9)
    np.testing.assert_allclose(drive.offset, -0.01 * raw["Querablage"])
    np.testing.assert_allclose(drive.lane_width, 3.75)
    np.testing.assert_allclose(drive.context["speed"], raw["Geschw_kmh"] / 3.6)
    assert not drive.context["is_truck"].any()
    assert "Größe" in drive.context
    assert read_mapping(mapping).roles == {"curvature": "road"}


def test_words_stand_in_for_lines_of_the_file(tmp_path: Path) -> None:
    mapping = tmp_path / "company.toml"
    mapping.write_text(MAPPING, encoding="utf-8")
    both = as_mapping(mapping).with_words({"offset": "Querablage:cm"})
    (left,), (right,) = read_drives(_company(tmp_path), both), read_drives(tmp_path / "fahrt.csv", mapping)
    np.testing.assert_allclose(left.offset, -right.offset)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16"])
def test_encodings_are_recognised(tmp_path: Path, encoding: str) -> None:
    path, mapping = _company(tmp_path, encoding=encoding), tmp_path / "company.toml"
    mapping.write_text(MAPPING.replace('encoding = "cp1252"', ""), encoding="utf-8")
    (drive,) = read_drives(path, mapping)
    assert "Größe" in drive.context
    packed = tmp_path / "packed.csv.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()))
    np.testing.assert_array_equal(read_drives(packed, mapping)[0].offset, drive.offset)


def test_an_encoding_that_is_not_names_the_option(tmp_path: Path) -> None:
    path, mapping = _company(tmp_path), tmp_path / "company.toml"
    for wrong in ("utf-32", "no-such"):
        mapping.write_text(MAPPING.replace("cp1252", wrong), encoding="utf-8")
        with pytest.raises(FormatError, match="--mapping") as error:
            read_drives(path, mapping)
        assert str(path) in str(error.value) and wrong in str(error.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("columns = 1", r"\[columns\]"),
        ("[column]\na = 'b'", "unknown entry 'column'"),
        ("[columns]\nspeed = 'v:kg'", "speed.*kg"),
        ("[columns]\nspeed = {column = 'v', sign = 2}", "sign 2"),
        ("[columns]\nspeed = {colum = 'v'}", "colum"),
        ("[columns]\nspeed = 3", "3"),
        ("[values.is_truck]\nLKW = 'yes'", "LKW"),
        ("[values]\nis_truck = 1", "is_truck"),
        ("[roles]\na = 1", "roles"),
        ("decimal = ';'", "decimal"),
        ("separator = ''", "separator"),
        ("not toml", "no mapping"),
    ],
)
def test_a_broken_mapping_is_one_line_with_its_place(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "broken.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FormatError, match=words) as error:
        read_mapping(path)
    assert "broken.toml" in str(error.value) and "\n" not in str(error.value)


def test_a_text_without_a_number_is_named_with_its_row(tmp_path: Path) -> None:
    path, mapping = _company(tmp_path, seed=1), tmp_path / "company.toml"
    mapping.write_text(MAPPING.replace("LKW = 1\n", ""), encoding="utf-8")
    with pytest.raises(FormatError, match=r"'lkw' is not in \[values.is_truck\]") as error:
        read_drives(path, mapping)
    assert "fahrt.csv:2" in str(error.value)


@pytest.mark.pages
def test_from_raw_files_to_a_tagged_library_in_five_commands(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names = [_company(tmp_path, f"fahrt{k}.csv", k).name for k in range(2)]
    assert main(["check", *names, "--write-mapping", "company.toml"]) == 0
    proposed = Path("company.toml").read_text(encoding="utf-8")
    assert 'encoding = "cp1252"' in proposed and "CHECK" in proposed
    assert 'LKW" = 1' in proposed and 'PKW" = 0' in proposed
    (drive, _) = read_drives(names, "company.toml")
    assert drive.context["speed"].mean() == pytest.approx(100.0 / 3.6, rel=0.01)
    assert drive.time[-1] == pytest.approx(39.9)
    assert np.median(drive.lane_width) == pytest.approx(3.75)
    Path("company.toml").write_text(proposed.replace("Querablage:cm", "Querablage:-cm"), encoding="utf-8")
    commands = [
        ["import", "table", *names, "--mapping", "company.toml", "-o", "drives.parquet"],
        ["fit", "drives.parquet", "-o", "anna.json"],
        ["profiles", "add", "anna.json", "--library", "team", "--tag", "truck"],
    ]
    assert [main(command) for command in commands] == [0, 0, 0], capsys.readouterr().err
    assert main(["fit", *names, "--mapping", "company.toml", "-o", "other.json"]) == 0
    assert Path("team/anna.json").exists()


def test_the_mapping_of_the_page_is_one(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "formats.md").read_text(encoding="utf-8")
    (tmp_path / "m.toml").write_text(page.split("```toml\n")[1].split("```")[0], encoding="utf-8")
    mapping = read_mapping(tmp_path / "m.toml")
    assert mapping.rows == ("quality >= 2", "lane_change == 0") and mapping.missing == (-9999.0,)
    assert mapping.classes == {"3": "truck"} and mapping.time_zone == "Europe/Berlin"
    assert mapping.wheel_track == 1.6 and mapping.reference == "front"


HEADERS_IN_USE = {
    "offset": (
        "LaneOffset [m]", "lane_offset", "Lane_LatOffset", "lat_offset_m", "LateralPosition", "lateral deviation",
        "LatDev",
        "Lane_Deviation", "vtti.lane_distance_off_center", "DistToLaneCenter", "offset_from_lane_centre", "laneGap",
        "Car.Road.Path.DevDist", "deltaLaneCenter", "Querablage", "Querabweichung [cm]", "Querversatz", "Spurversatz",
        "Abstand_Fahrspurmitte", "Abweichung Fahrstreifenmitte", "Laterale Position", "Lateralabweichung", "LatPos",
        "Ablage_Spurmitte", "Spurposition",
    ),
    "lane_width": ("LaneWidth", "Lane_Width_m", "Fahrstreifenbreite [m]", "Spurbreite"),
    "distance_left": (
        "LnMrkLeft_Dist", "LnMrkLe_Dist", "ME_LeftLane_Distance", "Dist_Left", "DistLeftMarking", "left_line_distance",
        "lane_left_c0", "Abstand_links", "Abstand linke Markierung", "Abstand_Markierung_links", "LnLft_Dist",
    ),
    None: ("GPS_Lat", "gps_lat_pos", "lane_index_left", "steering_offset_time", "odometer", "left_indicator",
           "yaw_dev"),
}  # fmt: skip


@pytest.mark.parametrize(("name", "header"), [(name, one) for name, every in HEADERS_IN_USE.items() for one in every])
def test_headers_of_the_usual_systems_are_proposed(name: str | None, header: str, tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text(f"time,{header}\n" + "".join(f"{0.1 * k},{1.7 + 0.01 * k}\n" for k in range(50)))
    columns, _ = recognised([read_table(path, as_mapping(None))], path)
    assert {one.name for one in columns} - {"time"} == ({name} if name else set()), columns
