"""An output of a plan: trajectories, and paths beside maneuvers that stay, with all that made them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache

from xosc_lateral.base.note import Note
from xosc_lateral.base.version import BEHAVIOUR, __version__
from xosc_lateral.files.openscenario.provenance import PENDING_HASH
from xosc_lateral.files.openscenario.write.build import version_text
from xosc_lateral.files.openscenario.write.draft import WrittenScenario
from xosc_lateral.files.openscenario.write.fit import write_converted
from xosc_lateral.files.profiles import profile_hash
from xosc_lateral.files.remote import leads_from
from xosc_lateral.workflows.conversion.across import Way
from xosc_lateral.workflows.conversion.load import Played
from xosc_lateral.workflows.conversion.phases import paths_of
from xosc_lateral.workflows.conversion.plan import Plan, WrittenAs
from xosc_lateral.workflows.conversion.result import ConversionProvenance, Enriched, EventShift, LaneChanges
from xosc_lateral.workflows.conversion.settings import OutputMode, relative
from xosc_lateral.world.motion.offset_path import OffsetPath


@dataclass(frozen=True, eq=False, slots=True)
class Written:
    """An output: the movement in it, how its vehicles were to be written, what is in the file."""

    movement: Enriched  # as sampled; of a reactive output that was checked, as it is played
    vehicles: WrittenAs
    paths: tuple[OffsetPath, ...]  # of those that keep their maneuvers
    provenance: ConversionProvenance
    file: WrittenScenario
    shifts: tuple[EventShift, ...] = ()
    warnings: tuple[Note, ...] = ()  # of the check
    trial_contacts: tuple[str, ...] = ()  # as `ConvertedScenario` has them
    played: Played | None = None  # nominally, of a reactive output that was checked
    stays: tuple[str, ...] = ()  # lane changes of these paths' entities that stay as written, a line each

    @property
    def with_lane_offsets(self) -> frozenset[str]:
        """Those that have a path, of those that were to."""
        return frozenset(path.entity for path in self.paths)


def provenance_of(plan: Plan, sampled: Enriched) -> ConversionProvenance:
    """What goes into an output, as far as it is known before it is written."""
    place = leads_from(plan.source, plan.output).parent
    folder, driven = plan.source.parent, {one.name for one in sampled.entities if one.profile}
    return ConversionProvenance(
        package_version=__version__,
        behaviour=BEHAVIOUR,
        scenario=f"{relative(folder, place)}/{plan.source.name}",
        inputs={relative(path, folder): sha256 for path, sha256 in plan.inputs.items()},
        profiles={
            name: (one.name, profile_hash(one))
            for name, one in plan.drivers.items()
            if name in driven and not isinstance(one, str)
        },
        options=plan.settings.record(folder),
        variant=plan.variant_index + 1,
        version=version_text(plan.version),
        ego=tuple(plan.egos),
        modes={},
        content_sha256=PENDING_HASH,
    )


def phases_of(plan: Plan, sampled: Enriched) -> Callable[[str, Way | None], tuple[list[OffsetPath], list[str]]]:
    """Of a vehicle that keeps its maneuvers, and how its lane changes lead across (None: as the settings say): its
    paths, and which lane changes stay as written, a line each. Each is made once.
    """
    usual = Way.ACROSS if plan.settings.lane_changes is LaneChanges.LIFELIKE else Way.WRITTEN

    @cache
    def phases(name: str, way: Way | None) -> tuple[list[OffsetPath], list[str]]:
        way = usual if way is None else way
        return paths_of(sampled.entity(name), plan, lifelike=way > Way.WRITTEN, leads=way is Way.ACROSS)

    return phases


def write(
    paths: Sequence[OffsetPath], plan: Plan, sampled: Enriched, vehicles: WrittenAs, provenance: ConversionProvenance
) -> Written:
    """Write the output with these paths for those who keep their maneuvers: a replay to its place; a reactive one into
    memory, since it is still to be checked.
    """
    modes = dict.fromkeys((path.entity for path in paths), OutputMode.LANE_OFFSET.value)
    modes |= dict.fromkeys(vehicles.trajectories, OutputMode.TRAJECTORY.value)
    enriched = sorted(entity.name for entity in sampled.entities if entity.is_enriched)
    modes = {name: modes[name] for name in enriched if name in modes}
    provenance = replace(provenance, modes=modes, content_sha256=PENDING_HASH)
    names = ", ".join(sorted({name for name, _ in provenance.profiles.values()})) or "no profile"
    sensor = ", with sensor" if plan.settings.with_sensor else ""
    file = write_converted(
        plan.extended.scenario,
        plan.extended.motion,
        {one.name: one.trajectory for one in sampled.entities if one.name in vehicles.trajectories},
        plan.output,
        paths=None if plan.is_replay else paths,
        lateral=plan.lateral,
        provenance={field.name: getattr(provenance, field.name) for field in fields(provenance)},
        summary=f"seed {plan.settings.seed}, variant {provenance.variant}, {names}{sensor}",
        save=plan.saves and plan.is_replay,
        target=plan.settings.target,
    )
    provenance = replace(provenance, content_sha256=file.content_sha256)
    return Written(sampled, vehicles, tuple(paths), provenance, file)
