"""Tracks in the layouts of public data sets, as their publications and files have them, without a mapping.

A layout makes files of rows in SI units (id, time, x, y, heading, speed, length, width, vehicle_class), and says how a
mapping names what its headers do not. Ids are numbers there, the car's is 1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

Rows = pd.DataFrame
FOOT = 0.3048
RATE = 25.0
"""At which frames are counted. [Hz]"""


@dataclass(frozen=True)
class Layout:
    """How a data set writes tracks."""

    columns: Callable[[Rows], Rows]
    mend: Mapping[str, str] = field(default_factory=dict)  # standard name -> COLUMN:UNIT, where headers don't say it
    lines: tuple[str, ...] = ()  # of a mapping: what its publication says besides
    reference: str = "centre"  # of x and y
    file: str = "bent.csv"
    format: str = "tracks"
    has_length: bool = True
    blur: float = 0.0  # of the offset [m]


def numbered(rows: Rows) -> Rows:
    names = sorted(set(rows["id"]), key=lambda name: (name != "car", name))
    return rows.assign(id=rows["id"].map({name: k for k, name in enumerate(names, start=1)}))


def ways(rows: Rows) -> dict[str, pd.Series]:
    return {"vx": rows["speed"] * np.cos(rows["heading"]), "vy": rows["speed"] * np.sin(rows["heading"])}


def frames(rows: Rows) -> pd.Series:
    return np.round(rows["time"] * RATE).astype(int)


def interaction(rows: Rows) -> Rows:
    return pd.DataFrame({
        "track_id": rows["id"], "frame_id": frames(rows) + 1, "timestamp_ms": np.round(1e3 * rows["time"]).astype(int),
        "agent_type": rows["vehicle_class"], "x": rows["x"], "y": rows["y"], **ways(rows),
        "psi_rad": rows["heading"], "length": rows["length"], "width": rows["width"],
    })  # fmt: skip


def sind(rows: Rows) -> Rows:
    made = interaction(rows).rename(columns={"psi_rad": "yaw_rad"})
    return made.assign(heading_rad=made["yaw_rad"], ax=0.0, ay=0.0, v_lon=rows["speed"], v_lat=0.0, a_lon=0.0, a_lat=0)


def ngsim(rows: Rows) -> Rows:
    """Feet; x and y are the middle of the front."""
    return pd.DataFrame({
        "Vehicle_ID": rows["id"], "Frame_ID": frames(rows), "Total_Frames": 1000,
        "Global_Time": np.round(1113433135300 + 1e3 * rows["time"]).astype(np.int64),
        "Local_X": 20.0, "Local_Y": rows["speed"] * rows["time"] / FOOT,
        "Global_X": rows["x"] / FOOT, "Global_Y": rows["y"] / FOOT, "v_Length": rows["length"] / FOOT,
        "v_Width": rows["width"] / FOOT, "v_Class": np.where(rows["vehicle_class"] == "truck", 3, 2),
        "v_Vel": rows["speed"] / FOOT, "v_Acc": 0.0, "Lane_ID": 2, "Preceding": 0, "Following": 0,
        "Space_Headway": 0.0, "Time_Headway": 0.0,
    })  # fmt: skip


def argoverse(rows: Rows) -> Rows:
    velocity = {f"velocity_{name[1]}": values for name, values in ways(rows).items()}
    return pd.DataFrame({
        "observed": True, "track_id": rows["id"].astype(str), "object_type": "vehicle", "object_category": 2,
        "timestep": frames(rows), "position_x": rows["x"], "position_y": rows["y"], "heading": rows["heading"],
        **velocity, "scenario_id": "0000b0f9", "start_timestamp": 0, "city": "austin",
    })  # fmt: skip


def waymo(rows: Rows) -> Rows:
    velocity = {f"velocity_{name[1]}": values for name, values in ways(rows).items()}
    return pd.DataFrame({
        "scenario_id": "637f20cafde22ff8", "track_id": rows["id"], "object_type": "TYPE_VEHICLE",
        "timestamp_seconds": rows["time"], "center_x": rows["x"], "center_y": rows["y"], "center_z": 0.0,
        "length": rows["length"], "width": rows["width"], "height": 1.5, "heading": rows["heading"], **velocity,
        "valid": True,
    })  # fmt: skip


def ind(rows: Rows) -> Rows:
    """Also rounD and uniD: degrees from x, classes and rate beside it, see `beside_levelx`."""
    velocity = {f"{name[1]}Velocity": values for name, values in ways(rows).items()}
    return pd.DataFrame({
        "recordingId": 0, "trackId": rows["id"], "frame": frames(rows), "trackLifetime": frames(rows),
        "xCenter": rows["x"], "yCenter": rows["y"], "heading": np.degrees(rows["heading"]) % 360.0,
        "width": rows["width"], "length": rows["length"], **velocity, "xAcceleration": 0.0, "yAcceleration": 0.0,
        "lonVelocity": rows["speed"], "latVelocity": 0.0, "lonAcceleration": 0.0, "latAcceleration": 0.0,
    })  # fmt: skip


def sumo_like(rows: Rows) -> Rows:
    """A logger of one's own: other words, degrees clockwise from north, km/h."""
    return pd.DataFrame({
        "timestamp [s]": rows["time"], "object_id": rows["id"], "pos_x [m]": rows["x"], "pos_y [m]": rows["y"],
        "yaw [deg]": np.degrees(rows["heading"]), "velocity [km/h]": 3.6 * rows["speed"],
        "length [m]": rows["length"], "width [m]": rows["width"], "type": rows["vehicle_class"],
    })  # fmt: skip


LAYOUTS = {
    "INTERACTION": Layout(interaction),
    "SIND": Layout(sind),
    "NGSIM": Layout(
        ngsim,
        {"x": "Global_X:ft", "y": "Global_Y:ft", "length": "v_Length:ft", "width": "v_Width:ft",
         "speed": "v_Vel:ft/s"},
        reference="front",
        blur=0.005,  # no headings: those of the way, which is the front's in bends
    ),
    "Argoverse 2": Layout(argoverse, {"time": "timestep:1/25 s"}, file="bent.parquet", has_length=False),
    "Waymo": Layout(waymo, lines=("[values.vehicle_class]", '"TYPE_VEHICLE" = "car"')),
    "rounD": Layout(ind, file="00_tracks.csv", format="levelx"),
    "a logger": Layout(sumo_like),
}  # fmt: skip


def write(layout: Layout, rows: Rows, folder: Path) -> Path:
    """The tracks' file, and what belongs beside it."""
    path, rows = folder / layout.file, numbered(rows)
    made = layout.columns(rows)
    made.to_parquet(path) if path.suffix == ".parquet" else made.to_csv(path, index=False)
    if layout.format == "levelx":
        kinds = rows.drop_duplicates("id")
        meta = pd.DataFrame({"recordingId": 0, "trackId": kinds["id"], "class": kinds["vehicle_class"]})
        meta.to_csv(folder / "00_tracksMeta.csv", index=False)
        pd.DataFrame({"recordingId": [0], "frameRate": [RATE]}).to_csv(folder / "00_recordingMeta.csv", index=False)
    return path
