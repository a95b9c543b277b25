"""The laboratory's README says for each page of the documentation which script states its figures."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = re.compile(r"laboratory[./](\w+)")


def test_each_page_and_its_scripts_are_listed():
    listed = {
        page: set(re.findall(r"`(\w+)`", scripts))
        for page, scripts in re.findall(
            r"^\| \[(docs/[^\]]+)\]\([^)]*\) \| (.*) \|$", (ROOT / "laboratory" / "README.md").read_text(), re.M
        )
    }
    named = {
        page.relative_to(ROOT).as_posix(): {
            name for name in SCRIPT.findall(page.read_text()) if (ROOT / "laboratory" / f"{name}.py").is_file()
        }
        for page in sorted((ROOT / "docs").rglob("*.md"))
    }
    assert listed == {page: scripts for page, scripts in named.items() if scripts}
