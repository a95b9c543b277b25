"""Figures that claims are tested by: each computed anew, here."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple, cast

import numpy as np

from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.extras.detect.call import detect
from xosc_lateral.extras.detect.detection import Detection
from xosc_lateral.extras.dossier.claims import Measure
from xosc_lateral.files.profiles import write_profile
from xosc_lateral.workflows.batch.manifest import ManifestRow
from xosc_lateral.workflows.batch.page import has_new_contact
from xosc_lateral.workflows.batch.verify import verify
from xosc_lateral.workflows.conversion.conversion import Conversion
from xosc_lateral.workflows.conversion.convert import convert
from xosc_lateral.workflows.playing.call import play
from xosc_lateral.workflows.playing.templates import write_template
from xosc_lateral.workflows.profiles.evaluation_page import Evaluation
from xosc_lateral.workflows.profiles.fit import evaluate
from xosc_lateral.workflows.result import DrivesLike

TEMPLATES = ("cut-in", "overtake-truck", "dense-traffic")
"""Shipped scenarios that claims are tried on: a vehicle under test that is cut in on, curves and trucks, ten cars."""

SEEDS = (1, 2)

DETECTED_VARIANTS = 5
"""Lifelike variants of each template, in which detectors count."""


class ProfileBench:
    """A profile at work on the shipped scenarios; what several figures need is made once."""

    def __init__(self, profile: DriverProfile, data: DrivesLike | None) -> None:
        self.profile, self._data = profile, data

    @cached_property
    def conversions(self) -> list[tuple[Conversion, Conversion]]:
        """Each template and seed, converted twice; scenarios and roads in memory."""
        made = []
        with TemporaryDirectory() as folder:
            for name in TEMPLATES:
                scenario, road = (path.read_bytes() for path in write_template(name, folder))
                for seed in SEEDS:
                    pair = [convert(scenario, road=road, profile=self.profile, seed=seed) for _ in range(2)]
                    made.append((pair[0], pair[1]))
        return made

    @cached_property
    def evaluation(self) -> Evaluation | None:
        """On the drives that are given."""
        return None if self._data is None else evaluate(self.profile, self._data, classify=False)

    @cached_property
    def detection(self) -> Detection:
        """What the built-in detectors do on the templates, as written and lifelike."""
        with TemporaryDirectory() as folder:
            for name in TEMPLATES:
                write_template(name, Path(folder) / "templates")
            library, name = Path(folder) / "library", self.profile.name
            library.mkdir()
            write_profile(self.profile, library / f"{name}.json")
            sources, variants = Path(folder) / "templates", DETECTED_VARIANTS
            detection = detect(sources, ego="none", variants=variants, profiles=(name,), library=(library,))
            return cast("Detection", detection)


def _not_reproduced(bench: ProfileBench) -> float:
    with TemporaryDirectory() as folder:
        scenario, _ = write_template(TEMPLATES[0], folder)
        profile = Path(folder) / "profile.json"
        write_profile(bench.profile, profile)
        outputs = [Path(folder) / f"lifelike_{seed}.xosc" for seed in SEEDS]
        for seed, output in zip(SEEDS, outputs, strict=True):
            convert(scenario, output, profile=profile, seed=seed)
        return float(len(verify(outputs, workers=0).failing))


def _playback_error(bench: ProfileBench) -> float:
    """Largest distance between where a vehicle was sampled to be and where the output plays it. [m]"""
    errors = []
    for made, _ in bench.conversions:
        played = play(made.data, road=made.road).to_frame()
        both = made.to_frame().merge(played, on=["time", "name"], suffixes=("", "_played"))
        errors.append(float(np.hypot(both["x"] - both["x_played"], both["y"] - both["y_played"]).max()))
    return max(errors)


def _event_shift(bench: ProfileBench) -> float:
    shifts = [shift for made, _ in bench.conversions for shift in made.shifts]
    return max((abs(value) for one in shifts for value in (one.unexplained_start, one.unexplained_end)), default=0.0)


def _number_at(evaluation: Mapping[str, Any], snippets: str) -> float | None:
    """Mean ratio of snippets in plain values that anybody may have written; None where there is none."""
    values = evaluation.get(snippets)
    ratio = values.get("mean_ratio") if isinstance(values, Mapping) else None
    return float(ratio) if isinstance(ratio, int | float) else None


PROFILE_MEASURES: Mapping[str, Measure] = {
    "differing_outputs": lambda bench: float(sum(first.data != second.data for first, second in bench.conversions)),
    "not_reproduced": _not_reproduced,
    "playback_error": _playback_error,
    "event_shift": _event_shift,
    "new_trouble": lambda bench: float(sum(made.movement.trouble for made, _ in bench.conversions)),
    "short_ratio": lambda bench: bench.evaluation and bench.evaluation.ratio,
    "long_ratio": lambda bench: bench.evaluation and _number_at(bench.evaluation.to_dict(), "long_snippets"),
}


COMPUTED = tuple(PROFILE_MEASURES)
"""Of a profile, without being asked: half a minute."""


def stated_by(profile: DriverProfile) -> dict[str, float]:
    """What a profile says of its own evaluation, by measure."""
    places = {"short_ratio": "snippets", "long_ratio": "long_snippets"}
    figures = {name: _number_at(profile.provenance.evaluation, place) for name, place in places.items()}
    return {name: value for name, value in figures.items() if value is not None}


class FolderBench(NamedTuple):
    """A folder of outputs, and its manifest."""

    folder: Path
    rows: tuple[ManifestRow, ...]


FOLDER_MEASURES: Mapping[str, Measure] = {
    "failed_outputs": lambda bench: float(sum(bool(row.error) for row in bench.rows)),
    "outputs_that_differ": lambda bench: float(len(verify(bench.folder, workers=0).failing)),
    "outputs_with_new_contacts": lambda bench: float(sum(map(has_new_contact, bench.rows))),
}

READ_FROM_MANIFEST = ("failed_outputs", "outputs_with_new_contacts")
"""What is known of a folder without making its outputs again."""
