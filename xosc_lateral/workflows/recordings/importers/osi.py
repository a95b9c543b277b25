"""ASAM OSI traces [1]_ into the standard drive table (extra `osi`).

Vehicles are placed between the boundaries of their lanes, as the trace has them or, with `road`, as an OpenDRIVE file
has them. The offset is that of the rear axle where the trace says where it is, else of the vehicle's middle.

References
----------
.. [1] ASAM OSI (Open Simulation Interface) 3.8: osi_groundtruth.proto, osi_lane.proto, osi_logicallane.proto.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.drives import file_labels
from xosc_lateral.files.opendrive import parse_opendrive, read_opendrive
from xosc_lateral.workflows.recordings.cuts import DEFAULT_CUTS, CutSettings
from xosc_lateral.workflows.recordings.importers.table import Imported, guarded, import_each, paths_of
from xosc_lateral.workflows.recordings.importers.tracks import (
    PlacedTracks,
    import_placed,
    place_on_road,
    require_lanes,
)
from xosc_lateral.workflows.recordings.lane_graph import LaneGraph
from xosc_lateral.workflows.recordings.lane_shapes import place_in_shapes
from xosc_lateral.workflows.recordings.osi.read import Recorded, read_osi
from xosc_lateral.workflows.recordings.osi.shapes import lanes_of

LICENCE = "that of the trace"
HOST = "host"  # stands for the trace's own host vehicle


@guarded
def import_osi(
    sources: Path | Sequence[Path],
    settings: CutSettings = DEFAULT_CUTS,
    *,
    host: str | None = None,
    road: Path | str | None = None,
    channel: str | None = None,
    keep_cut: bool = False,
) -> Imported:
    """Read one or several traces of ground truth or sensor views.

    `host`: keep this vehicle alone: its identifier or name in the trace; "host": the trace's host vehicle. `road`:
    OpenDRIVE file to take lanes from. `channel`: topic of an MCAP file with several.
    """
    files = paths_of(sources)
    labels = dict(zip(files, file_labels(files), strict=True))

    def read(path: Path) -> Imported:
        recorded = read_osi(path, channel)
        only = None if host is None else _named(recorded, host, path)
        if len(files) > 1:
            names = tuple(f"{labels[path]}:{name}" for name in recorded.tracks.names)
            recorded = replace(recorded, tracks=replace(recorded.tracks, names=names))
            only = None if only is None else {f"{labels[path]}:{name}" for name in only}
        placed, graph, read_from = _placed(recorded, path, None if road is None else Path(road))
        about = {"format": "osi", "sources": read_from, "licence": LICENCE, "notes": recorded.notes}
        return import_placed(placed, graph, settings, keep_cut=True, only=only, **about)

    return import_each(sources, read, keep_cut=keep_cut)


def _named(recorded: Recorded, host: str, path: Path) -> set[str]:
    wanted = host
    if host == HOST:
        if len(recorded.hosts) != 1:
            there = ", ".join(recorded.hosts) or "none"
            raise FormatError(f"host vehicles: {there}; name one with --host", path=path)
        wanted = recorded.hosts[0]
    wanted = {number: name for name, number in recorded.numbers.items()}.get(wanted, wanted)
    names = {name for name in recorded.tracks.names if name.split("#")[0] == wanted}  # NAME#2 after a leap
    if not names:
        there = ", ".join(recorded.tracks.names[:20])
        raise FormatError(f"no vehicle {host!r}; there are {there}", path=path)
    return names


def _placed(recorded: Recorded, path: Path, road: Path | None) -> tuple[PlacedTracks, LaneGraph, list[Path]]:
    tracks, files, network = recorded.tracks, [path], None
    if road is not None:
        network, files, where = read_opendrive(road), [path, road], road.name
    elif recorded.opendrive is not None:
        network, where = parse_opendrive(recorded.opendrive, path.stem), "the road in it"
    if network is not None:
        placed, graph = place_on_road(tracks, network)
    elif (lanes := lanes_of(recorded)) is not None:
        (strips, graph), where = lanes, "the trace"
        placed = place_in_shapes(tracks, strips, graph.left)
    else:
        raise FormatError("has no lanes with boundaries: give the road with --road FILE.xodr", path=path)
    require_lanes(placed, where, path)
    return placed, graph, files
