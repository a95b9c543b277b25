"""Outputs may change only together with `BEHAVIOUR`, by which batches know what is stale."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

import pytest

import xosc_lateral as xl
from xosc_lateral.base.version import BEHAVIOUR

GOLDEN = Path(__file__).parent / "data" / "behaviour.json"


def _outputs(folder: Path) -> dict[str, bytes]:
    """One of each kind: replayed, reactive, played, sampled."""
    cut_in, _ = xl.write_template("cut-in", folder)
    found = {}
    for name, settings in (("replay", {"ego": "none"}), ("auto", {}), ("lane-offset", {"mode": "lane-offset"})):
        xl.convert(cut_in, folder / f"{name}.xosc", seed=3, time_limit=12.0, **settings)
        found[name] = re.sub(rb"<!-- xosc-lateral provenance.*?-->", b"", (folder / f"{name}.xosc").read_bytes())
    xl.sample("motorway", duration=20.0, seed=3).to_frame().round(9).to_csv(folder / "offsets.csv", index=False)
    found["sample"] = (folder / "offsets.csv").read_bytes()
    return found


def test_bytes_change_only_together_with_the_behaviour_version(tmp_path: Path) -> None:
    """After a change that was meant: add one to `BEHAVIOUR` and write to tests/data/behaviour.json what this prints."""
    found = {name: hashlib.sha256(data).hexdigest() for name, data in _outputs(tmp_path).items()}
    now = {"behaviour": BEHAVIOUR, "sha256": found}
    golden = json.loads(GOLDEN.read_text(encoding="utf-8"))
    if golden != now:
        pytest.fail(f"bytes and behaviour version go together; now {json.dumps(now)}")
