"""Whether outputs are what their provenance says, and what today's inputs and program would give; and made again."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any

from xosc_lateral.base.errors import FormatError, XoscLateralError
from xosc_lateral.base.version import BEHAVIOUR
from xosc_lateral.files.hashes import file_hash
from xosc_lateral.files.openscenario.provenance import CONTENT, content_hash, facts_in, without_provenance
from xosc_lateral.files.output_paths import path_below
from xosc_lateral.files.profiles import profile_hash, read_profile
from xosc_lateral.files.source import check_regular
from xosc_lateral.workflows.batch.batch import convert_many
from xosc_lateral.workflows.batch.jobs import Batch, Job, fingerprint
from xosc_lateral.workflows.batch.manifest import MANIFEST, ManifestRow, read_manifest
from xosc_lateral.workflows.conversion.convert import convert_scenario
from xosc_lateral.workflows.conversion.drivers import AUTO_PROFILE
from xosc_lateral.workflows.conversion.settings import AUTO, ConvertSettings


class Problem(StrEnum):
    """Why an output does not hold."""

    MISSING = "missing"
    FOREIGN = "not ours"
    EDITED = "edited"
    VERSION = "version"
    INPUT = "input"
    PROFILE = "profile"
    FAILED = "failed"
    DIFFERS = "differs"


@dataclass(frozen=True, slots=True)
class Checked:
    """An output, and what is wrong with it.

    `problems`: empty: nothing.
    """

    output: Path
    problems: tuple[tuple[Problem, str], ...] = ()


@dataclass(frozen=True, slots=True)
class _Origin:
    """What an output was made from, as its provenance has it."""

    facts: Mapping[str, Any]
    scenario: Path
    settings: ConvertSettings
    variant: int

    @classmethod
    def of(cls, output: Path, data: bytes, search: ConvertSettings) -> _Origin:
        """Read it, `FormatError` if it is not one of ours; `search` says where profiles and roads are looked for."""
        facts = facts_in(data)
        if facts is None:
            raise FormatError("has no provenance of xosc-lateral", path=output)
        try:
            scenario = Path(os.path.normpath(output.parent.resolve() / str(facts["scenario"])))
            settings = ConvertSettings.of_record(facts["options"], scenario.parent)
            for name in ("inputs", "profiles"):
                if not isinstance(facts[name], dict):
                    raise TypeError(f"{name} are no object")
            variant = int(facts["variant"])
            if variant < 1:
                raise ValueError(f"variant {variant}")
        except KeyError as error:
            what = f"its provenance says nothing of {error}: made by an older version"
            raise FormatError(what, path=output) from error
        except (TypeError, ValueError, AttributeError, OverflowError) as error:
            raise FormatError(f"its provenance can't be read: {error}", path=output) from error
        places = {name: getattr(search, name) for name in ("library", "allow", "road_path")}
        return cls(facts, scenario, replace(settings, **places), variant)


def verify(outputs: Sequence[Path], search: ConvertSettings) -> Iterator[Checked]:
    """Check outputs one by one: files, and folders by their manifests, which may be named as well.

    Raises `FormatError`: there is no such file, or no manifest in a folder.
    """
    for given in outputs:
        given = given.parent if given.name == MANIFEST else given
        if not given.is_dir():
            yield _check(given, search, None)
            continue
        for row in _rows(given):
            path = path_below(given, row.output, "output")
            yield _check(path, search, row) if path.exists() else Checked(path, ((Problem.MISSING, "is gone"),))


def _rows(folder: Path) -> Iterator[ManifestRow]:
    """Those with an output."""
    if not (folder / MANIFEST).is_file():
        raise FormatError(f"no {MANIFEST} in this folder: name its files", path=folder)
    return (row for row in read_manifest(folder / MANIFEST) if row.output_sha256)


def _check(output: Path, search: ConvertSettings, row: ManifestRow | None) -> Checked:
    check_regular(output)
    data = output.read_bytes()
    try:
        origin = _Origin.of(output, data, search)
    except FormatError as error:
        return Checked(output, ((Problem.FOREIGN, error.what),))
    problems = _changes(data, origin)
    if not problems and row is not None and hashlib.sha256(data).hexdigest() != row.output_sha256:
        problems.append((Problem.EDITED, "is not the file that the manifest names"))
    return Checked(output, tuple(problems))


def _changes(data: bytes, origin: _Origin) -> list[tuple[Problem, str]]:
    """What was edited in an output, and what would come out otherwise today, and why."""
    facts, found = origin.facts, list[tuple[Problem, str]]()
    if facts.get(CONTENT) != content_hash(data):
        found.append((Problem.EDITED, "its content is not what was written"))
    if facts.get("behaviour") != BEHAVIOUR:
        made = f"behaviour {facts.get('behaviour')} of version {facts.get('package_version')}"
        found.append((Problem.VERSION, f"made by {made}; this program has behaviour {BEHAVIOUR}"))
    for name, sha256 in facts["inputs"].items():
        try:
            if file_hash(Path(os.path.normpath(origin.scenario.parent / name))) != sha256:
                found.append((Problem.INPUT, f"{name} has changed"))
        except (OSError, FormatError, ValueError):
            found.append((Problem.INPUT, f"{name} is gone"))
    for name, sha256 in sorted({str(entity): profile for entity, profile in facts["profiles"].items()}.items()):
        if (why := _other_profile(origin.settings, name, sha256)) is not None:
            found.append((Problem.PROFILE, why))
    return found


def _other_profile(settings: ConvertSettings, entity: str, recorded: Any) -> str | None:
    """Why an entity would get another profile today."""
    named = settings.entity.get(entity, settings.profile)
    try:
        found = read_profile(AUTO_PROFILE if named == AUTO else str(named), settings.library)
    except (XoscLateralError, OSError) as error:
        return f"profile of {entity!r}: {error}"
    same = isinstance(recorded, list) and recorded[1:] == [profile_hash(found)]
    return None if same else f"profile {found.name!r} of {entity!r} has changed"


def reproduce(output: Path, new: Path, search: ConvertSettings, *, workers: int = 1) -> Iterator[Checked]:
    """Make an output, or all of a folder's manifest, again from the provenance, and compare.

    `new`: file or folder to write to; `search`: where profiles, roads and catalogs are looked for; `workers`:
    processes, for a folder. Raises `XoscLateralError`: an output has no provenance; what it was made from can't be
    converted.
    """
    if not output.is_dir():
        origin = _Origin.of(output, output.read_bytes(), search)
        convert_scenario(origin.scenario, new, origin.settings, variant=origin.variant - 1)
        yield _compared(output, new, origin)
        return
    origins: dict[str, _Origin] = {}
    jobs = []
    for row in _rows(output):
        old = path_below(output, row.output, "output")
        try:
            origin = _Origin.of(old, old.read_bytes(), search)
        except (FormatError, OSError) as error:
            yield Checked(old, ((Problem.FAILED, str(error)),))
            continue
        origins[row.output] = origin
        jobs.append(_job(row, origin, path_below(new.absolute(), row.output, "output")))
    base = Path(os.path.commonpath([job.base for job in jobs])) if jobs else new
    batch = Batch(new.absolute(), base, tuple(sorted(jobs, key=lambda job: job.name)))
    for outcome in convert_many(batch, workers=workers):
        name = outcome.row.output
        if outcome.row.error:
            yield Checked(output / name, ((Problem.FAILED, outcome.row.error),))
        else:
            yield _compared(output / name, new / name, origins[name])


def _job(row: ManifestRow, origin: _Origin, output: Path) -> Job:
    below, variant = Path(row.scenario).parts, origin.variant - 1
    source, depth = origin.scenario, len(below)
    base = source.parents[depth - 1] if source.parts[-depth:] == below else source.parent
    return Job(
        name=row.output,
        scenario=source.relative_to(base).as_posix(),
        source=source,
        output=output,
        base=base,
        settings=origin.settings,
        variant=variant,
        fingerprint=fingerprint(origin.settings, variant),
    )


def _compared(old: Path, new: Path, origin: _Origin) -> Checked:
    """The same content, but for how the same files are referred to from another folder."""
    before, after = _parts(old), _parts(new)
    if len(before) == len(after) and all(
        one == other or (number % 2 and _meant(old, one) == _meant(new, other))
        for number, (one, other) in enumerate(zip(before, after, strict=True))
    ):
        return Checked(old)
    why = tuple(_changes(old.read_bytes(), origin))
    return Checked(old, why or ((Problem.DIFFERS, "another content comes out, and nothing says why"),))


def _parts(path: Path) -> list[bytes]:
    """What a file holds, split at references to other files, which are every second part."""
    return re.split(rb'(?<=path=")([^"]*)', without_provenance(path.read_bytes()))


def _meant(path: Path, reference: bytes) -> Path:
    return Path(os.path.normpath(path.parent.resolve() / os.fsdecode(reference)))
