"""A dossier says of each claim what shows it; one that does not hold turns red."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from msgspec.structs import replace

import xosc_lateral as xl
from xosc_lateral.extras.dossier import measures
from xosc_lateral.extras.dossier.call import Dossier
from xosc_lateral.extras.dossier.claims import State, contents_of
from xosc_lateral.workflows.conversion.convert import convert

ROOT = Path(__file__).resolve().parents[3]


def states(made: Dossier) -> dict[str, State]:
    return {finding.claim.id: finding.state for finding in made.findings}


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr(measures, "TEMPLATES", ("cut-in",))
    monkeypatch.setattr(measures, "SEEDS", (1,))
    monkeypatch.setattr(measures, "DETECTED_VARIANTS", 1)


@pytest.fixture
def read(monkeypatch):
    """Nothing is computed: what a profile and the package state is read."""
    monkeypatch.setattr(measures, "COMPUTED", ())


def test_what_is_known_of_verdicts_on_the_road_is_what_the_page_of_detectors_shows():
    rows = dict(contents_of(None).verdict)
    text = (ROOT / "docs" / "validation" / "detectors.md").read_text(encoding="utf-8")
    table = text.split("<!-- transfer-early: begin -->")[1].split("<!-- transfer-early: end -->")[0]
    for line in table.strip().splitlines()[2:]:
        name, written, lifelike, _, without, real = (cell.strip() for cell in line.strip("|").split("|"))
        assert rows[name] == (
            f"as written: {written}. Lifelike: {lifelike}. Without a recording: {without}. Real: {real}."
        )
    assert "which had no part in profile, lane changes, training or threshold" in rows["protocol"]


def test_what_is_not_computed_is_said_to_be_so(read, tmp_path):
    made = xl.dossier("motorway")
    assert set(states(made).values()) == {State.STATED, State.UNTESTED}
    assert states(made)["transfer"] is State.UNTESTED is states(made)["assumed-frequency"]
    stated = {finding.claim.id: finding.value for finding in made.findings if finding.value is not None}
    evaluation = xl.read_profile("motorway").provenance.evaluation
    assert stated["realistic"] == evaluation["snippets"]["mean_ratio"]
    page = made.write_report(tmp_path / "page.html").read_text(encoding="utf-8")
    values = json.loads((tmp_path / "page.json").read_text(encoding="utf-8"))
    assert values["claims"] == made.to_dict()["claims"] and "ISO 26262-8:2018, 11.4.5" in page
    for part in (
        "Purpose",
        "Claims",
        "Validity",
        "Data, licence",
        "verdict",
        "boosted trees",
        "anomalies",
        "classification",
        "Versions",
    ):
        assert part in page
    assert "A trajectory does not react" in page and values["versions"]["profile sha256"] in page
    with pytest.raises(xl.FormatError, match="not written by"):
        (tmp_path / "page.json").write_text("{}")
        made.write_report(tmp_path / "page.html")


def test_every_part_has_a_clause_and_every_claim_of_ours_its_test():
    contents = contents_of(None)
    assert set(contents.clauses) == {
        "purpose",
        "claims",
        "validity",
        "data",
        "verdict",
        "anomalies",
        "tool",
        "process",
        "versions",
    }
    asked = " ".join(one["asked for"] for one in contents.process)
    assert all(word in asked for word in ("manual", "anomalous", "process", "qualification", "ASIL", "experience"))
    assert all((ROOT / claim.test).is_file() for claim in contents.claim if claim.measure)
    known = {*measures.PROFILE_MEASURES, *measures.FOLDER_MEASURES}
    assert {claim.measure for claim in contents.claim} - {""} == known
    assert {(use["impact"], use["detection"], use["level"]) for use in contents.tool} <= {
        ("TI2", "TD1", "TCL1"), ("TI2", "TD2", "TCL2"), ("TI2", "TD3", "TCL3"), ("TI1", "TD1", "TCL1"),
    }  # ISO 26262-8:2018, table 3  # fmt: skip


@pytest.mark.pages
def test_claims_are_computed_here_and_a_broken_one_turns_red(quick, monkeypatch, tmp_path):
    made = xl.dossier("motorway", recompute=True)
    computed = {"repeatable", "reproducible", "played", "events", "contacts"}
    assert {name for name, state in states(made).items() if state is State.HOLDS} == computed
    assert any("false alarms an hour" in words for _, words in made.parts["verdict"])
    assert not made.broken and "Broken claim" not in made.page()

    seeds = iter(range(100))
    monkeypatch.setattr(
        measures, "convert", lambda *given, **options: convert(*given, **options | {"seed": next(seeds)})
    )
    broken = xl.dossier("motorway")
    assert [finding.claim.id for finding in broken.broken] == ["repeatable"]
    page = broken.page()
    assert (
        "Broken claim: The same scenario, profile and seed give the same bytes." in page and "color:var(--bad)" in page
    )


def test_a_profile_that_states_too_much_is_broken_without_computing(read, tmp_path, capsys):
    profile = xl.read_profile("motorway")
    evaluation = {**profile.provenance.evaluation, "snippets": {"mean_ratio": 4.0}}
    edited = replace(profile, provenance=replace(profile.provenance, evaluation=evaluation))
    assert [finding.claim.id for finding in xl.dossier(edited).broken] == ["realistic"]
    from xosc_lateral.cli import main

    xl.write_profile(edited, tmp_path / "edited.json")
    assert main(["dossier", str(tmp_path / "edited.json"), "-o", str(tmp_path / "page.html"), "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["kind"] == "profile"


def test_claims_of_ones_own(read, tmp_path):
    own = tmp_path / "own.toml"
    own.write_text(
        '[[claim]]\nid = "realistic"\nabout = "profile"\nwords = "Stricter."\nmeasure = "short_ratio"\nat_most = 0.9\n'
        '[[claim]]\nid = "ours"\nwords = "Nobody knows."\n'
    )
    made = xl.dossier("motorway", claims=own)
    assert [finding.claim.words for finding in made.broken] == ["Stricter."]
    assert states(made)["ours"] is State.UNTESTED
    own.write_text('[[claim]]\nid = "a"\nwords = "b"\nmeasure = "magic"\n')
    with pytest.raises(xl.FormatError, match="no measure 'magic'; there are"):
        xl.dossier("motorway", claims=own)
    own.write_text('[[claim]]\nid = "a"\nnonsense = 1\n')
    with pytest.raises(xl.FormatError, match=r"own.toml: not a file of claims: .*nonsense"):
        xl.dossier("motorway", claims=own)


@pytest.mark.pages
def test_a_folder_and_what_was_edited_in_it(tmp_path):
    xl.write_template("braking-leader", tmp_path / "in")
    xl.convert_many(tmp_path / "in", tmp_path / "out", variants=2)
    assert states(xl.dossier(tmp_path / "out"))["complete"] is State.HOLDS
    assert states(xl.dossier(tmp_path / "out"))["intact"] is State.STATED
    assert states(xl.dossier(tmp_path / "out", recompute=True))["intact"] is State.HOLDS
    output = next((tmp_path / "out").glob("*_02.xosc"))
    output.write_text(output.read_text(encoding="utf-8").replace('speed="', 'speed="1', 1), encoding="utf-8")
    found = xl.dossier(tmp_path / "out", recompute=True)
    assert [(finding.claim.id, finding.value) for finding in found.broken] == [("intact", 1.0)]
