"""What a notebook gets: tables, JSON and files of one result say the same, and inputs are told apart."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import xosc_lateral as xl
from examples.driver_simulator import simulate_drive
from xosc_lateral.base.errors import FormatError, XoscLateralError
from xosc_lateral.files.source import file_hash, parsed_hashes
from xosc_lateral.workflows.profiles.profiles import add_profile, derive_profile, tag_profile

SECONDS = 6.0


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return xl.write_template("cut-in", tmp_path_factory.mktemp("scenario"))[0]


@pytest.fixture(scope="module")
def played(scenario: Path):
    return xl.play(scenario, time_limit=SECONDS)


@pytest.fixture(scope="module")
def converted(scenario: Path):
    return xl.convert(scenario, seed=4, time_limit=SECONDS)


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two drives of one name, as a recorder leaves them: a folder each."""
    folder, paths = tmp_path_factory.mktemp("drives"), []
    for seed in (1, 2):
        paths.append(folder / f"day{seed}" / "drive.csv")
        paths[-1].parent.mkdir()
        simulate_drive(60.0, seed=seed).table.to_csv(paths[-1], index=False)
    return paths


def strict(result) -> dict:
    return json.loads(json.dumps(result.to_dict(), allow_nan=False))


# ---- play ------------------------------------------------------------------------------------------------------------
def test_a_played_scenario_is_the_same_table_as_frame_as_text_and_as_files(played, tmp_path):
    frame = played.to_frame()
    for name in ("s.csv", "s.csv.gz", "s.parquet"):  # text is written to a tenth of a millimetre
        path = played.write(tmp_path / name)
        read = (
            pd.read_parquet(path) if name.endswith("parquet") else pd.read_csv(path, comment="#", dtype={"road": str})
        )
        assert list(read.columns) == list(frame.columns), name
        for column in ("time", "x", "y", "h", "speed", "offset_t", "s"):
            np.testing.assert_allclose(read[column], frame[column], atol=6e-5, err_msg=f"{name} {column}")
    assert (tmp_path / "s.csv").read_text(encoding="utf-8").endswith(played.csv())


def test_every_entity_has_a_row_at_every_step_of_what_was_played(played):
    frame, facts = played.to_frame(), strict(played)
    steps = round(facts["end_time"] / facts["step"]) + 1
    assert frame.groupby("name").size().to_dict() == dict.fromkeys(played.entities, steps)
    for _, rows in frame.groupby("name"):
        driven = np.hypot(rows["x"].diff(), rows["y"].diff()).iloc[1:]
        middle = 0.5 * (rows["speed"] + rows["speed"].shift())[1:]
        np.testing.assert_allclose(driven / facts["step"], middle, rtol=5e-3)


def test_segments_tile_what_an_entity_was_played_for(played):
    found = xl.segments(played)
    frame = found.to_frame()
    for name, rows in frame.groupby("entity"):
        assert rows["start"].iloc[0] == 0.0 and rows["end"].iloc[-1] == pytest.approx(played.end_time), name
        gaps = rows["start"].to_numpy()[1:] - rows["end"].to_numpy()[:-1]
        assert (np.abs(gaps) <= 0.05 + 1e-9).all()
    following = frame[frame["road_following"]]
    assert f"{(following['end'] - following['start']).sum():.1f} s" in found.headline()
    assert (frame["why"].str.len() > 0).eq(~frame["road_following"]).all()


# ---- convert ---------------------------------------------------------------------------------------------------------
def test_nominal_columns_of_a_conversion_are_the_played_scenario(played, converted):
    nominal = played.to_frame().set_index(["name", "time"])
    made = converted.to_frame().set_index(["name", "time"])
    assert made["x_nominal"].to_numpy() == pytest.approx(nominal.loc[made.index, "x"].to_numpy(), abs=1e-5)
    assert made["y_nominal"].to_numpy() == pytest.approx(nominal.loc[made.index, "y"].to_numpy(), abs=1e-5)


def test_facts_headline_and_gaps_of_a_conversion_agree(converted):
    facts = strict(converted)
    assert facts["gap_before"] == pytest.approx(converted.smallest_gap[0], abs=1e-6)
    assert facts["gap_after"] == pytest.approx(converted.smallest_gap[1], abs=1e-6)
    assert [one["name"] for one in facts["entities"]] == list(converted.entities)
    assert tuple(one["name"] for one in facts["entities"] if one["profile"]) == converted.enriched
    assert f"{len(converted.enriched)} of {len(converted.entities)}" in repr(converted)


def test_another_seed_and_another_variant_are_other_drivers_on_the_same_road(scenario, converted):
    first = converted.to_frame()
    for change in ({"seed": 5}, {"seed": 4, "variant": 2}):
        other = xl.convert(scenario, time_limit=SECONDS, **change).to_frame()
        assert other["x_nominal"].equals(first["x_nominal"])
        assert (other["deviation"] - first["deviation"]).abs().max() > 0.02
    again = xl.convert(scenario, seed=4, time_limit=SECONDS)
    assert again.data == converted.data and again.sha256 == converted.sha256


def test_who_is_left_out_drives_as_written_and_the_others_as_if_all_took_part(scenario, converted):
    """What one vehicle does is its own: leaving another out changes nobody's movement (gaps let them be)."""
    only = xl.convert(scenario, seed=4, time_limit=SECONDS, only=["Truck"])
    assert only.enriched == ("Truck",)
    for name, rows in only.to_frame().groupby("name"):
        if name == "Truck":
            same = converted.to_frame().query("name == 'Truck'")
            np.testing.assert_allclose(rows["deviation"], same["deviation"], atol=1e-12)
        else:
            assert not rows["deviation"].any()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"seed": -1}, "seed -1"),
        ({"mode": "both"}, "both"),
        ({"only": ["Nobody"]}, "Nobody"),
        ({"entity": {"Nobody": "motorway"}}, "Nobody"),
        ({"parameters": {"nothing": 3}}, "nothing"),
        ({"parameters": {"ego_speed": "fast"}}, "fast"),
        ({"profile": "nobody-at-all"}, "nobody-at-all"),
    ],
)
def test_a_wish_that_can_not_be_met_is_refused_by_name(scenario, words, message):
    with pytest.raises((XoscLateralError, ValueError), match=message):
        xl.convert(scenario, time_limit=1.0, **words)


# ---- drives ----------------------------------------------------------------------------------------------------------
def test_two_files_of_one_name_are_both_named_as_inputs(tables):
    made = xl.sample("motorway-vehicle-1", context=tables, seed=1)
    inputs = strict(made)["provenance"]["inputs"]
    assert inputs == {f"{path.parent.name}/drive.csv": file_hash(path) for path in tables}
    assert len(made.to_frame()["drive"].unique()) == 2


def test_files_are_told_apart_by_as_little_of_their_paths_as_does(tmp_path):
    places = ["a/x/d.csv", "b/x/d.csv", "b/y/d.csv", "b/y/e.csv"]
    for place in places:
        (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / place).write_text(place)
    names = list(parsed_hashes(tmp_path / place for place in [*places, places[0]]))
    assert names == ["a/x/d.csv", "b/x/d.csv", "y/d.csv", "e.csv"]


def test_a_frame_beside_a_file_is_named_as_an_input_too(tables):
    frame = simulate_drive(60.0, seed=3).table
    made = xl.sample("motorway-vehicle-1", context=[tables[0], frame], seed=1)
    inputs = strict(made)["provenance"]["inputs"]
    assert set(inputs) == {"drive.csv", "DataFrame 2"} and all(len(value) == 64 for value in inputs.values())
    changed = xl.sample("motorway-vehicle-1", context=[tables[0], frame.assign(speed=21.0)], seed=1)
    assert strict(changed)["provenance"]["inputs"]["DataFrame 2"] != inputs["DataFrame 2"]


def test_snippets_like_measured_ones_begin_where_they_do_and_last_as_long(tables):
    frame = xl.sample("motorway-vehicle-1", like=tables[0], seed=2, snippet=8.0).to_frame()
    for _, rows in frame.groupby("snippet"):
        assert rows["offset"].iloc[0] == pytest.approx(rows["offset_real"].iloc[0], abs=1e-9)
        assert rows["time"].iloc[-1] - rows["time"].iloc[0] == pytest.approx(8.0)
    measured = pd.read_csv(tables[0])
    there = np.interp(frame["time"], measured["time"], 0.5 * (measured["distance_right"] - measured["distance_left"]))
    assert np.corrcoef(there, frame["offset_real"])[0, 1] > 0.98


def test_a_free_run_has_the_length_and_the_seed_that_were_asked_for():
    one, same, other = (xl.sample("motorway-vehicle-1", duration=30.0, seed=seed).to_frame() for seed in (1, 1, 2))
    assert one.equals(same) and not one["offset"].equals(other["offset"])
    assert one["time"].iloc[-1] == pytest.approx(30.0, abs=0.21)
    with pytest.raises(ValueError, match="one of like, context and duration"):
        xl.sample("motorway-vehicle-1")


# ---- the library -----------------------------------------------------------------------------------------------------
def test_tags_and_metadata_go_into_a_library_and_find_their_profile_again(tmp_path):
    folder = tmp_path / "team"
    path = add_profile(
        "motorway-vehicle-1", folder, name="anna", tags=["t-calm", "t-heavy"], metadata={"country": "XX"}
    )
    add_profile("rural", folder, name="bert", tags=["t-calm"])
    assert path == folder / "anna.json"
    assert xl.list_profiles(folder, tags=["t-calm", "t-heavy"]).names == ("anna",)
    assert xl.list_profiles(folder, where={"country": "XX"}).names == ("anna",)
    tag_profile("anna", folder, add=["t-old"], remove=["t-heavy"])
    assert xl.list_profiles(folder, tags=["t-heavy"]).names == ()
    assert xl.list_profiles(folder, tags=["t-calm"]).names == ("anna", "bert")
    with pytest.raises(FormatError, match="there is a profile of this id"):
        add_profile("rural", folder, name="anna")
    one, other = (xl.sample(name, duration=10.0, seed=1, library=folder).to_frame() for name in ("anna", "bert"))
    same = xl.sample("motorway-vehicle-1", duration=10.0, seed=1).to_frame()
    assert one["offset"].equals(same["offset"]) and not other["offset"].equals(same["offset"])


@pytest.mark.pages
def test_profiles_are_as_far_from_each_other_in_whatever_order_they_are_named(tmp_path):
    left, wide = (str(tmp_path / f"{name}.json") for name in ("left", "wide"))
    xl.write_profile(derive_profile("motorway", mean=0.6, name="left").profile, left)
    xl.write_profile(derive_profile("motorway", sdlp=0.45, name="wide").profile, wide)
    names = [left, wide, "motorway"]
    table = xl.compare_profiles(*names).to_frame()
    # from themselves: what drives as short as the few minutes that they were fitted to differ by
    assert (np.diag(table) < 0.7 * table.to_numpy().max(axis=1)).all()
    turned = xl.compare_profiles(*names[::-1]).to_frame()
    names = ["left", "wide", "motorway"]
    np.testing.assert_allclose(turned.loc[names, names], table, rtol=0.5)  # other random numbers, the same drivers
    with pytest.raises(ValueError, match="1 profile to compare"):
        xl.compare_profiles(names[0])
