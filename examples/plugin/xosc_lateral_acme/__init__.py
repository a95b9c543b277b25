"""An example of a plug-in for xosc-lateral: see pyproject.toml for what it offers."""

from __future__ import annotations

from pathlib import Path

TEMPLATES = Path(__file__).parent / "templates"
"""Plain scenarios with their roads."""


def profiles() -> Path:
    """Folder of driver profiles; made when it is first asked for, so that the files need not be shipped."""
    import tempfile

    import xosc_lateral as xl

    folder = Path(tempfile.gettempdir()) / "xosc-lateral-acme"
    folder.mkdir(exist_ok=True)
    if not (folder / "acme-calm.json").exists():
        calm = xl.read_profile("motorway").with_effects(name="acme-calm")
        xl.write_profile(calm, folder / "acme-calm.json")
    return folder
