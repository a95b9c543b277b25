"""evaluate and profiles, from the command line to the page."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import get_type_hints

import numpy as np
import pandas as pd
import pytest

from laboratory.library import POPULATION, SINGLE, by_ordinariness
from tests.kit.profiles import REFINED
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.cli import main
from xosc_lateral.drivers.evaluation.look_words import found_in, in_words
from xosc_lateral.drivers.evaluation.metrics import free_runs
from xosc_lateral.files.profiles import list_profiles, read_profile
from xosc_lateral.workflows.profiles.cards import card_text
from xosc_lateral.workflows.profiles.violins import _density


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve drives of two minutes at 10 Hz."""
    from scipy.signal import lfilter

    rng = np.random.default_rng(0)
    n = 1200
    x = lfilter([1.0], np.poly([0.98, 0.9]), rng.normal(size=(12, n + 500)), axis=1)[:, 500:]
    x *= 0.25 / x.std()
    path = tmp_path_factory.mktemp("drives") / "drives.parquet"
    drive = np.repeat([f"d{k}" for k in range(12)], n)
    pd.DataFrame(
        {"drive": drive, "time": np.tile(0.1 * np.arange(n), 12), "offset": x.ravel(), "lane_width": 3.6, "speed": 30.0}
    ).to_parquet(path)
    return path


@pytest.fixture(scope="module")
def profile(table: Path) -> Path:
    path = table.with_name("mine.json")
    assert main(["fit", str(table), "-o", str(path), "--model", "two-level", "--source", "made up"]) == 0
    return path


@pytest.mark.pages
def test_evaluate_prints_one_json_object_with_everything(table, profile, capsys):
    assert main(["evaluate", "-p", str(profile), str(table), "--json", "--no-classify"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["snippets"]["count"] > 100
    assert len(values["evaluations"]) == 4
    assert values["spectrum"]["frequency_hz"][0] < 0.03
    assert set(values["provenance"]["inputs"]) == {"drives.parquet"}
    assert len(values["provenance"]["profile_sha256"]) == 64
    assert values["provenance"]["fitted_on_these"] is True


@pytest.mark.pages
def test_a_profile_scored_on_the_drives_it_was_fitted_to_says_so(table, profile, capsys):
    assert main(["evaluate", "-p", "motorway", str(table), "--json", "--no-classify"]) == 0
    assert json.loads(capsys.readouterr().out)["provenance"]["fitted_on_these"] is False
    assert main(["evaluate", "-p", str(profile), str(table), "--no-classify"]) == 0
    assert "was fitted to these drives" in capsys.readouterr().out


@pytest.mark.pages
def test_traces_of_measured_drives_stand_beside_sampled_ones(table, profile):
    from xosc_lateral import evaluate

    scores = evaluate(profile, table, classify=False)._scores
    assert [trace.drive for trace in scores.traces] == [f"d{k}" for k in range(6)]
    rows = pd.read_parquet(table)
    for trace in scores.traces:
        measured = rows[rows["drive"] == trace.drive]
        there = np.interp(trace.step * np.arange(len(trace.real)), measured["time"], measured["offset"])
        assert np.corrcoef(trace.real[5:-5], there[5:-5])[0, 1] > 0.95  # the same drive, at a coarser step
        assert trace.sampled[0] == pytest.approx(trace.real[0])
        assert abs(np.corrcoef(trace.real, trace.sampled)[0, 1]) < 0.95


def test_a_profiles_card_is_a_page(tmp_path):
    page = tmp_path / "card.html"
    assert main(["profiles", "show", "motorway", "--report", str(page), "--quiet"]) == 0
    html = page.read_text(encoding="utf-8")
    assert "Driver profile motorway" in html and html.count("<figure") == 2


@pytest.mark.pages
def test_evaluate_tells_a_person_the_same(table, profile, capsys):
    assert main(["evaluate", "-p", str(profile), str(table), "--no-classify"]) == 0
    text = capsys.readouterr().out
    assert (
        "snippets of 10 s" in text
        and "comes near a marking, measured" in text
        and "classifier AUC: not computed" in text
    )


def test_report_is_one_page_with_violins_and_the_same_bytes_each_time(table, profile, tmp_path):
    pages = []
    for name in ("a.html", "b.html"):
        words = ["evaluate", "-p", str(profile), str(table), "--no-classify", "--report", str(tmp_path / name)]
        assert main(words) == 0
        pages.append((tmp_path / name).read_text(encoding="utf-8"))
    assert pages[0] == pages[1]
    assert pages[0].count("<figure") == 4, "verdict, traces, violins, spectrum and autocorrelation"
    assert pages[0].index("<figure") < pages[0].index("<h2") and pages[0].count("<summary><h2") > 4, (
        "the rest is folded"
    )
    assert "measured" in pages[0] and "sampled" in pages[0] and "drives.parquet" in pages[0]
    assert not re.search(r"\bsrc=|@import", pages[0].split("<script>")[0]) and 'href="http' not in pages[0], (
        "opens offline"
    )


def test_density_integrates_to_the_sample():
    values = np.random.default_rng(1).normal(0, 0.2, 2000)
    grid = np.linspace(-0.6, 0.6, 120)
    density = _density(values, grid)
    density /= density.sum() * (grid[1] - grid[0])
    expected = np.exp(-0.5 * (grid / 0.2) ** 2) / (0.2 * np.sqrt(2 * np.pi))
    assert np.abs(density - expected).max() < 0.15 * expected.max()


# ---- library ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", list_profiles(), ids=lambda path: path.stem)
def test_shipped_profile_names_its_source_and_stays_in_the_lane(path):
    profile = read_profile(path)
    known = profile.provenance
    assert profile.name == path.stem
    assert known.source and known.licence and known.notes and known.hours > 0.03 and known.package_version
    assert all(len(digest) == 64 for digest in known.inputs.values()) and known.inputs
    assert known.evaluation["held_out"]
    runs = free_runs(profile, 1, drivers=5, duration=300.0)
    assert np.abs(runs).max() < 0.5 * profile.lane_width
    assert 0.03 < runs.std() < 0.5


def test_the_population_and_a_single_vehicle_are_shipped():
    assert {path.stem for path in list_profiles()} == {POPULATION, "rural", SINGLE}


def test_a_refined_profile_says_what_the_loop_found():
    refined = read_profile(REFINED)
    loop = refined.provenance.fit["closed_loop"]
    assert f"found: {', '.join(loop['found'])}" in card_text(refined)


@pytest.mark.pages
def test_a_shipped_card_says_what_the_look_at_the_fit_found_and_where_the_recording_ends(capsys):
    card = card_text(read_profile("motorway"))
    assert re.search(r"within 1.2 m of a marking [\d.]+% of the time, [\d.]+ excursions an hour, as measured", card)
    assert re.search(r"look +motorway (drives as its drives do, in all|does not drive as its drives do:)", card)
    assert "0 to 0.1 Hz (DLR Highway Traffic)" in card
    assert main(["profiles", "compare", "motorway", "rural"]) == 0
    said = capsys.readouterr().out
    shown = [read_profile(name) for name in ("motorway", "rural")]
    assert all(found_in(profile)[0] and in_words(profile) in said for profile in shown)


def test_a_fitted_profile_has_no_word_about_a_loop(profile):
    assert "found:" not in card_text(read_profile(str(profile)))


def test_the_most_ordinary_of_those_that_stay_as_they_are_comes_first():
    rng = np.random.default_rng(2)
    snippets = {f"plain{k}": rng.normal(0, 0.1, (12, 51)) for k in range(16)}
    weave = np.tile(np.sin(np.arange(51) / 4), (12, 1))
    snippets["left"] = 0.6 + 0.1 * weave
    snippets["restless"] = 0.5 * weave
    snippets["fickle"] = snippets["plain2"] + np.where(np.arange(12) < 6, -0.8, 0.8)[:, None]
    order = by_ordinariness(snippets)
    assert order[0].startswith("plain") and {"left", "restless"} == set(order[-2:]) and "fickle" not in order


def test_too_few_vehicles_are_refused_with_their_number():
    with pytest.raises(NotEnoughDataError, match=r"3 vehicles .* 4 are needed"):
        by_ordinariness({f"d{k}": np.zeros((4, 51)) for k in range(3)})


def test_profiles_list_show_and_compare_see_own_folders(profile, capsys):
    folder = ["--library", str(profile.parent)]
    assert main(["profiles", "list", *folder, "--json"]) == 0
    listed = {one["id"]: one for one in json.loads(capsys.readouterr().out)["profiles"]}
    assert listed["mine"]["source"] == "made up" and "motorway" in listed
    assert main(["profiles", "show", "mine", *folder]) == 0
    card = capsys.readouterr().out
    assert "made up" in card and "two-level" in card and "of the lane centre" in card
    assert main(["profiles", "show", "mine", *folder, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["summary"]["spread"] == pytest.approx(0.25, abs=0.06)
    assert main(["profiles", "compare", "mine", "motorway", *folder, "--json"]) == 0
    compared = json.loads(capsys.readouterr().out)
    assert compared["distance"][0][1] == compared["distance"][1][0] > compared["distance"][0][0] > 0


@pytest.mark.pages
def test_a_profile_has_the_same_figures_wherever_they_are_stated(capsys):
    """List, card and comparison, alone and in company."""
    assert main(["profiles", "show", "rural"]) == 0
    card = capsys.readouterr().out
    rows = []
    for others in (["motorway"], ["motorway-vehicle-1", "motorway"]):
        assert main(["profiles", "compare", *others, "rural"]) == 0
        rows.append(next(line for line in capsys.readouterr().out.splitlines() if line.startswith("rural ")))
    assert " ".join(rows[0].split()) == " ".join(rows[1].split())
    mean, sdlp = re.findall(r"-?[\d.]+ \+- [\d.]+", rows[0])[:2]
    assert f"mean       {mean} m" in card and f"SDLP {sdlp} m" in card
    assert main(["profiles", "compare", "motorway", "rural", "--json"]) == 0
    compared = json.loads(capsys.readouterr().out)["profiles"][1]
    assert main(["profiles", "show", "rural", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert {key: shown[key] for key in ("summary", "lane_keeping")} == {
        key: compared[key] for key in ("summary", "lane_keeping")
    }
    assert shown["summary"]["mean_offset"] == shown["lane_keeping"]["mean"]
    assert main(["profiles", "list", "--tag", "single-vehicle"]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert listed and all("in the recording" in line for line in listed)


@pytest.mark.pages
def test_each_pair_of_profiles_has_a_verdict_and_none_is_alike_that_differs(capsys):
    assert main(["profiles", "compare", "motorway", "motorway-vehicle-1", "rural"]) == 0
    lines = capsys.readouterr().out.splitlines()
    pairs = [re.split(r" {2,}", line) for line in lines if re.match(r"\S+, \S+  ", line)]
    assert len(pairs) == 3
    words = r"(differ in (mean offset|slow movement|fast movement), p [=<] \S+|not told apart; .* would be)"
    assert all(re.fullmatch(words, verdict) for _, verdict, *_ in pairs)
    differing = {frozenset(names.split(", ")) for names, verdict, *_ in pairs if verdict.startswith("differ")}
    assert all(float(verdict.split()[-1]) <= 0.05 for _, verdict, *_ in pairs if verdict.startswith("differ"))
    for line in (line for line in lines if line.startswith("alike: ")):
        assert not any(pair <= set(line.removeprefix("alike: ").split(", ")) for pair in differing)


def test_a_fit_without_a_name_is_called_after_its_table(table):
    import xosc_lateral as xl

    assert xl.fit(table, model="two-level").name == "drives"
    assert xl.fit(pd.read_parquet(table), model="two-level").name == "profile"


def test_frames_are_data_frames_for_type_checkers_too():
    import xosc_lateral as xl

    results = [value for value in vars(xl).values() if isinstance(value, type) and hasattr(value, "to_frame")]
    results += [xl.compare_profiles("rural", "motorway").__class__, xl.list_profiles().__class__]
    assert all(get_type_hints(result.to_frame)["return"] is pd.DataFrame for result in results)


def test_an_unknown_profile_is_answered_with_the_known_ones(capsys):
    assert main(["profiles", "show", "nobody"]) == 1
    message = capsys.readouterr().err
    assert "no profile 'nobody'" in message and "motorway" in message
