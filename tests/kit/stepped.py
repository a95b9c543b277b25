"""Live drivers whose context steps: numbered like the drivers that `sample` gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.seeds import child
from xosc_lateral.extras.live.traffic import Moment, Traffic


class Numbered(Traffic):
    """Vehicles whose names are seeds; their drivers are those that `sample` gives for them."""

    def seed_of(self, name: str) -> np.random.SeedSequence:
        return child(np.random.SeedSequence(int(name)), 0)


def stepped_offsets(
    profile: DriverProfile, seeds: int, steps: int, step: float, context_at: Callable[[float], Mapping[str, float]]
) -> tuple[np.ndarray, Traffic]:
    """Offsets of so many drivers, shape (steps + 1, seeds) [m], every step [s]; `context_at`: columns by time [s]."""
    traffic, names = Numbered(profile), tuple(map(str, range(1, seeds + 1)))
    offset, yes, rows = np.zeros(seeds), np.ones(seeds, dtype=bool), []
    for k in range(steps + 1):
        values = context_at(k * step)
        context = {name: np.full(seeds, value) for name, value in values.items()}
        others = {name: column for name, column in context.items() if name not in ("speed", "lane_width", "is_truck")}
        truck = yes if values.get("is_truck") else ~yes
        moment = Moment(names, context["speed"], context["lane_width"], offset, yes, yes, truck, context=others)
        offset = traffic.step(k * step, moment).offset
        rows.append(offset)
    return np.array(rows), traffic
