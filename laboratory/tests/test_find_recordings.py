"""The machines of recordings and drivers find what is planted, and nothing that is not known on fixed seeds."""

from __future__ import annotations

import pytest

from laboratory.find.drivers import Drivers
from laboratory.find.engine import find, kind_of, shrink, spec_of
from laboratory.find.recordings import Recordings

pytestmark = [pytest.mark.filterwarnings("ignore"), pytest.mark.pages]


def test_nothing_is_read_wrongly_in_silence() -> None:
    machine = Recordings()
    found = [one for seed in range(500, 560) for one in machine.look(spec_of(machine, seed))]
    assert not [one for one in found if not one["said"]]
    spec = spec_of(machine, 501)
    assert spec == spec_of(machine, 501) and machine.look(spec) == machine.look(spec)


def test_evidence_that_is_gone_is_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without what the importers hold of sizes, lengths in cm are found, and made smaller."""
    monkeypatch.setattr("xosc_lateral.extras.recordings.importers.track_table.evidence.of_sizes", lambda *_: None)
    machine = Recordings()
    for seed in range(1000):
        spec = spec_of(machine, seed)
        if spec["bend"] == "lengths in cm":
            break
    found = [one for one in machine.look(spec) if one["stage"] == "lengths in cm"]
    assert found
    small, again = shrink(machine, spec, found[0], 8)
    assert machine.size(small) == 0.0 and kind_of(again) == kind_of(found[0])


def test_a_fit_that_moves_too_much_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    from msgspec.structs import replace

    import xosc_lateral as xl
    from xosc_lateral.drivers.model.effects import Adapted

    fit = xl.fit
    machine = Drivers("fit")
    spec = {"what": "fit", "kind": "ornstein_uhlenbeck", "seed": 5, "count": 8, "seconds": 200}
    assert machine.look(spec) == []
    louder = Adapted(spread=1.8, fine=1.8)
    monkeypatch.setattr("xosc_lateral.fit", lambda *given, **how: replace(fit(*given, **how), effects=(louder,)))
    assert {one["kind"] for one in machine.look(spec)} >= {"spread does not come back"}


def test_a_table_of_kinds_is_left(tmp_path: pytest.TempPathFactory) -> None:
    rows = find(Recordings(), tmp_path, 600.0, 22, most=2)
    assert len((tmp_path / "recordings.jsonl").read_text().splitlines()) == 2
    assert rows and all(row.startswith("| recordings |") for row in rows)
