"""UN R157's requirement by a formula: which cut-ins a driver of 0.35 s and 6 m/s2 must prevent."""

from __future__ import annotations

import numpy as np

from laboratory.r157.cut_in import intrudes
from laboratory.r157.encounters import Ego, EncounterOutcome, Traffic, see

REACTION, REQUIRED_BRAKING = 0.35, 6.0
"""Of paragraph 5.2.5.2. [s], [m/s2]"""


def required_by_reaction_time(traffic: Traffic, ego: Ego) -> EncounterOutcome:
    """Paragraph 5.2.5.2: must be avoided if, at lane intrusion, ``TTC > v_rel / (2 * 6 m/s2) + 0.35 s``.

    `prevented` says that the regulation asks for it; `smallest_gap` is what full use of the formula leaves: the gap at
    intrusion less the way of reaction and braking. Without intrusion, or with a vehicle that is not slower: true.
    """
    n, m = traffic.position.shape
    time = traffic.step * np.arange(m)
    lateral = traffic.lateral_speed
    place = ego.position + ego.speed * time
    every = [see(traffic, k, np.full(n, place[k]), np.full(n, ego.speed), ego, lateral[:, k]) for k in range(m)]
    flags = np.array([intrudes(seen) for seen in every]).T
    first, has = flags.argmax(axis=1), flags.any(axis=1)
    gap = np.array([seen.gap for seen in every]).T[np.arange(n), first]
    closing = np.array([seen.closing for seen in every]).T[np.arange(n), first]
    slower = closing > 0.0
    left = gap - closing * REACTION - closing**2 / (2.0 * REQUIRED_BRAKING)
    danger = has & slower
    noticed = np.where(has, time[first], np.nan)
    return EncounterOutcome(~danger | (left > 0.0), np.where(danger, left, np.nan), noticed, noticed + REACTION)
