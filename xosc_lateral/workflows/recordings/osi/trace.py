"""Messages of an OSI trace, one after the other: the ground truth of `.mcap`, `.osi` and `.parquet` files."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.osi import SUFFIXES, osi
from xosc_lateral.files.source import check_regular, open_source
from xosc_lateral.files.tables import foreign_errors

TRUTHS = ("GROUND_TRUTH", "SENSOR_VIEW")  # messages of the true world; a sensor view has it as its global ground truth


class Trace:
    """An open trace; use it as a context.

    `channel`: topic of an MCAP file; without it the one that holds ground truth, else a sensor view. `notes`: channels
    that are not read. `opendrive`: the road, where the file has it.
    """

    def __init__(self, path: Path, channel: str | None = None) -> None:
        if path.suffix.lower() not in OPENERS:
            what = f"an OSI trace ends in {', '.join(SUFFIXES)}, one of omega-prime in .parquet too"
            raise FormatError(what, path=path)
        check_regular(path)
        if path.stat().st_size == 0:
            raise FormatError("is empty", path=path)
        self.path = path
        self.notes: list[str] = []
        self.opendrive: bytes | None = None
        self._reader = OPENERS[path.suffix.lower()](self, channel)

    def __enter__(self) -> Trace:
        return self

    def __exit__(self, *error: object) -> None:
        self._reader.close()

    def __iter__(self) -> Iterator[Any]:
        number = 0
        while (result := self._reader.read_message()) is not None:
            number += 1
            if result.message is None:
                why = " ".join(str(result.error_message).split())
                raise FormatError(f"damaged: {why}", path=self.path, element=f"message {number}")
            is_view = type(result.message).__name__ == "SensorView"
            yield result.message.global_ground_truth if is_view else result.message

    def _of_mcap(self, channel: str | None) -> Any:
        reader = osi("osi_utilities").MultiTraceReader()
        if not reader.open(self.path):
            raise FormatError("not an MCAP file, or one that was not closed", path=self.path)
        names = {kind: name for name, kind in osi("osi_utilities").MessageType.__members__.items()}
        topics = {
            channel_there.topic: names[channel_there.message_type]
            for channel_there in reader.list_channel_specifications()
        }
        others = [topic for topic in reader.get_available_topics() if topic not in topics]
        listed = ", ".join([f"{topic} ({kind})" for topic, kind in topics.items()] + others) or "none"
        chosen = _chosen(topics, channel)
        if chosen is None:
            reader.close()
            what = "ground truth or a sensor view" + ("" if channel is None else f" named {channel!r}")
            raise FormatError(f"no channel with {what}; there are: {listed}", path=self.path)
        if len(topics) + len(others) > 1:
            self.notes.append(f"{self.path.name}: read channel {chosen} of {listed}")
        reader.set_topics([chosen])
        return reader

    def _of_rows(self, channel: str | None) -> Any:
        _refuse_channel(self.path, channel)
        reader = OmegaPrimeReader(self.path)
        self.opendrive = reader.opendrive
        return reader

    def _of_messages(self, channel: str | None) -> Any:
        _refuse_channel(self.path, channel)
        utilities = osi("osi_utilities")
        kinds = utilities.MessageType
        named = utilities.infer_message_type_from_filename(self.path.name)
        if named not in (kinds.UNKNOWN, kinds.GROUND_TRUTH, kinds.SENSOR_VIEW):
            raise FormatError(f"its name says {named.name}: neither ground truth nor a sensor view", path=self.path)
        if named is not kinds.UNKNOWN:
            return self._opened(named)
        # nothing in the file says what its messages are: a sensor view is one that shows moving objects
        reader = self._opened(kinds.SENSOR_VIEW)
        first = reader.read_message()
        reader.close()
        is_view = first.message is not None and first.message.global_ground_truth.moving_object
        return self._opened(kinds.SENSOR_VIEW if is_view else kinds.GROUND_TRUTH)

    def _opened(self, kind: Any) -> Any:
        reader = osi("osi_utilities").SingleTraceReader()
        reader.set_message_type(kind)
        if not reader.open(self.path):
            raise FormatError("not an OSI trace", path=self.path)
        return reader


OPENERS = {".mcap": Trace._of_mcap, ".osi": Trace._of_messages, ".parquet": Trace._of_rows}
"""By suffix: how a trace is opened."""


def _refuse_channel(path: Path, channel: str | None) -> None:
    if channel is not None:
        raise FormatError(f"has no channels, so no channel {channel!r}", path=path)


def _chosen(kinds: dict[str, str], channel: str | None) -> str | None:
    truths = [topic for wanted in TRUTHS for topic, kind in kinds.items() if kind == wanted]
    if channel is None:
        return truths[0] if truths else None
    return channel if channel in truths else None


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
    """Its messages one by one, as the readers of traces give them; `opendrive`: the road, where the file has it so."""

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
