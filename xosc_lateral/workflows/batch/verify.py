"""`verify` and `reproduce`: whether outputs are what their provenance says, and still would be made; and made again."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from xosc_lateral.base.errors import FormatError, XoscLateralError, absent, cut
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.limits import PROVENANCE_NAMES
from xosc_lateral.base.version import BEHAVIOUR
from xosc_lateral.files.openscenario.provenance import CONTENT_HASH_NAME, content_hash, facts_in, without_provenance
from xosc_lateral.files.output_paths import claim, output_file, output_folder, path_below
from xosc_lateral.files.profiles import profile_hash, read_profile
from xosc_lateral.files.source import check_regular, file_hash, hash_of, read_source
from xosc_lateral.workflows.batch.batch import convert_many
from xosc_lateral.workflows.batch.jobs import Batch, Fingerprints, Job
from xosc_lateral.workflows.batch.manifest import MANIFEST, ManifestRow, read_manifest
from xosc_lateral.workflows.batch.workers import JobLimits, WorkerDiedError, open_pool, run_tasks, within_limits
from xosc_lateral.workflows.conversion.convert import convert_scenario
from xosc_lateral.workflows.conversion.result import ConversionProvenance
from xosc_lateral.workflows.conversion.settings import AUTO, AUTO_PROFILE, ConvertSettings
from xosc_lateral.workflows.options import declare_options, flag, process_count
from xosc_lateral.workflows.result import PathLike, Paths, Result, as_paths


class Reason(StrEnum):
    """Why an output does not hold."""

    MISSING = "missing"
    FOREIGN = "not ours"
    EDITED = "edited"
    VERSION = "version"
    INPUT = "input"
    PROFILE = "profile"
    FAILED = "failed"
    DIFFERS = "differs"


Defect = tuple[Reason, str]
"""What is wrong with an output, and in words."""


@dataclass(frozen=True, slots=True)
class Checked:
    """An output, and what is wrong with it."""

    output: Path
    problems: tuple[Defect, ...] = ()


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Verification(Result):
    """Outputs, and what is wrong with which."""

    checked: tuple[Checked, ...]
    _done: str

    @property
    def failing(self) -> tuple[Checked, ...]:
        """Outputs with a problem."""
        return tuple(checked for checked in self.checked if checked.problems)

    def headline(self) -> str:
        """One line."""
        return f"{len(self.checked) - len(self.failing)} of {len(self.checked)} {self._done}"

    def __str__(self) -> str:
        lines = [f"{one.output}: {kind}: {what}" for one in self.failing for kind, what in one.problems]
        return "\n".join([*lines, self.headline()])

    def to_frame(self) -> pd.DataFrame:
        """One row per output: `output`, `problem` (the first one's kind; empty: none), `what`."""
        rows = [(str(checked.output), *map(str, (*checked.problems, ("", ""))[0])) for checked in self.checked]
        return pd.DataFrame(rows, columns=["output", "problem", "what"])

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them: of outputs, those with a problem."""
        outputs = [
            {"output": str(one.output), "problems": [{"kind": str(kind), "what": what} for kind, what in one.problems]}
            for one in self.failing
        ]
        return {"checked": len(self.checked), "failing": len(outputs), "outputs": outputs}


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
            raise FormatError("has no provenance of xosc-lateral, as outputs of convert have", path=output)
        if foreign := sorted(facts.keys() - {field.name for field in fields(ConversionProvenance)}):
            raise FormatError(f"its provenance says {foreign[0][:60]!r}, which this program never writes", path=output)
        try:
            scenario = Path(os.path.normpath(output.parent.resolve() / str(facts["scenario"])))
            settings = ConvertSettings.of_record(facts["options"], scenario.parent)
            for name in ("inputs", "profiles"):
                if not isinstance(facts[name], dict) or len(facts[name]) > PROVENANCE_NAMES.value:
                    raise TypeError(f"{name} are no object of at most {PROVENANCE_NAMES} names")
            if not all(isinstance(profile, str) for profile in (settings.profile, *settings.entity.values())):
                raise TypeError("a profile is no text")
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


ROADS_OPTION = flag("--road", kind=list[Path] | None, metavar="FOLDER",
    help='Folder with roads known by name ("Town04"); may be repeated.')  # fmt: skip


@declare_options
def verify(
    outputs: Paths,
    *,
    library: Paths = (),
    allow: Paths = (),
    road_path: Annotated[Paths, ROADS_OPTION] = (),
    fast: Annotated[bool, flag("--fast", help="Compare hashes alone; make nothing again.")] = False,
    workers: int = 0,
) -> Verification:
    """Whether outputs are what their provenance says, and what today's inputs and program would give.

    Each is made again in memory from what it states, within the limits of a batch, and compared byte for byte.

    Parameters
    ----------
    outputs : path or paths
        Converted scenarios, and folders with a manifest.
    library, allow, road_path : path or paths
        As for `convert`: where files are looked for is in no output.
    fast : bool
        Nothing is converted: only the hashes of content, inputs and profiles that an output states itself, and the
        behaviour version, are compared.
    workers : int
        Processes; -1: one per core; 0: this one.

    Raises
    ------
    FormatError
        There is no such file, or a folder has no manifest.
    """
    search = ConvertSettings(library=as_paths(library), allow=as_paths(allow), road_path=as_paths(road_path))
    tasks = list(enumerate(_tasks(as_paths(outputs))))
    checked: dict[int, Checked] = {}
    with open_pool(min(workers, len(tasks)), None, JobLimits()) as pool:
        for (number, task), defects in run_tasks(pool, partial(_defects, search, fast), tasks):
            if isinstance(defects, WorkerDiedError):
                defects = [(Reason.FAILED, str(defects))]
            checked[number] = Checked(task.path, tuple(defects))
    done = "outputs have the hashes that they state; none was made again" if fast else "outputs are what is made today"
    return Verification(tuple(checked[number] for number, _ in tasks), done)


class _Task(NamedTuple):
    """An output to check, and its row of a manifest; or what is wrong with it already."""

    path: Path
    row: ManifestRow | None = None
    defect: Defect | None = None


def _tasks(outputs: Sequence[Path]) -> Iterator[_Task]:
    for path in outputs:
        folder = path.parent if path.name == MANIFEST else path
        if not folder.is_dir():
            check_regular(path)
            yield _Task(path)
            continue
        named = {path_below(folder, row.output, "output"): row for row in _rows(folder)}
        for output, row in named.items():
            yield _Task(output, row, None if output.exists() else (Reason.MISSING, "is gone"))
        for output in sorted(folder.rglob("*.xosc")):
            folders = output.parents[: len(output.relative_to(folder).parts) - 1]
            if output not in named and not any((inner / MANIFEST).exists() for inner in folders):
                yield _Task(output, None, (Reason.FOREIGN, "is not in the manifest"))


def _rows(folder: Path) -> Iterator[ManifestRow]:
    """Those with an output."""
    if not (folder / MANIFEST).is_file():
        raise FormatError(f"no {MANIFEST} in this folder: name its files", path=folder)
    return (row for row in read_manifest(folder / MANIFEST) if row.output_sha256)


def _defects(search: ConvertSettings, fast: bool, numbered: tuple[int, _Task]) -> list[Defect]:
    _, task = numbered
    if task.defect is not None:
        return [task.defect]
    try:
        return within_limits(partial(_check, search, fast), task, JobLimits())
    except (XoscLateralError, OSError) as error:
        return [(Reason.FAILED, " ".join(cut(str(error)).split()))]


def _check(search: ConvertSettings, fast: bool, task: _Task) -> list[Defect]:
    data = read_source(task.path).data
    try:
        origin = _Origin.of(task.path, data, search)
    except FormatError as error:
        return [(Reason.FOREIGN, error.what)]
    defects = _changes(data, origin)
    if task.row is not None and not defects and (others := list(_other_row(task.row, data, origin))):
        defects.append((Reason.EDITED, f"the manifest states another {', '.join(others)}"))
    return defects if defects or fast else _made_otherwise(task.path, data, origin)


def _other_row(row: ManifestRow, data: bytes, origin: _Origin) -> Iterator[str]:
    """What a row of a manifest says otherwise than its output."""
    facts = origin.facts
    if hash_of(data) != row.output_sha256:
        yield "output_sha256"
    stated = {"seed": origin.settings.seed, "variant": origin.variant, "options": facts["options"]}
    stated |= {name: facts.get(name) for name in ("behaviour", "content_sha256", "package_version")}
    yield from (name for name, value in stated.items() if getattr(row, name) != value)
    if sorted(row.inputs.values()) != sorted(map(str, facts["inputs"].values())):
        yield "inputs"


def _made_otherwise(output: Path, data: bytes, origin: _Origin) -> list[Defect]:
    """How today's program makes it otherwise, from what its provenance states."""
    index = origin.variant - 1
    made = convert_scenario(origin.scenario, output, origin.settings, variant_index=index, saves=False).data
    stated, now = origin.facts, facts_in(made) or {}
    if made.replace(_version_of(now), _version_of(stated), 1) == data:
        return []
    same = without_provenance(made) == without_provenance(data)
    problems = [] if same else [(Reason.DIFFERS, "another content comes out of what its provenance states")]
    names = sorted(name for name in stated.keys() | now.keys() if stated.get(name) != now.get(name))
    names = [name for name in names if name not in (CONTENT_HASH_NAME, "package_version")]
    problems += [(Reason.EDITED, f"its provenance states another {name}") for name in names]
    return problems or [(Reason.EDITED, "its provenance is not as it was written")]


def _version_of(facts: Mapping[str, Any]) -> bytes:
    """As it stands in the provenance: versions that make the same differ there."""
    return f'"package_version": {json.dumps(facts.get("package_version"))}'.encode()


def _changes(data: bytes, origin: _Origin) -> list[Defect]:
    """What was edited in an output, and what would come out otherwise today, and why."""
    facts, problems = origin.facts, list[Defect]()
    if facts.get(CONTENT_HASH_NAME) != content_hash(data):
        problems.append((Reason.EDITED, "its content is not what was written"))
    if facts.get("behaviour") != BEHAVIOUR:
        made = f"behaviour {facts.get('behaviour')} of version {facts.get('package_version')}"
        problems.append((Reason.VERSION, f"made by {made}; this program has behaviour {BEHAVIOUR}"))
    for name, sha256 in facts["inputs"].items():
        try:
            if file_hash(Path(os.path.normpath(origin.scenario.parent / name))) != sha256:
                problems.append((Reason.INPUT, f"{cut(name)} has changed"))
        except (OSError, FormatError, ValueError):
            problems.append((Reason.INPUT, f"{cut(name)} is gone"))
    settings = origin.settings
    for entity, recorded in sorted((str(entity), profile) for entity, profile in facts["profiles"].items()):
        named = settings.entity.get(entity, settings.profile)
        try:
            profile = read_profile(AUTO_PROFILE if named == AUTO else str(named), settings.library)
        except (XoscLateralError, OSError) as error:
            problems.append((Reason.PROFILE, f"profile of {cut(entity)!r}: {cut(str(error))}"))
            continue
        if not isinstance(recorded, list) or recorded[1:] != [profile_hash(profile)]:
            problems.append((Reason.PROFILE, f"profile {profile.name!r} of {cut(entity)!r} has changed"))
    return problems


@declare_options
def reproduce(
    output: PathLike,
    new: PathLike,
    *,
    library: Paths = (),
    allow: Paths = (),
    road_path: Annotated[Paths, ROADS_OPTION] = (),
    workers: Annotated[
        int, flag("--jobs", read=process_count, help="Of a folder: number of processes; -1: one per core.")
    ] = 1,
    force: bool = False,
) -> Verification:
    """Make an output again from what it carries, or all outputs of a folder with a manifest, and compare the content.

    Parameters
    ----------
    output, new : path
        The output, or the folder; and where to write to.
    library, allow, road_path : path or paths
        As for `convert`: where files are looked for is in no output.
    workers : int
        Processes, for a folder.
    force : bool
        Replace files that this package did not write.

    Raises
    ------
    FormatError
        The output carries no provenance.
    XoscLateralError
        What it was made from can't be converted any more.
    """
    old = Path(output)
    if not old.exists():
        raise FormatError(absent(old), path=old)
    search = ConvertSettings(library=as_paths(library), allow=as_paths(allow), road_path=as_paths(road_path))
    target = output_folder(new) if old.is_dir() else output_file(new, old.name, (".xosc",))
    if target.resolve() == old.resolve():
        raise FormatError("is what is to be made again: choose another output", path=target)
    if old.is_dir():
        return Verification(tuple(_reproduce_folder(old, target.absolute(), search, workers)), _SAME)
    claim([target], [old], force=force)
    origin = _Origin.of(old, read_source(old).data, search)
    convert_scenario(origin.scenario, target, origin.settings, variant_index=origin.variant - 1)
    return Verification((_compared(old, target, origin),), _SAME)


_SAME = "outputs came out the same again"


def _reproduce_folder(folder: Path, new: Path, search: ConvertSettings, workers: int) -> Iterator[Checked]:
    origins: dict[str, _Origin] = {}
    jobs = []
    for row in _rows(folder):
        old = path_below(folder, row.output, "output")
        try:
            origin = _Origin.of(old, read_source(old).data, search)
        except (FormatError, OSError) as error:
            yield Checked(old, ((Reason.FAILED, str(error)),))
            continue
        origins[row.output] = origin
        below, source = Path(row.scenario).parts, origin.scenario
        base = source.parents[len(below) - 1] if source.parts[-len(below) :] == below else source.parent
        jobs.append(
            Job(
                name=row.output,
                scenario=source.relative_to(base).as_posix(),
                source=source,
                output=path_below(new, row.output, "output"),
                base=base,
                settings=origin.settings,
                variant=origin.variant - 1,
                fingerprint=Fingerprints().of(origin.settings, origin.variant - 1),
            )
        )
    base = Path(os.path.commonpath([job.base for job in jobs])) if jobs else new
    batch = Batch(new, base, tuple(sorted(jobs, key=lambda job: job.name)))
    for outcome in convert_many(batch, workers=workers):
        name = outcome.row.output
        if outcome.row.error:
            yield Checked(folder / name, ((Reason.FAILED, outcome.row.error),))
        else:
            yield _compared(folder / name, new / name, origins[name])


def _compared(old: Path, new: Path, origin: _Origin) -> Checked:
    """The same content, but for how the same files are referred to from another folder."""
    before, after = _parts(old), _parts(new)
    if len(before) == len(after) and all(
        one == other or (number % 2 and _meant(old, one) == _meant(new, other))
        for number, (one, other) in enumerate(zip(before, after, strict=True))
    ):
        return Checked(old)
    why = tuple(_changes(old.read_bytes(), origin))
    return Checked(old, why or ((Reason.DIFFERS, "another content comes out, and nothing says why"),))


def _parts(path: Path) -> list[bytes]:
    """What a file holds, split at references to other files, which are every second part."""
    return re.split(rb'(?<=path=")([^"]*)', without_provenance(path.read_bytes()))


def _meant(path: Path, reference: bytes) -> Path:
    return Path(os.path.normpath(path.parent.resolve() / os.fsdecode(reference)))
