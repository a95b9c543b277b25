"""The page of the library is what `make profiles` writes of the shipped profiles."""

from __future__ import annotations

from pathlib import Path

from benchmarks.build_library import library_page
from xosc_lateral.formats.profiles import read_profile

ROOT = Path(__file__).resolve().parents[2]


def test_the_page_is_that_of_the_shipped_profiles() -> None:
    paths = sorted((ROOT / "driver_profiles").glob("*.json"))
    page = library_page([read_profile(path) for path in paths])
    assert page == (ROOT / "docs" / "profiles.md").read_text(encoding="utf-8")
    assert page.count("\n| `") == len(paths)
