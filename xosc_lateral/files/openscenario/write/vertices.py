"""Vertices of trajectories, which become text only while the document is written: as elements they take 3 kB each."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from lxml import etree
from msgspec import Struct

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.files.openscenario.write import build

BLOCK = 1000
"""Vertices that are text at a time."""

_POSE, _MOTION = ("x", "y", "z", "h", "p", "r"), ("speed_longitudinal", "acceleration_longitudinal")

_DIGITS = (6, 5, 5, 5, 6, 6, 6, 4, 4)
"""Decimals of the time and of these."""


ColumnsOf = Callable[[slice], Sequence[FloatArray]]


class TimedVertices(Struct, frozen=True, eq=False):
    """Vertices of one trajectory.

    Parameters
    ----------
    count : int
        How many they are.
    columns_of : callable
        Gives, for some of them, time [s], x, y, z [m], heading, pitch, roll [rad] and, where vertices have a motion,
        speed [m/s] and acceleration [m/s2]; shape (n,) each.
    """

    count: int
    columns_of: ColumnsOf

    def text(self, indent: str, unit: str) -> Iterator[str]:
        """XML of the vertices, set out at `indent`, each level below by `unit` more; the first without its indent."""
        inner, innermost = f"\n{indent}{unit}", f"\n{indent}{unit}{unit}"
        for begin in range(0, self.count, BLOCK):
            block = np.stack(self.columns_of(slice(begin, begin + BLOCK)))
            varies = np.ptp(block, axis=1) != 0.0
            digits = _DIGITS[: len(block)]
            time, *values = ("%s" if varies[k] else build.decimal(block[k, 0], count) for k, count in enumerate(digits))
            pose, motion = (
                "".join(f' {name}="{value}"' for name, value in zip(names, part, strict=True))
                for names, part in ((_POSE, values[:6]), (_MOTION[: len(values) - 6], values[6:]))
            )
            vertex = (
                f'<Vertex time="{time}">{inner}<Position>{innermost}<WorldPosition{pose}/>{inner}</Position>'
                + (f"{inner}<Motion{motion}/>" if motion else "")
                + f"\n{indent}</Vertex>"
            )
            numbers = build.decimals(block[varies].T, [_DIGITS[k] for k in np.flatnonzero(varies)])
            text = f"\n{indent}".join([vertex] * block.shape[1]) % numbers
            yield (f"\n{indent}" if begin else "") + text


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
