"""A driver exported to C, compiled and called; and contexts in which everything that it reads changes."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.extras.live.export import export_c, identifier, inputs_of

STRICT = ("-Wall", "-Wextra", "-pedantic", "-Wdouble-promotion", "-Wfloat-equal", "-Werror", "-ffp-contract=off")

SANITIZED = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


def compiler(name: str = "cc") -> str:
    """Where a compiler is; the test is skipped where there is none."""
    path = shutil.which(name)
    if path is None:
        pytest.skip(f"no {name} here")
    return path


def build(sources: Sequence[Path], target: Path, *flags: str, name: str = "cc", language: str = "-std=c99") -> Path:
    """Compile without a warning; the source is C99, and C++17 too."""
    words = [compiler(name), *language.split(), *STRICT, *flags, *map(str, sources), "-o", str(target), "-lm"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and not done.stderr, done.stderr
    return target


class CompiledDriver:
    """One driver in C."""

    def __init__(self, profile: DriverProfile, folder: Path) -> None:
        header, source = export_c(profile, folder)[:2]
        self.columns = inputs_of(profile)
        library = ctypes.CDLL(str(build([source], folder / "driver.so", "-O1", "-fPIC", "-shared")))
        sizes = dict(re.findall(r"#define \w+?_(MEMORY|SAVED|LOOKS) (\d+)", header.read_text()))
        self.memory, self.looks = int(sizes["MEMORY"]), int(sizes["LOOKS"])
        pointer, real = ctypes.c_void_p, ctypes.c_double
        kinds = {
            "start": [pointer, ctypes.c_uint64, ctypes.c_uint32, real, ctypes.c_uint64],
            "look": [pointer, pointer],
            "step": [pointer, real, pointer, pointer],
            "restart": [pointer, real],
            "message": [pointer],
            "save": [pointer, pointer],
            "restore": [pointer, pointer, ctypes.c_size_t],
            "fault": [pointer],
            "fault_message": [pointer],
        }
        self.functions = {name: getattr(library, f"{identifier(profile)}_{name}") for name in kinds}
        for name, arguments in kinds.items():
            self.functions[name].argtypes = arguments
        self.functions["message"].restype = self.functions["fault_message"].restype = ctypes.c_char_p
        self.state = ctypes.create_string_buffer(self.memory)

    def _call(self, name: str, *arguments: object) -> None:
        if self.functions[name](self.state, *arguments):
            raise ValueError(self.functions["message"](self.state).decode())

    def start(self, seed: int, drive: int = 0, time: float = 0.0, known: int | None = None) -> None:
        """Begin a drive."""
        self._call("start", seed, drive, time, (1 << len(self.columns)) - 1 if known is None else known)

    def _row(self, values: Mapping[str, float]) -> np.ndarray:
        whole = {"position": 0.0, "following": 1.0, **values}
        return np.array([whole[name] for name in (*self.columns, "position", "following")], dtype=np.float64)

    def look(self, values: Mapping[str, float]) -> None:
        """Context of the time to come."""
        self._call("look", self._row(values).ctypes.data)

    def step(self, time: float, values: Mapping[str, float]) -> np.ndarray:
        """Offset, rate, heading."""
        row, outputs = self._row(values), np.empty(3)
        self._call("step", time, row.ctypes.data, outputs.ctypes.data)
        return outputs

    def restart(self, time: float) -> None:
        """Go on after a pause."""
        self._call("restart", time)

    def fault(self) -> tuple[int, str]:
        """What wanted what can't be driven, and in words."""
        return self.functions["fault"](self.state), self.functions["fault_message"](self.state).decode()

    def save(self) -> bytes:
        """The state as bytes."""
        room = ctypes.create_string_buffer(self.memory + 16)
        self.functions["save"](self.state, room)
        return room.raw

    def restore(self, saved: bytes) -> None:
        """Back to a state."""
        self._call("restore", saved, len(saved))


def varying(columns: Sequence[str], rows: int, seed: int) -> dict[str, np.ndarray]:
    """Context in which every column jumps now and then, to "there is none" and to nobody too."""
    rng, context = np.random.default_rng(seed), {}
    for name in columns:
        share = np.repeat(rng.random(rows // 40 + 1), 40)[:rows]
        if name == "speed":
            values = 12.0 + 30.0 * share
        elif name == "lane_width":
            values = 3.0 + share
        elif name.endswith("_distance"):
            values = np.where(share < 0.2, np.nan, np.where(share < 0.4, np.inf, 300.0 * (share - 0.7)))
        elif name in ("is_truck", "lane_index"):
            values = np.floor(3.0 * share) if name == "lane_index" else np.round(share)
        else:  # of any unit
            values = np.where(share < 0.2, np.nan, 8.0 * (share - 0.6))
        context[name] = values
    return context


def gentle(columns: Sequence[str], rows: int) -> dict[str, np.ndarray]:
    """Context in which nothing is sudden: what is a truth value or a lane stays."""
    time, context = 0.2 * np.arange(rows), {}
    for k, name in enumerate(columns):
        wave = np.sin(time / (15.0 + k))
        middle, swing = {"speed": (28.0, 3.0), "lane_width": (3.6, 0.1)}.get(name, (40.0, 10.0))
        context[name] = np.ones(rows) if name in ("is_truck", "lane_index") else middle + swing * wave
    return context


def segment_of(context: Mapping[str, np.ndarray], begin: float = 0.0) -> Segment:
    """The same for the batch call."""
    others = {name: values for name, values in context.items() if name not in ("speed", "lane_width")}
    time = begin + 0.2 * np.arange(len(context["speed"]), dtype=np.float64)
    return Segment(time, context["lane_width"], context["speed"], others)


def row_of(context: Mapping[str, np.ndarray], row: int) -> dict[str, float]:
    """One row of it, after its end the last."""
    return {name: float(values[min(row, len(values) - 1)]) for name, values in context.items()}
