"""A camera that misjudges a lane marking: planted errors on a known path."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from xosc_lateral.drivers.drives.drive import PAPER_RULES, Drive, cut_runs, lane_change_rows
from xosc_lateral.drivers.drives.markings import Mended, both_markings
from xosc_lateral.drivers.fitting.fitting import fit_profile
from xosc_lateral.extras.loop.identify import usable_columns
from xosc_lateral.extras.loop.timeline import join_drives
from xosc_lateral.files.drives import read_drives
from xosc_lateral.files.profiles import describe_profile

FloatArray = NDArray[np.float64]
RATE = 25.0
WIDTH = 3.5
NOISE = 0.03


@dataclass(frozen=True, eq=False)
class Camera:
    """What a camera saw of a known path: distances to both markings, with errors that may be added to."""

    time: FloatArray
    truth: FloatArray
    left: FloatArray
    right: FloatArray

    @property
    def offset(self) -> FloatArray:
        return 0.5 * (self.right - self.left)

    @property
    def lane_width(self) -> FloatArray:
        return self.left + self.right

    def rows(self, begin: float, end: float) -> slice:
        return slice(int(begin * RATE), int(end * RATE))

    def table(self) -> pd.DataFrame:
        columns = {"time": self.time, "distance_left": self.left, "distance_right": self.right}
        return pd.DataFrame({**columns, "speed": 28.0})


def camera(seed: int = 0, *, seconds: float = 300.0, noise: float = NOISE) -> Camera:
    """A driver of 0.25 m who never accelerates by more than 0.3 m/s2, and a camera's white noise on each marking."""
    rng = np.random.default_rng(seed)
    n = int(seconds * RATE)
    truth = gaussian_filter1d(rng.normal(size=n), 1.5 * RATE, mode="wrap")
    truth *= 0.25 / truth.std()
    width = WIDTH + 0.05 * np.sin(2 * np.pi * np.arange(n) / n)
    errors = noise * rng.normal(size=(2, n))
    return Camera(np.arange(n) / RATE, truth, 0.5 * width - truth + errors[0], 0.5 * width + truth + errors[1])


def misjudged(seed: int = 0) -> tuple[Camera, slice]:
    """The right marking a kerb for 4 s; the left one creeping away for 3 s and back at once; the rows between them."""
    seen = camera(seed)
    seen.right[seen.rows(60.0, 64.0)] += 0.9
    creep = seen.rows(150.0, 153.0)
    seen.left[creep] += np.linspace(0.0, 1.2, creep.stop - creep.start)
    return seen, creep


def mend_markings(time: FloatArray, offset: FloatArray, lane_width: FloatArray) -> Mended | None:
    seen = both_markings(time, offset, lane_width)
    return None if seen is None else seen.mended()


def rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_other_marking_is_followed(seed: int) -> None:
    seen, creep = misjudged(seed)
    mended = mend_markings(seen.time, seen.offset, seen.lane_width)
    assert mended is not None
    kerb = seen.rows(60.0, 64.0)
    for part, recorded in ((kerb, 0.4), (creep, 0.3)):
        assert rms((seen.offset - seen.truth)[part]) > recorded
        assert rms((mended.offset - seen.truth)[part]) < 0.1
        assert mended.kept[part].mean() > 0.95
    away = np.ones(len(seen.time), dtype=bool)
    away[kerb] = away[creep] = False
    assert rms((mended.offset - seen.truth)[away]) < 1.1 * rms((seen.offset - seen.truth)[away])
    assert np.abs(mended.lane_width - WIDTH).max() < 0.2
    assert mended.shares.one_marking == pytest.approx(7.0 / 300.0, rel=0.2)


def test_rows_without_a_marking_are_left_out() -> None:
    seen = camera(4)
    lost = seen.rows(100.0, 101.0)
    seen.left[lost] += 0.8
    seen.right[lost] += 1.4
    mended = mend_markings(seen.time, seen.offset, seen.lane_width)
    assert mended is not None
    assert not mended.kept[lost].any()
    assert mended.shares.no_marking == pytest.approx(1.0 / 300.0, rel=0.2)


def test_both_hands_are_treated_alike() -> None:
    seen, _ = misjudged(5)
    mended = mend_markings(seen.time, seen.offset, seen.lane_width)
    mirrored = mend_markings(seen.time, -seen.offset, seen.lane_width)
    assert mended is not None and mirrored is not None
    np.testing.assert_allclose(mirrored.offset, -mended.offset, atol=1e-9)
    np.testing.assert_array_equal(mirrored.kept, mended.kept)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("noise", [0.02, 0.05, 0.1])
def test_noise_alone_changes_nothing(seed: int, noise: float) -> None:
    seen = camera(seed, noise=noise)
    assert mend_markings(seen.time, seen.offset, seen.lane_width) is None


def test_a_lane_of_a_map_may_change_its_width() -> None:
    seen = camera(6, noise=0.0)
    width = np.where(seen.time < 150.0, 3.5, 3.0)
    assert mend_markings(seen.time, seen.truth, width) is None


def test_a_width_from_elsewhere_does_not_move_the_vehicle() -> None:
    """Offset from a satellite, lane width from a camera: what is wrong with one is not with the other."""
    seen, _ = misjudged(7)
    assert mend_markings(seen.time, seen.truth, seen.lane_width) is None


def test_a_lane_change_is_not_smoothed_over() -> None:
    seen, _ = misjudged(8)
    after = seen.time >= 200.0
    offset = np.where(after, seen.offset - 1.7, seen.offset) + np.where(seen.time < 200.0, 1.7, 0.0) * (
        np.clip((seen.time - 196.0) / 4.0, 0.0, 1.0) * ~after
    )
    mended = mend_markings(seen.time, offset, seen.lane_width)
    assert mended is not None
    assert abs(mended.offset[5001] - mended.offset[4998]) > 0.5 * WIDTH


@pytest.mark.parametrize(("beside", "changed"), [(0.0, False), (1.2, True), (-1.2, True)])
def test_a_lane_lost_with_a_wheel_on_the_marking_is_changed(beside: float, changed: bool) -> None:
    time = np.arange(0.0, 120.0, 0.1)
    rows = np.abs(time - 60.0) > 0.5
    offset = np.where((time > 58.0) & (time < 60.0), beside, 0.0)
    drive = Drive("d", time[rows], offset[rows], np.full(rows.sum(), WIDTH))
    assert lane_change_rows(drive).any() == changed
    lasts = [float(run.time[-1]) for run in cut_runs(drive)]
    assert lasts[0] == pytest.approx(59.4 - PAPER_RULES.lane_change_margin if changed else 59.4, abs=0.2)


def test_tables_are_mended_and_profiles_say_so(tmp_path: Path) -> None:
    seen, creep = misjudged(9)
    seen.table().to_csv(tmp_path / "phone.csv", index=False)
    (drive,) = read_drives(tmp_path / "phone.csv")
    assert drive.mended is not None
    assert rms(np.interp(seen.time[creep], drive.time, drive.offset) - seen.truth[creep]) < 0.1
    np.testing.assert_array_equal(drive.context["lane_width"], drive.lane_width)
    assert drive.half_width is not None
    kept = np.isin(seen.time, drive.time)
    np.testing.assert_allclose(drive.half_width, 0.5 * seen.lane_width[kept])
    usable = usable_columns(join_drives([drive]))
    columns, unused = usable.columns, usable.unused
    assert "lane_width" not in [column.name for column in columns]
    assert "camera" in unused["lane_width"]
    profile = fit_profile([drive], name="phone")
    assert profile.provenance.fit["one_marking"] == pytest.approx(drive.mended.one_marking, abs=1e-4)
    assert " % of the rows follow one lane marking" in describe_profile(profile)
