"""Snippets of measured runs and sampled ones beside them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

import xosc_lateral as xl
from examples.driver_simulator import simulate_drive
from tests.kit.profiles import as_drive, simulated_profile
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.drives.drive import Drive, all_runs, lane_change_rows
from xosc_lateral.drivers.model.sampled_offsets import cut_snippets, sample_context, sample_free, sample_like
from xosc_lateral.drivers.model.validity import Validity
from xosc_lateral.files.drives import read_drives


@pytest.fixture(scope="module")
def drives() -> list[Drive]:
    return [as_drive(simulate_drive(300.0, seed).table, f"drive-{seed}") for seed in (1, 2)]


def test_snippets_of_ten_seconds_have_51_values_and_lie_in_one_run(drives: list[Drive]) -> None:
    snippets = cut_snippets(all_runs(drives), 10.0)
    assert {len(snippet.time) for snippet in snippets} == {51}
    assert all(np.allclose(np.diff(snippet.time), 0.2) for snippet in snippets)
    for drive in drives:
        own = [snippet for snippet in snippets if snippet.run.drive == drive.name]
        assert [snippet.index for snippet in own] == list(range(len(own)))
        assert (np.diff([snippet.time[0] for snippet in own]) >= 10.2 - 1e-9).all()


@pytest.mark.parametrize("model", ["two-level", "best"])
def test_each_sampled_snippet_starts_where_its_real_one_starts(model: str, drives: list[Drive]) -> None:
    made = list(sample_like(simulated_profile(model), drives, 10.0, 1))
    assert len(made) == len(cut_snippets(all_runs(drives), 10.0))
    for item in made:
        assert item.offset_real is not None
        assert len(item.offset) == len(item.offset_real) == 51
        assert item.offset[0] == pytest.approx(item.offset_real[0], abs=1e-9)


def test_sampled_snippets_do_not_depend_on_the_drives_beside_them(drives: list[Drive]) -> None:
    profile = simulated_profile()
    alone = list(sample_like(profile, drives[:1], 10.0, 1))
    both = list(sample_like(profile, drives, 10.0, 1))
    assert all(np.array_equal(a.offset, b.offset) for a, b in zip(alone, both, strict=False))


def test_a_free_run_covers_the_drive_but_for_its_lane_changes(drives: list[Drive]) -> None:
    runs = list(sample_context(simulated_profile(), drives, 1))
    for drive in drives:
        own = [run for run in runs if run.drive == drive.name]
        changes = lane_change_rows(drive)
        assert changes.any() and len(own) > 1
        assert own[0].time[0] == drive.time[0] and drive.time[-1] - own[-1].time[-1] < 0.2 + 1e-9
        covered = np.concatenate([run.time for run in own])
        changing = drive.time[changes]
        assert np.abs(covered - changing[len(changing) // 2]).min() > 1.0
        assert len(covered) == pytest.approx((~changes).sum() * np.median(np.diff(drive.time)) / 0.2, rel=0.02)
        assert all(np.isfinite(run.offset).all() for run in own)


@pytest.mark.pages
def test_sampled_tables_are_fitted_as_they_are(drives: list[Drive], tmp_path: Path) -> None:
    """Without a step at lane changes: no lateral speed of metres a second."""
    profile, width = simulated_profile(), float(np.median(np.concatenate([drive.lane_width for drive in drives])))
    for kind in ("context", "like"):
        table = tmp_path / f"{kind}.csv"
        xl.sample(profile, **{kind: drives}, seed=1).write(table)
        again = xl.fit(table, name="again", neighbours=False)
        assert again.provenance.drives == len(drives)
        assert again.validity.speed is not None and again.lane_width == pytest.approx(width, abs=0.05)
        steps = [np.abs(np.diff(run.offset)).max() for run in all_runs(read_drives(table))]
        assert max(steps) < 0.2


def test_a_free_run_of_a_duration_has_its_length_and_the_profiles_lane() -> None:
    profile = simulated_profile()
    profile = replace(profile, validity=Validity())
    (run,) = sample_free(profile, 60.0, 1)
    (wide,) = sample_free(profile, 60.0, 1, lane_width=2 * profile.lane_width)
    assert len(run.time) == 301
    assert np.allclose(wide.offset, 2 * run.offset)


def test_too_short_runs_are_refused(drives: list[Drive]) -> None:
    with pytest.raises(NotEnoughDataError, match="a snippet needs 5000 s"):
        cut_snippets(all_runs(drives), 5000.0)
