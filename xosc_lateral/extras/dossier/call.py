"""`dossier`: what an assessor asks of a profile or of a folder of outputs, on a page and as JSON."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.version import BEHAVIOUR, __version__
from xosc_lateral.extras.dossier.claims import (
    Claim,
    Contents,
    Finding,
    State,
    contents_of,
    dossier_page,
    judged,
    known_anomalies,
    summary_of,
)
from xosc_lateral.files.atomic import together, write_atomically
from xosc_lateral.files.json_text import canonical_json
from xosc_lateral.files.output_paths import claim, output_file
from xosc_lateral.files.profiles import profile_hash
from xosc_lateral.workflows.batch.manifest import MANIFEST, read_manifest
from xosc_lateral.workflows.options import PathLike, Paths, ProfileLike, declare_options, flag
from xosc_lateral.workflows.result import PAGE_SUFFIXES, DrivesLike, Result, given_profile

if TYPE_CHECKING:
    from xosc_lateral.drivers.model.profile import DriverProfile

ENVIRONMENT = ("numpy", "scipy", "pandas", "lxml", "numba", "pyarrow", "msgspec")
"""Packages whose versions may decide on bytes, or on what is read."""


@declare_options
def dossier(
    subject: ProfileLike, *,
    recompute: Annotated[bool, flag("--recompute",
        help="Also what takes longer: what detectors do; whether every output of a folder is made again.")] = False,
    data: Annotated[DrivesLike | None, flag("--data", kind=list[Path] | None, metavar="TABLE",
        help="Drives to compare the profile with, not those that it was fitted to; may be repeated.")] = None,
    claims: Annotated[PathLike | None, flag("--claims", kind=Path | None, metavar="FILE.toml",
        help="Claims of your own, in the form of those that ship; one of the same id replaces that.")] = None,
    library: Paths = (),
) -> Dossier:  # fmt: skip
    """What an assessor asks of a profile, or of a folder of outputs: claims with their tests, validity, data, verdicts.

    Parameters
    ----------
    subject : DriverProfile, str or Path
        A profile, its name or path; or a folder with a manifest.

    Raises
    ------
    FormatError, DriverProfileError
        Neither; a file of claims that is none, or names a measure that there is not.
    """
    from xosc_lateral.extras.dossier import measures

    contents = contents_of(None if claims is None else Path(claims))
    if isinstance(subject, str | Path) and (Path(subject) / MANIFEST).is_file():
        folder = Path(subject)
        bench = measures.FolderBench(folder, tuple(read_manifest(folder / MANIFEST)))
        chosen = _about(contents.claim, "folder")
        computed = measures.FOLDER_MEASURES if recompute else measures.READ_FROM_MANIFEST
        findings = judged(chosen, measures.FOLDER_MEASURES, bench, {}, computed)
        profiles = {digest: name for row in bench.rows for name, digest in row.profile_sha256.items()}
        versions = sorted({f"{row.package_version}, behaviour {row.behaviour}" for row in bench.rows})
        parts = {
            "validity": [("see", f"`dossier {name}`") for name in sorted(set(profiles.values()))],
            "data": [("outputs", str(len(bench.rows))), ("made by", "; ".join(versions))]
            + [("profile", f"{name}, sha256 {digest}") for digest, name in sorted(profiles.items())],
            "verdict": [("see", "the profiles' dossiers; `detect` on this folder")],
        }
        return Dossier(folder.resolve().name, "folder", contents, tuple(findings), parts, _versions())
    if isinstance(subject, str | Path) and Path(subject).is_dir():
        raise FormatError(f"holds no {MANIFEST}, which convert SCENARIOS -o FOLDER/ writes", path=subject)
    profile = given_profile(subject, library)
    on_bench = measures.ProfileBench(profile, data)
    chosen = _about(contents.claim, "profile") + _assumed(profile)
    stated = measures.stated_by(profile)
    findings = judged(chosen, measures.PROFILE_MEASURES, on_bench, stated, measures.COMPUTED)
    parts = _profile_parts(profile) | {"verdict": contents.verdict}
    if recompute:
        from xosc_lateral.extras.detect.detection import cells

        rows = [(cell[1], f"{cell[0]}: {cell[2]} false alarms an hour; cut-ins seen: {cell[3]}")
                for cell in map(cells, on_bench.detection.rows())]  # fmt: skip
        how = ("computed here", "built-in detectors at their thresholds; intervals: 95 %, by vehicles")
        parts["verdict"] = [how, *rows, *contents.verdict]
    return Dossier(
        profile.name,
        "profile",
        contents,
        tuple(findings),
        parts,
        {**_versions(), "profile sha256": profile_hash(profile)},
    )


def _about(claims: Sequence[Claim], subject: str) -> list[Claim]:
    return [each for each in claims if each.about in (subject, "any")]


def _assumed(profile: DriverProfile) -> list[Claim]:
    """What a profile does beyond what was measured: nobody can test it."""
    valid, words = profile.validity, list[tuple[str, str]]()
    if (frequency := valid.highest_frequency) is not None:
        words.append(("frequency", f"Movement above {frequency:g} Hz, which no recording shows, is that of drivers."))
    if valid.speed is not None:
        low, high = (3.6 * speed for speed in valid.speed)
        words.append(("speed", f"Below {low:.0f} and above {high:.0f} km/h drivers move as they do between."))
    if valid.lane_width is not None:
        low, high = valid.lane_width
        words.append(
            ("lane-width", f"In lanes narrower than {low:.2f} or wider than {high:.2f} m movement scales as assumed.")
        )
    if not words:
        words.append(("validity", "It holds where it is used: the profile does not say where it was measured."))
    return [Claim(id=f"assumed-{name}", words=text) for name, text in words]


def _profile_parts(profile: DriverProfile) -> dict[str, list[tuple[str, str]]]:
    from xosc_lateral.drivers.evaluation.lane_keeping import figures_of
    from xosc_lateral.workflows.profiles.cards import card_rows

    valid = profile.validity
    bands = [(f"{band.low:g} to {band.high:g} Hz", band.in_words()) for band in valid.bands]
    speed = "" if valid.speed is None else f"{3.6 * valid.speed[0]:.0f} to {3.6 * valid.speed[1]:.0f} km/h"
    width = "" if valid.lane_width is None else f"{valid.lane_width[0]:.2f} to {valid.lane_width[1]:.2f} m"
    stated = [("speed", speed), ("lane width", width), ("roads", ", ".join(valid.roads)),
              ("resolution", f"{valid.resolution:g} m" if valid.resolution else "")]  # fmt: skip
    validity = bands + [(name, words or "not stated: not known") for name, words in stated]
    rows = card_rows(profile, *figures_of(profile))
    return {
        "validity": [*validity, *(row for row in rows if row[0] == "neighbours")],
        "data": [row for row in rows if row[0] not in ("valid", "model", "effect", "neighbours")],
    }


def _versions() -> dict[str, str]:
    package = Path(__file__).resolve().parents[2]
    sources = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        sources.update(path.relative_to(package).as_posix().encode() + path.read_bytes())
    packages = {distribution: metadata.version(distribution) for distribution in ENVIRONMENT}
    return {
        "xosc-lateral": f"{__version__}, behaviour {BEHAVIOUR}",
        "sha256 of its modules": sources.hexdigest(),
        "Python": f"{platform.python_version()} on {platform.system()} {platform.machine()}",
        **packages,
    }


@dataclass(frozen=True, eq=False, repr=False)
class Dossier(Result):
    """Claims and what became of them, and the parts that an assessor reads besides."""

    subject: str
    kind: str
    _contents: Contents
    findings: tuple[Finding, ...]
    parts: Mapping[str, Sequence[tuple[str, str]]]
    versions: Mapping[str, str]

    @property
    def broken(self) -> tuple[Finding, ...]:
        """Claims whose figures are beyond their bounds."""
        return tuple(finding for finding in self.findings if finding.state is State.BROKEN)

    def headline(self) -> str:
        """One line."""
        return f"{self.kind} {self.subject}: {len(self.findings)} claims: {summary_of(self.findings)}"

    def __str__(self) -> str:
        lines = [self.headline()]
        for finding in self.findings:
            figure = "" if finding.value is None else f" ({finding.value:.3g}, {finding.claim.bound})"
            lines.append(f"  {finding.state}: {finding.claim.id}: {finding.claim.words}{figure}")
        return "\n".join(lines)

    def to_frame(self) -> pd.DataFrame:
        """One row per claim."""
        return pd.DataFrame([finding.to_dict() for finding in self.findings])

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""
        return {
            "package": f"xosc-lateral {__version__}",
            "subject": self.subject,
            "kind": self.kind,
            "purpose": self._contents.purpose,
            "clauses": self._contents.clauses,
            "claims": [finding.to_dict() for finding in self.findings],
            "parts": {name: [list(row) for row in rows] for name, rows in self.parts.items()},
            "anomalies": known_anomalies(),
            "tool_classification": self._contents.tool,
            "process": self._contents.process,
            "versions": dict(self.versions),
        }

    def page(self) -> str:
        """HTML."""
        return dossier_page(f"{self.kind} {self.subject}", self._contents, self.findings, self.parts, self.versions)

    def write_report(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the page, and beside it the same as JSON."""
        output = output_file(path, f"{self.subject}_dossier.html", PAGE_SUFFIXES)
        values = output.with_suffix(".json")
        claim([output, values], force=force)
        with together():
            write_atomically(values, canonical_json(self.to_dict(), indent=1))
            return write_atomically(output, self.page())
