"""Lifelike lateral movement for OpenSCENARIO traffic.

Everything listed in `__all__` is promised (`docs/api.md`) and loaded when it is first used.
"""

from __future__ import annotations

from xosc_lateral.version import __version__

TYPE_CHECKING = False  # importing `typing` for it would take longer than all the rest

_HOME = {
    "convert": "api.convert",
    "convert_many": "api.batch",
    "reconstruct": "api.reconstruct",
    "verify": "api.verify",
    "reproduce": "api.verify",
    "play": "api.play",
    "segments": "api.play",
    "fit": "api.fit",
    "sample": "api.sample",
    "evaluate": "api.evaluate",
    "close_loop": "api.loop",
    "read_drives": "api.fit",
    "import_drives": "api.importing",
    "read_profile": "api.profiles",
    "write_profile": "api.profiles",
    "list_profiles": "api.profiles",
    "compare_profiles": "api.profiles",
    "list_templates": "api.templates",
    "write_template": "api.templates",
    "live_esmini": "api.live",
    "live_sumo": "api.live",
    "Traffic": "live.traffic",
    "Moment": "live.traffic",
    "EsminiTraffic": "live.esmini",
    "SumoTraffic": "live.sumo",
    "export_fmu": "live.fmu",
    "LiveRun": "api.live",
    "OffsetStream": "driver.stream",
    "DriverProfile": "driver.profile",
    "Drive": "drives.drive",
    "Conversion": "api.convert",
    "Reconstruction": "api.reconstruct",
    "ConvertSettings": "pipeline.settings",
    "BatchResult": "api.batch",
    "Verification": "api.verify",
    "Playback": "api.play",
    "Segments": "api.play",
    "Offsets": "api.sample",
    "Evaluation": "api.evaluate",
    "ClosedLoop": "api.loop",
    "ImportedDrives": "api.importing",
    "XoscLateralError": "errors",
    "FormatError": "errors",
    "PlaybackError": "errors",
    "DriverProfileError": "errors",
    "NotEnoughDataError": "errors",
    "SimulationError": "errors",
}
"""Public name -> module that has it."""

__all__ = [  # noqa: RUF022 (the order of the documentation)
    "convert",
    "convert_many",
    "reconstruct",
    "verify",
    "reproduce",
    "play",
    "segments",
    "fit",
    "sample",
    "evaluate",
    "close_loop",
    "read_drives",
    "import_drives",
    "read_profile",
    "write_profile",
    "list_profiles",
    "compare_profiles",
    "list_templates",
    "write_template",
    "live_esmini",
    "live_sumo",
    "Traffic",
    "Moment",
    "EsminiTraffic",
    "SumoTraffic",
    "export_fmu",
    "LiveRun",
    "OffsetStream",
    "DriverProfile",
    "Drive",
    "Conversion",
    "Reconstruction",
    "ConvertSettings",
    "BatchResult",
    "Verification",
    "Playback",
    "Segments",
    "Offsets",
    "Evaluation",
    "ClosedLoop",
    "ImportedDrives",
    "XoscLateralError",
    "FormatError",
    "PlaybackError",
    "DriverProfileError",
    "NotEnoughDataError",
    "SimulationError",
    "__version__",
]

if TYPE_CHECKING:
    from xosc_lateral.api.batch import BatchResult, convert_many
    from xosc_lateral.api.convert import Conversion, convert
    from xosc_lateral.api.evaluate import Evaluation, evaluate
    from xosc_lateral.api.fit import fit, read_drives
    from xosc_lateral.api.importing import ImportedDrives, import_drives
    from xosc_lateral.api.live import LiveRun, live_esmini, live_sumo
    from xosc_lateral.api.loop import ClosedLoop, close_loop
    from xosc_lateral.api.play import Playback, Segments, play, segments
    from xosc_lateral.api.profiles import compare_profiles, list_profiles, read_profile, write_profile
    from xosc_lateral.api.reconstruct import Reconstruction, reconstruct
    from xosc_lateral.api.sample import Offsets, sample
    from xosc_lateral.api.templates import list_templates, write_template
    from xosc_lateral.api.verify import Verification, reproduce, verify
    from xosc_lateral.driver.profile import DriverProfile
    from xosc_lateral.driver.stream import OffsetStream
    from xosc_lateral.drives.drive import Drive
    from xosc_lateral.errors import (
        DriverProfileError,
        FormatError,
        NotEnoughDataError,
        PlaybackError,
        SimulationError,
        XoscLateralError,
    )
    from xosc_lateral.live.esmini import EsminiTraffic
    from xosc_lateral.live.fmu import export_fmu
    from xosc_lateral.live.sumo import SumoTraffic
    from xosc_lateral.live.traffic import Moment, Traffic
    from xosc_lateral.pipeline.settings import ConvertSettings


def __getattr__(name: str) -> object:
    """Load a public name."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Public names."""
    return sorted(__all__)
