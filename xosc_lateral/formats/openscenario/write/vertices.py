"""Vertices of trajectories, which become text only while the document is written: as elements they take 3 kB each."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from xosc_lateral.formats.openscenario.write import build

FloatArray = NDArray[np.float64]

BLOCK = 1000
"""Vertices that are text at a time."""

_POSE = (("x", 5), ("y", 5), ("z", 5), ("h", 6), ("p", 6), ("r", 6))
"""Attributes and their decimals."""
_MOTION = (("speed_longitudinal", 4), ("acceleration_longitudinal", 4))


@dataclass(frozen=True, eq=False, slots=True)
class TimedVertices:
    """Vertices of one trajectory.

    Parameters
    ----------
    times : array, shape (n,)
        [s]
    pose : six arrays, shape (n,)
        x, y, z [m], heading, pitch, roll [rad].
    motion : two arrays, shape (n,), or None
        Speed [m/s] and acceleration [m/s2].
    """

    times: FloatArray
    pose: Sequence[FloatArray]
    motion: Sequence[FloatArray] | None

    def text(self, indent: str, unit: str) -> Iterator[str]:
        """XML of the vertices, set out at `indent`, each level below by `unit` more; the first without its indent."""
        columns = np.stack((self.times, *self.pose, *(self.motion or ())), axis=1)
        inner, innermost = f"\n{indent}{unit}", f"\n{indent}{unit}{unit}"
        position = f"{inner}<Position>{innermost}<WorldPosition{_attributes(_POSE)}/>{inner}</Position>"
        motion = f"{inner}<Motion{_attributes(_MOTION)}/>" if self.motion else ""
        vertex = f'<Vertex time="%.6f">{position}{motion}\n{indent}</Vertex>'
        for begin in range(0, len(self.times), BLOCK):
            block = columns[begin : begin + BLOCK]
            text = f"\n{indent}".join([vertex] * len(block)) % tuple(block.ravel().tolist())
            yield (f"\n{indent}" if begin else "") + build.shortened(text)


def _attributes(names: Sequence[tuple[str, int]]) -> str:
    return "".join(f' {name}="%.{digits}f"' for name, digits in names)


class Vertices:
    """Polylines of a document, and where in it they go.

    Parameters
    ----------
    source : bytes
        The document before: no mark of ours can be in it by chance or by malice, for its hash is part of the mark.
    """

    def __init__(self, source: bytes) -> None:
        self._mark = f"vertices-{hashlib.sha256(source).hexdigest()[:32]}"
        self._polylines: list[TimedVertices] = []

    def add(self, owner: etree._Element, polyline: TimedVertices) -> None:
        """Let an element hold these vertices and nothing else."""
        owner.append(etree.ProcessingInstruction(self._mark, str(len(self._polylines))))
        self._polylines.append(polyline)

    def document(self, root: etree._Element) -> Iterator[bytes]:
        """The whole file in pieces; see `build.document`."""
        unit = build.indentation(root)
        rest = build.document(root)
        begin, end = f"<?{self._mark} ".encode(), b"?>"
        while (at := rest.find(begin)) >= 0:
            number, _, after = rest[at + len(begin) :].partition(end)
            before = rest[:at]
            yield before
            indent = before[before.rfind(b"\n") + 1 :].decode()
            for text in self._polylines[int(number)].text(indent, unit):
                yield text.encode()
            rest = after
        yield rest
