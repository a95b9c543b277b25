"""An example of a plug-in for xosc-lateral: see pyproject.toml for what it offers."""

from __future__ import annotations

from functools import cache
from pathlib import Path

TEMPLATES = Path(__file__).parent / "templates"
"""Plain scenarios with their roads."""


@cache
def profiles() -> Path:
    """Folder of driver profiles; made anew by each process, so that they are of the package that is installed now."""
    import tempfile

    import xosc_lateral as xl

    folder = Path(tempfile.gettempdir()) / "xosc-lateral-acme"
    folder.mkdir(exist_ok=True)
    calm = xl.read_profile("motorway").with_effects(name="acme-calm")
    xl.write_profile(calm, folder / "acme-calm.json", force=True)
    return folder
