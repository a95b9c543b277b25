"""What a page may run: its own scripts."""

from __future__ import annotations

import base64
import hashlib
import re
from pathlib import Path

import xosc_lateral as xl


def test_a_page_runs_its_own_scripts_and_nothing_else(tmp_path: Path) -> None:
    scenario, _ = xl.write_template("cut-in", tmp_path)
    page = xl.play(scenario, time_limit=1.0).page()
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    assert policy is not None
    assert "default-src 'none'" in policy[1]
    scripts = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    expected = [f"'sha256-{base64.b64encode(hashlib.sha256(one.encode()).digest()).decode()}'" for one in scripts]
    said = re.search(r"script-src ([^;]*)", policy[1])
    assert expected and said is not None and said[1].split() == expected
    assert not re.search(r"<[^>]+\son\w+=", re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL))
