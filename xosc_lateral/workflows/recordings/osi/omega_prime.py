"""Recordings of omega-prime as Parquet [1]_: a row per moving object and instant, the map in the file's metadata.

References
----------
.. [1] omega-prime 0.3: the columns of its schema; `osi` holds a `GroundTruth` with lanes as JSON, `xodr` an OpenDRIVE
   road.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.osi.extra import osi
from xosc_lateral.files.source import open_source
from xosc_lateral.files.tables import foreign_errors

NANOSECONDS = 1_000_000_000
PLACES = {
    "position": ("x", "y", "z"),
    "velocity": ("vel_x", "vel_y", "vel_z"),
    "acceleration": ("acc_x", "acc_y", "acc_z"),
    "orientation": ("roll", "pitch", "yaw"),
    "dimension": ("length", "width", "height"),
}
"""Part of OSI's `BaseMoving` -> columns."""

KINDS = ("type", "role", "subtype")
COLUMNS = ("total_nanos", "idx", *KINDS, *(name for names in PLACES.values() for name in names))


class OmegaPrimeReader:
    """Its messages one by one, as the readers of traces give them.

    `opendrive`: the road, where the file has it in this form. Raises `FormatError`: not such a file.
    """

    def __init__(self, path: Path) -> None:
        import pyarrow.parquet as pq

        with open_source(path) as source, foreign_errors(path, "can't be read as Parquet"):
            file = pq.ParquetFile(source.file)
            missing = [name for name in COLUMNS if name not in file.schema_arrow.names]
            if missing:
                raise FormatError(f"no column {missing[0]!r}: not a recording of omega-prime", path=path)
            about = file.schema_arrow.metadata or {}
            rows = file.read(list(COLUMNS)).sort_by([("total_nanos", "ascending"), ("idx", "ascending")])
        self.opendrive: bytes | None = about.get(b"xodr")
        with foreign_errors(path, "can't be read as a recording of omega-prime"):
            self._lanes = osi("osi3.osi_groundtruth_pb2").GroundTruth()
            if b"osi" in about:
                osi("google.protobuf.json_format").Parse(about[b"osi"], self._lanes, ignore_unknown_fields=True)
            self._host = int(about.get(b"host_vehicle_idx", b"-1"))
        self._messages = self._all(rows, path)

    def read_message(self) -> Any:
        """The next one, as `message` of what is returned; None: there is none left."""
        return next(self._messages, None)

    def close(self) -> None:
        """Nothing is open."""

    def _all(self, rows: Any, path: Path) -> Iterator[Any]:
        every = (row for batch in rows.to_batches(max_chunksize=10_000) for row in batch.to_pylist())
        for number, (nanoseconds, present) in enumerate(groupby(every, key=lambda row: row["total_nanos"]), 1):
            message = osi("osi3.osi_groundtruth_pb2").GroundTruth()
            if number == 1:
                message.CopyFrom(self._lanes)
                message.ClearField("moving_object")
            with foreign_errors(path, f"message {number}"):
                message.timestamp.seconds, message.timestamp.nanos = divmod(nanoseconds, NANOSECONDS)
                if self._host >= 0:
                    message.host_vehicle_id.value = self._host
                for row in present:
                    self._add(message.moving_object.add(), row)
            yield SimpleNamespace(message=message, error_message="")

    def _add(self, thing: Any, row: dict[str, Any]) -> None:
        thing.id.value, thing.type = row["idx"], row["type"]
        for part, names in PLACES.items():
            vector = getattr(thing.base, part)
            fields = names if part in ("orientation", "dimension") else ("x", "y", "z")
            for field, name in zip(fields, names, strict=True):
                setattr(vector, field, row[name])
        if row["subtype"] >= 0:
            thing.vehicle_classification.type = row["subtype"]
        if row["role"] >= 0:
            thing.vehicle_classification.role = row["role"]
