"""A table of vehicles on two lanes along x, at y = -1.75 and -5.25 m, in the formats of several doors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

STEP = 0.1
"""Between rows of a vehicle. [s]"""


def highd(traffic: pd.DataFrame, folder: Path) -> Path:
    """Three files of highD, whose y points down."""
    tracks = traffic.assign(frame=np.round(traffic["time"] / STEP).astype(int), width=4.5, height=1.8)
    tracks = tracks.assign(x=traffic["x"] - 2.25, y=-traffic["y"] - 0.9, xVelocity=30.0, xAcceleration=0.0)
    tracks.drop(columns=["class", "length", "time"]).to_csv(folder / "01_tracks.csv", index=False)
    ids = sorted(set(traffic["id"]))
    meta = pd.DataFrame({"id": ids, "drivingDirection": 2, "class": "Car"})
    meta.to_csv(folder / "01_tracksMeta.csv", index=False)
    about = {"frameRate": [10], "upperLaneMarkings": ["-9;-6"], "lowerLaneMarkings": ["0;3.5;7"]}
    pd.DataFrame(about).to_csv(folder / "01_recordingMeta.csv", index=False)
    return folder / "01_tracks.csv"


def fcd(traffic: pd.DataFrame, folder: Path) -> tuple[Path, Path]:
    """SUMO's output on one edge of two lanes; x and y are the front bumper."""
    net, path = folder / "run.net.xml", folder / "fcd.xml"
    lane = '<lane id="e_{0}" index="{0}" speed="36" length="4000" width="3.5" shape="0,{1} 4000,{1}"/>'
    net.write_text(f'<net><edge id="e">{lane.format(0, -5.25)}{lane.format(1, -1.75)}</edge></net>')
    steps = []
    traffic = traffic.assign(lane=(traffic["y"] > -3.5).astype(int))
    traffic = traffic.assign(side=traffic["y"] + np.where(traffic["lane"] == 1, 1.75, 5.25))
    for at, rows in traffic.groupby("time", sort=True):
        cars = "".join(
            f'<vehicle id="{row.id}" x="{row.x + 2.25:.6f}" y="{row.y:.6f}" angle="90" type="car" speed="30" '
            f'pos="{row.x + 2.25:.6f}" lane="e_{row.lane}" posLat="{row.side:.6f}"/>'
            for row in rows.itertuples()
        )
        steps.append(f'<timestep time="{at:.6f}">{cars}</timestep>')
    path.write_text(f"<fcd-export>{''.join(steps)}</fcd-export>")
    return path, net


def osi_trace(traffic: pd.DataFrame, folder: Path) -> Path:
    """Moving objects alone: the road comes beside it."""
    osi_utilities = pytest.importorskip("osi_utilities", reason="extra `osi` is not installed")
    from osi3.osi_sensorview_pb2 import SensorView

    path = folder / "made_gt.osi"
    with osi_utilities.SingleTraceWriter() as writer:
        writer.open(path)
        for at, rows in traffic.groupby("time", sort=True):
            message = SensorView().global_ground_truth
            message.timestamp.seconds, message.timestamp.nanos = divmod(round(float(at) * 1e9), 1_000_000_000)
            for row in rows.itertuples():
                one = message.moving_object.add(type=2)
                one.id.value, one.base.dimension.length = int(row.id), 4.5
                one.base.position.x, one.base.position.y, one.base.position.z = row.x, row.y, 0.0
                one.vehicle_classification.type = 4
            writer.write_message(message)
    return path
