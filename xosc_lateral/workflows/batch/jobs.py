"""A batch as a list of jobs, every output with its place in the tree and its settings; and what makes one of them."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from xosc_lateral.base.errors import FormatError, XoscLateralError
from xosc_lateral.base.limits import BATCH_JOBS, VARIANTS
from xosc_lateral.base.version import BEHAVIOUR, __version__
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.files.atomic import make_own_folder, together, write_atomically
from xosc_lateral.files.openscenario.references import require_folders
from xosc_lateral.files.output_paths import numbered, real_path
from xosc_lateral.files.profiles import find_profile, profile_hash
from xosc_lateral.files.source import file_hash
from xosc_lateral.workflows.batch.manifest import ManifestRow, printable
from xosc_lateral.workflows.batch.request import DocumentKind, Request, concrete, document_kind, find_requests
from xosc_lateral.workflows.conversion.settings import AUTO, AUTO_PROFILE, ConvertSettings

if TYPE_CHECKING:
    from xosc_lateral.workflows.conversion.conversion import Conversion


@dataclass(frozen=True, slots=True)
class Job:
    """One output to make; plain values, so that it can be sent to another process. Paths are absolute."""

    name: str  # path of the output below the output folder, with forward slashes: names its row in the manifest
    scenario: str  # path of the input below `base`, with forward slashes
    source: Path
    output: Path
    base: Path  # folder that the output tree mirrors
    settings: ConvertSettings
    variant: int
    fingerprint: str  # SHA-256 over all but the input files and the program that decides on the output's bytes
    error: str = ""  # why it can't even be tried (a distribution that can't be read)
    page: Path | None = None  # where a report page about it is written, and its thumbnail beside that
    labels: bool = False  # tags and quality result are written beside the output
    package_version: str = __version__  # of the process that planned it: a worker with another one refuses

    def row(self, error: str = "") -> ManifestRow:
        """Its row as far as it is known before the conversion; no hash of a scenario that can't be read."""
        return ManifestRow(
            output=self.name,
            scenario=self.scenario,
            scenario_sha256=_hash_or(self.source, ""),
            variant=self.variant + 1,
            seed=self.settings.seed,
            profile=self.settings.profile if isinstance(self.settings.profile, str) else self.settings.profile.name,
            parameters=dict(sorted(self.settings.parameters.items())),
            settings=self.fingerprint,
            package_version=self.package_version,
            behaviour=BEHAVIOUR,
            with_sensor=self.settings.with_sensor,
            player=self.settings.player.value,
            only=None if self.settings.only is None else tuple(sorted(self.settings.only)),
            options=self.settings.record(self.source.parent),
            error=error,
        )


@dataclass(frozen=True, slots=True)
class Batch:
    """What `convert_many` does. Paths are absolute."""

    folder: Path
    base: Path  # folder that the output tree mirrors
    jobs: tuple[Job, ...]  # by name
    left_out: tuple[tuple[Path, DocumentKind], ...] = ()  # found, but catalogs, or outputs of former conversions
    notes: tuple[str, ...] = ()  # what a user has to know before it begins, a line each
    shard: str = ""  # which part of the whole: "2-of-8"
    elsewhere: frozenset[str] = frozenset()  # names of the jobs of other parts

    def __len__(self) -> int:
        return len(self.jobs)

    def part(self, number: int, count: int) -> Batch:
        """One of `count` parts, from 1. Neighbours by name stay together: variants of a scenario are played once."""
        begin, end = (len(self) * edge // count for edge in (number - 1, number))
        others = frozenset(job.name for job in (*self.jobs[:begin], *self.jobs[end:]))
        return replace(self, jobs=self.jobs[begin:end], shard=f"{number}-of-{count}", elsewhere=others)


def plan_batch(
    inputs: Sequence[str | Path | Request],
    folder: str | Path,
    settings: ConvertSettings | None = None,
    *,
    variants: int = 1,
    report: str | Path | None = None,
    labels: bool = False,
) -> Batch:
    """Plan a batch; nothing is converted or written yet.

    - `inputs`: files, folders, globs, tables (see `find_requests`), or requests with `settings` of their own
    - `folder`: output tree. It mirrors the inputs below their common folder: ``db/a/x.xosc`` of the input ``db``
      becomes ``folder/a/x.xosc``, of its `variants` the first ``x_01.xosc``, the first scenario of a parameter value
      distribution ``x_p00000.xosc``, a row of a table with settings of its own ``x_PROFILE_HASH.xosc``: its profile,
      and a hash of what else it says
    - `report`: folder for a report page per output, in a tree like that of the outputs; `labels`: see `Job`

    Raises `FormatError`: an input or allowed folder that isn't there, two inputs with the same output, an output on top
    of an input; `DriverProfileError`: a profile that is unknown.
    """
    settings = settings or ConvertSettings()
    require_folders(settings.allow)
    for name in (settings.profile, *settings.entity.values()):
        if isinstance(name, str) and name != AUTO:
            file_hash(find_profile(name, settings.library))  # wrong for all is said once, wrong in a table's row there
    root = _normal(Path(folder))
    listed = ([it] if isinstance(it, Request) else find_requests(it, settings, variants, root) for it in inputs)
    requests = [_absolute(request) for part in listed for request in part]
    base = _common_folder(requests)
    fingerprints = Fingerprints()
    jobs: dict[str, Job] = {}
    left_out: list[tuple[Path, DocumentKind]] = []
    asked: dict[Path, set[tuple[str, int, str]]] = {}
    for request in requests:
        if request.variants > VARIANTS.value:
            raise FormatError(VARIANTS.refusal(request.variants), path=request.scenario)
        kind = document_kind(request.scenario)
        if kind in (DocumentKind.CATALOG, DocumentKind.CONVERTED) and not request.listed:
            left_out.append((request.scenario, kind))
            continue
        before = asked.setdefault(request.scenario, set())
        key = (fingerprints.of(request.settings, 0), request.variants, request.name)
        if key in before:
            continue  # named twice, by a folder and by itself, say
        before.add(key)
        for job in _jobs(request, kind, base, root, fingerprints):
            earlier = jobs.setdefault(job.name, job)
            if earlier is not job:
                if earlier.source == job.source and earlier.fingerprint == job.fingerprint:
                    continue  # the first variants of more
                what = f"would be written twice: from {earlier.scenario} and from {job.scenario}"
                what += " with other settings; a column `name` tells them apart" if earlier.source == job.source else ""
                raise FormatError(what, path=job.output)
            if len(jobs) > BATCH_JOBS.value:
                raise FormatError(BATCH_JOBS.refusal(len(jobs)), path=request.scenario)
    sources, folders = set(map(os.path.realpath, {job.source for job in jobs.values()})), dict[Path, str]()
    for job in jobs.values():
        if real_path(job.output, folders) in sources:
            raise FormatError("is an input: choose another output folder", path=job.output)
    planned = [replace(jobs[name], labels=labels) for name in sorted(jobs)]
    if report is not None:
        pages = _normal(Path(report))
        planned = [replace(job, page=(pages / job.name).with_suffix(".html")) for job in planned]
    libraries = dict.fromkeys(request.settings.library for request in requests if request.settings.uses_auto)
    notes = dict[str, None]()
    if libraries:
        from xosc_lateral.workflows.conversion.plan import hidden_by_libraries

        notes = dict.fromkeys(note for folders in libraries for note in hidden_by_libraries(folders))
    return Batch(root, base, tuple(planned), tuple(left_out), tuple(notes))


def _absolute(request: Request) -> Request:
    scenario = _normal(request.scenario)
    base = scenario.parent if request.base is None else _normal(request.base)
    return replace(request, scenario=scenario, base=base if base in scenario.parents else scenario.parent)


def _normal(path: Path) -> Path:
    """Absolute, without dots; symbolic links stay, for the tree mirrors names."""
    return Path(os.path.normpath(path.absolute()))


def _common_folder(requests: Sequence[Request]) -> Path:
    bases = {str(request.base) for request in requests}
    if not bases:
        return Path.cwd()
    try:
        return Path(os.path.commonpath(bases))
    except ValueError as error:  # two drives of a Windows machine
        raise FormatError(f"inputs have no folder in common: {', '.join(sorted(bases)[:3])}") from error


def _jobs(request: Request, kind: DocumentKind, base: Path, root: Path, fingerprints: Fingerprints) -> Iterator[Job]:
    relative = request.scenario.relative_to(base)
    stem = request.name.removesuffix(relative.suffix) or f"{relative.stem}{request.label}"
    for number, (source, suffix, settings, error) in enumerate(concrete(request, kind)):
        named = relative.with_name(f"{stem}{suffix}{relative.suffix}")
        scenario = printable(Path(os.path.relpath(source, base)).as_posix())
        for variant in range(request.variants):
            output = numbered(named, variant, request.variants)
            index = number * request.variants + variant  # each set of parameters has drives of its own
            name = printable(output.as_posix())
            if name != output.as_posix():
                error = error or f"{printable(str(source))}: the file's name is not valid UTF-8; rename it"
            yield Job(
                name=name,
                scenario=scenario,
                source=source,
                output=root / output,
                base=base,
                settings=settings,
                variant=index,
                fingerprint=fingerprints.of(settings, index),
                error=error,
            )


@dataclass(slots=True)
class Fingerprints:
    """SHA-256 over everything but the input files that decides on an output's bytes, as it is now.

    Files that settings name count by their bytes, not by their place.
    """

    _profiles: dict[tuple[str, tuple[Path, ...]], str] = field(default_factory=dict)
    _last: tuple[ConvertSettings, dict[str, str]] | None = None

    def of(self, settings: ConvertSettings, variant: int) -> str:
        """Of settings and a variant, from 0."""
        if self._last is None or self._last[0] is not settings:  # variants come one after another
            self._last = settings, self._texts(settings)
        texts = self._last[1] | {"variant": str(variant)}
        text = ", ".join(f'"{name}": {texts[name]}' for name in sorted(texts))
        return hashlib.sha256(f"{{{text}}}".encode()).hexdigest()

    def _texts(self, settings: ConvertSettings) -> dict[str, str]:
        """JSON of each setting."""
        values = settings.record(Path()) | {"strict": settings.strict}
        values["profile"] = self._profile(settings.profile, settings.library)
        values["entity"] = {name: self._profile(one, settings.library) for name, one in settings.entity.items()}
        stated = {name: getattr(settings, name) for name in values}
        values |= {name: _hash_or(path, MISSING_HASH) for name, path in stated.items() if isinstance(path, Path)}
        return {name: json.dumps(value, sort_keys=True) for name, value in values.items()}

    def _profile(self, name: str | DriverProfile, libraries: tuple[Path, ...]) -> str:
        if isinstance(name, DriverProfile):
            return profile_hash(name)
        key = (name, libraries)
        if key not in self._profiles:
            try:  # "auto": that of what it chooses
                path = find_profile(AUTO_PROFILE if name == AUTO else name, libraries)
                self._profiles[key] = _hash_or(path, MISSING_HASH)
            except (XoscLateralError, OSError):
                self._profiles[key] = MISSING_HASH
        return self._profiles[key]


def _hash_or(path: Path, otherwise: str) -> str:
    """Hash of a file; something else where it can't be read."""
    try:
        return file_hash(path)
    except (FormatError, OSError):
        return otherwise


MISSING_HASH = "missing"
"""In place of the hash of a file that can't be read: its conversion says why, and the others go on."""


def convert_job(job: Job) -> ManifestRow:
    """Convert and describe; `XoscLateralError`: the input is at fault, `OSError`: the output can't be written."""
    from xosc_lateral.workflows.conversion.convert import convert_scenario  # what has nothing to do needs none of it

    _refuse_changes(job)
    for path in filter(None, (job.output, job.page)):
        make_own_folder(path.parent, depth=job.name.count("/"))
    with together():
        conversion = convert_scenario(job.source, job.output, job.settings, variant_index=job.variant)
        _refuse_changes(job)
        if job.labels:
            conversion.write_labels(job.output, force=True)
        if job.page is not None:
            from xosc_lateral.workflows.conversion.page import conversion_page
            from xosc_lateral.workflows.playing.figures import thumbnail

            write_atomically(job.page.with_suffix(".svg"), thumbnail(conversion.movement))  # its sign in the index
            write_atomically(job.page, conversion_page(conversion))
    return _described(job, conversion)


def _refuse_changes(job: Job) -> None:
    """The row states the profiles and the context table that the run was planned with."""
    if Fingerprints().of(job.settings, job.variant) != job.fingerprint:
        raise FormatError("profile or context table changed during the run; run it again", path=job.source)


def _described(job: Job, conversion: Conversion) -> ManifestRow:
    """A conversion as a row: numbers and hashes, nothing that keeps its arrays alive."""
    enriched, provenance = conversion.movement, conversion.provenance
    before, after = (None if gap is None else _rounded(gap) for gap in conversion.smallest_gap)
    inputs = {
        Path(os.path.relpath(os.path.normpath(job.source.parent / name), job.base)).as_posix(): sha256
        for name, sha256 in sorted(provenance.inputs.items())
    }
    road = next((name for name in inputs if name.lower().endswith(".xodr")), "")
    offsets = [segment.offset for entity in enriched.entities for segment in entity.segments]
    return replace(
        job.row(),
        scenario_sha256=provenance.inputs.get(job.source.name, ""),
        output_sha256=conversion.sha256,
        road=road,
        road_sha256=inputs.get(road, ""),
        inputs=inputs,
        profiles={entity: name for entity, (name, _) in sorted(provenance.profiles.items())},
        profile_sha256=dict(sorted(provenance.profiles.values())),
        entities=len(enriched.entities),
        enriched=tuple(entity.name for entity in enriched.entities if entity.is_enriched),
        why_not={entity.name: entity.why for entity in enriched.entities if not entity.is_enriched},
        segment_seconds=_rounded(sum(entity.segment_seconds for entity in enriched.entities)),
        offset_spread=_rounded(np.std(np.concatenate(offsets))) if offsets else 0.0,
        gap_before=before,
        gap_after=after,
        trial_contacts=len(conversion.trial_contacts),
        warnings=conversion.warnings,
        version=provenance.version,
        mode=provenance.mode,
        modes=dict(provenance.modes),
        ego=provenance.ego,
        content_sha256=provenance.content_sha256,
        cut_off=enriched.motion.cut_off is not None,
    )


def _rounded(value: float | np.floating) -> float:
    """To a micrometre or microsecond: what a manifest is read for, and no noise of another machine's last bit."""
    return round(float(value), 6)
