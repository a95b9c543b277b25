"""Lifelike lateral movement for OpenSCENARIO traffic.

Everything listed in `__all__` is promised (`docs/api.md`) and loaded when it is first used.
"""

from __future__ import annotations

from xosc_lateral.base.version import __version__

TYPE_CHECKING = False  # importing `typing` for it would take longer than all the rest

_HOME = {
    "convert": "workflows.conversion.convert",
    "convert_many": "workflows.batch.call",
    "verify": "workflows.batch.verify",
    "reproduce": "workflows.batch.verify",
    "play": "workflows.playing.call",
    "segments": "workflows.playing.call",
    "fit": "workflows.profiles.fit",
    "sample": "workflows.profiles.sample",
    "evaluate": "workflows.profiles.fit",
    "check": "workflows.profiles.health",
    "read_drives": "workflows.profiles.fit",
    "read_profile": "workflows.profiles.profiles",
    "write_profile": "workflows.profiles.profiles",
    "list_profiles": "workflows.profiles.profiles",
    "compare_profiles": "workflows.profiles.profiles",
    "list_templates": "workflows.playing.templates",
    "write_template": "workflows.playing.templates",
    "OffsetStream": "drivers.model.stream",
    "DriverProfile": "drivers.model.profile",
    "Drive": "drivers.drives.drive",
    "Conversion": "workflows.conversion.conversion",
    "ConvertSettings": "workflows.conversion.settings",
    "BatchResult": "workflows.batch.call",
    "Verification": "workflows.batch.verify",
    "Playback": "workflows.playing.call",
    "Segments": "workflows.playing.call",
    "Offsets": "workflows.profiles.sample",
    "Evaluation": "workflows.profiles.evaluation_page",
    "Health": "workflows.profiles.health",
    "XoscLateralError": "base.errors",
    "FormatError": "base.errors",
    "PlaybackError": "base.errors",
    "DriverProfileError": "base.errors",
    "NotEnoughDataError": "base.errors",
    "SimulationError": "base.errors",
}
"""Public name -> module that has it; those of extras are found when they are asked for."""

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
    "plan_loop",
    "detect",
    "dossier",
    "check",
    "read_drives",
    "import_drives",
    "read_maneuvers",
    "read_profile",
    "write_profile",
    "list_profiles",
    "compare_profiles",
    "list_templates",
    "write_template",
    "vary",
    "live_esmini",
    "live_sumo",
    "Traffic",
    "Moment",
    "EsminiTraffic",
    "SumoTraffic",
    "export_c",
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
    "LoopPlan",
    "Health",
    "Detection",
    "Sight",
    "Variations",
    "Dossier",
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
    from collections.abc import Callable
    from typing import Any

    from xosc_lateral.base.errors import (
        DriverProfileError,
        FormatError,
        NotEnoughDataError,
        PlaybackError,
        SimulationError,
        XoscLateralError,
    )
    from xosc_lateral.drivers.drives.drive import Drive
    from xosc_lateral.drivers.model.profile import DriverProfile
    from xosc_lateral.drivers.model.stream import OffsetStream
    from xosc_lateral.extras.detect.call import detect
    from xosc_lateral.extras.detect.detection import Detection
    from xosc_lateral.extras.detect.sight import Sight
    from xosc_lateral.extras.detect.vary import Variations, vary
    from xosc_lateral.extras.dossier.call import Dossier, dossier
    from xosc_lateral.extras.live.call import LiveRun, live_esmini, live_sumo
    from xosc_lateral.extras.live.esmini import EsminiTraffic
    from xosc_lateral.extras.live.export import export_c, export_fmu
    from xosc_lateral.extras.live.sumo import SumoTraffic
    from xosc_lateral.extras.live.traffic import Moment, Traffic
    from xosc_lateral.extras.loop.call import ClosedLoop, LoopPlan, close_loop, plan_loop
    from xosc_lateral.extras.recordings.importers import ImportedDrives, import_drives
    from xosc_lateral.extras.recordings.reconstruct import read_maneuvers, reconstruct
    from xosc_lateral.extras.recordings.reconstruction import Reconstruction
    from xosc_lateral.workflows.batch.call import BatchResult, convert_many
    from xosc_lateral.workflows.batch.verify import Verification, reproduce, verify
    from xosc_lateral.workflows.conversion.conversion import Conversion
    from xosc_lateral.workflows.conversion.convert import convert
    from xosc_lateral.workflows.conversion.settings import ConvertSettings
    from xosc_lateral.workflows.playing.call import Playback, Segments, play, segments
    from xosc_lateral.workflows.playing.templates import list_templates, write_template
    from xosc_lateral.workflows.profiles.evaluation_page import Evaluation
    from xosc_lateral.workflows.profiles.fit import evaluate, fit, read_drives
    from xosc_lateral.workflows.profiles.health import Health, check
    from xosc_lateral.workflows.profiles.profiles import compare_profiles, list_profiles, read_profile, write_profile
    from xosc_lateral.workflows.profiles.sample import Offsets, sample


def __getattr__(name: str) -> object:
    """Load a public name."""
    from importlib import import_module
    from types import FunctionType

    if name in _HOME:
        home = f"{__name__}.{_HOME[name]}"
    else:
        from xosc_lateral.base.plugins import offered

        home = "" if name.startswith("_") else offered("CALLS").get(name, "")
        if not home:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(home), name)
    globals()[name] = in_python(value) if isinstance(value, FunctionType) else value
    return globals()[name]


def in_python(call: Callable[..., Any]) -> Callable[..., Any]:
    """A call as Python's users have it: its errors name keywords where the command line names options."""
    from functools import wraps

    from xosc_lateral.base.errors import XoscLateralError

    @wraps(call)
    def called(*args: Any, **kwargs: Any) -> Any:
        try:
            return call(*args, **kwargs)
        except XoscLateralError as error:
            if error.typed is None:  # else a call within this one has said it
                from xosc_lateral.workflows.options import as_keywords

                options = {**getattr(call, "__settings__", {}), **getattr(call, "__options__", {})}
                error.typed, error.args = str(error), (as_keywords(str(error), options), *error.args[1:])
            raise

    called.__module__ = __name__  # where it is found again, by another process
    return called


def __dir__() -> list[str]:
    """Public names."""
    return sorted(__all__)
