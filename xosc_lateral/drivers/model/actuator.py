"""What a driver does to a vehicle at most, model step by model step: the one place that everything live goes through.

Who knows what comes, as a conversion does, responds to it in good time. Who doesn't would answer a lane that ends or a
neighbour that appears within one step: his response is held to what a driver does while he keeps his lane. And whatever
a profile's numbers come to, a vehicle is asked for nothing that a conversion would refuse.

What is wanted and not yet done is owed, and paid off as fast as one can and still stop there::

    commanded = wanted - owed

As long as that can be driven at all, it is driven; from the first step on that can't, the vehicle is held to what
`plausibility` lets a conversion write.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.limits import OFFSET_LANES
from xosc_lateral.drivers.model.effects import EffectTerms
from xosc_lateral.drivers.model.plausibility import ACCELERATION_LIMIT, GRAVITY, JERK_LIMIT, MINIMUM_LANE_WIDTH
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import Movement, combine, offsets_of

RESPONSE_SPEED, RESPONSE_ACCELERATION = 0.2, 0.06
"""Of a response to context that was not known beforehand. [m/s], [m/s2]

Drivers who keep their lane, half a metre aside within six seconds: with their own movement, at most 0.8 m/s2 of
motorway profiles at 33 m/s, it stays below 1 m/s2 (`laboratory.surprises`).
"""

LARGEST_SPEED, LARGEST_ACCELERATION = ACCELERATION_LIMIT**2 / JERK_LIMIT, ACCELERATION_LIMIT
"""`plausibility`'s acceleration, and the speed that it comes to where it rises and falls again at the largest jerk.

From 40 km/h on, that turns a car against its lane by 9 degrees at most; below, its clock does by 3. [m/s], [m/s2]"""

IMPOSSIBLE_ACCELERATION = GRAVITY
"""More than a tyre's grip on a dry road. [m/s2]"""


def reach_of(width: FloatArray) -> FloatArray:
    """How far from its centre a lane of a width lets anybody be, shape (n,), as `plausibility.check_offsets`. [m]"""
    return np.asarray(OFFSET_LANES.value * np.maximum(width, MINIMUM_LANE_WIDTH))


def stopping_speed(way: FloatArray, push: float, step: float) -> FloatArray:
    """The speed [m/s] from which one stops after just a way [m], shape (n,), by slowing `push` [m/s2] in steps [s]."""
    way, change = np.maximum(way, 0.0), push * step
    further = np.floor(np.sqrt(0.25 + 2.0 * way / (change * step)) - 0.5)  # steps after the first
    return np.asarray(way / (step * (further + 1.0)) + 0.5 * change * further)


def pay_off(owed: FloatArray, pace: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """What is owed a step [s] later, and how fast it is paid off, shape (n,) each. [m], [m/s]

    At once where that is slow and soft enough; else as fast as one can and still stop there.
    """
    change = RESPONSE_ACCELERATION * step
    at_once = owed / step
    fits = (np.abs(at_once - pace) <= change) & (np.abs(at_once) <= RESPONSE_SPEED)
    fastest = np.minimum(RESPONSE_SPEED, stopping_speed(np.abs(owed), RESPONSE_ACCELERATION, step))
    wanted = np.where(np.abs(owed) <= change * step, at_once, np.copysign(fastest, owed))
    pace = np.where(fits, at_once, pace + np.clip(wanted - pace, -change, change))
    return np.where(fits, 0.0, owed - pace * step), pace


def drivable_step(
    wanted: FloatArray, last: FloatArray, before: FloatArray, reach: FloatArray, step: float
) -> FloatArray:
    """The next offset as near to the wanted one as can be driven, after the `last` two, shape (n,) each. [m]"""
    out, back = (
        np.minimum(LARGEST_SPEED, stopping_speed(way, LARGEST_ACCELERATION, step))
        for way in (reach - last, reach + last)
    )
    speed, change = (last - before) / step, LARGEST_ACCELERATION * step
    aim = np.minimum(np.maximum((wanted - last) / step, -back), out)
    return np.asarray(last + step * np.minimum(np.maximum(aim, speed - change), speed + change))


_COMMAND = np.dtype(
    [("samples", float, 4), ("heeded", float, 5), ("owed", float), ("pace", float), ("fault", np.int64)]
)  # fmt: skip
"""Of one driver; see `CommandState`."""


class CommandState(msgspec.Struct, forbid_unknown_fields=True):
    """What was asked of one vehicle."""

    samples: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)  # The last ones. [m]
    # Context that the last one heeds: location [m], factors on spread and fine movement, lane's width [m], and 1 where
    # the driver's own movement counts. A width of 0: none yet.
    heeded: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    owed: float = 0.0  # [m]
    pace: float = 0.0  # At which that is paid off. [m/s]
    fault: int = 0  # What last wanted what can't be driven: see `fault_in_words`.


class Actuator:
    """What is asked of the vehicles of drivers of one profile; each has an index, as in `group.OffsetGroup`.

    `numbers`: which of the profile's effects act, from 1. `is_surprised`: context is not known beforehand, so that its
    changes act no faster than `pay_off` lets them.
    """

    def __init__(self, profile: DriverProfile, numbers: Sequence[int], *, is_surprised: bool) -> None:
        self.profile, self.is_surprised = profile, is_surprised
        self._numbers, self._own = tuple(numbers), len(profile.effects) + 1
        self.state = np.zeros(0, dtype=_COMMAND)

    def join(self, count: int) -> None:
        """So many more drivers."""
        self.state = np.concatenate([self.state, np.zeros(count, dtype=_COMMAND)])

    def keep_present(self, there: BoolArray) -> None:
        """Drop the drivers that are not there, shape (n,)."""
        self.state = self.state[there]

    def note(self, drivers: IntArray, offset: FloatArray) -> None:
        """The next samples of some drivers, shape (m,). [m]"""
        self.state["samples"][drivers] = np.column_stack([self.state["samples"][drivers, 1:], offset])

    def command(
        self, drivers: IntArray, row: IntArray, movement: Movement, hidden: EffectTerms,
        effects: Sequence[EffectTerms], width: FloatArray,
    ) -> FloatArray:  # fmt: skip
        """The next samples of some drivers, shape (m,), at a model step of each, by all that acts on them. [m]

        Who wants too much goes on as if there were no context; if that is too much, to the lane's centre.
        """
        state, step, reach = self.state, self.profile.model.step, reach_of(width)
        offset = offsets_of(self.profile, movement, combine([hidden, *effects]), width)
        before, last = state["samples"][drivers, 2:].T
        has_speed = row >= 2
        wild = ~(np.abs(offset) <= reach)  # also where it is NaN
        owed, pace = state["owed"][drivers], state["pace"][drivers]
        if self.is_surprised or wild.any() or owed.any():
            heeded = _heeded(effects, width)
            if wild.any():
                offset = self._without_context(drivers, movement, hidden, effects, width, wild, offset, heeded)
            owed = owed + self._jump(drivers, movement, hidden, heeded, offset, reach)
            owed, pace = pay_off(owed, pace, step)
            state["heeded"][drivers] = heeded
        wanted = np.where(owed == 0.0, offset, offset - owed)
        state["owed"][drivers], state["pace"][drivers] = owed, pace
        if self.is_surprised:
            thrown = np.abs(wanted - 2.0 * last + before) > IMPOSSIBLE_ACCELERATION * step**2
            thrown = has_speed & (thrown | (np.abs(wanted - last) > LARGEST_SPEED * step))
            state["fault"][drivers[thrown & ~wild]] = self._own
        is_held = state["fault"][drivers] > 0
        if not is_held.any():
            return np.asarray(wanted)
        held = np.where(has_speed, drivable_step(wanted, last, before, reach, step), np.clip(wanted, -reach, reach))
        return np.where(is_held, held, wanted)

    def _jump(
        self, drivers: IntArray, movement: Movement, hidden: EffectTerms, heeded: FloatArray, offset: FloatArray,
        reach: FloatArray,
    ) -> FloatArray:  # fmt: skip
        """By how much a change of context moves what is wanted, of the same movement, shape (m,). [m]"""
        were = self.state["heeded"][drivers]
        were = np.where(were[:, 3:4] > 0.0, were, heeded)  # who begins has always seen what he sees
        changed = (were != heeded)[:, slice(None) if self.is_surprised else slice(4, 5)].any(axis=1)
        if not changed.any():
            return np.zeros(len(drivers))
        terms = combine([hidden, EffectTerms(were[:, 0], were[:, 1], None, were[:, 2])])
        was = were[:, 4] * np.nan_to_num(offsets_of(self.profile, movement, terms, were[:, 3]))
        return np.where(changed, offset - np.minimum(np.maximum(was, -reach), reach), 0.0)

    def _without_context(
        self, drivers: IntArray, movement: Movement, hidden: EffectTerms, effects: Sequence[EffectTerms],
        width: FloatArray, wild: BoolArray, offset: FloatArray, heeded: FloatArray,
    ) -> FloatArray:  # fmt: skip
        """The offsets, shape (m,), where those that are `wild` heed no context, which is noted in `heeded`. [m]"""
        alone = offsets_of(self.profile, movement, hidden, width)
        calm = np.abs(alone) <= reach_of(width)
        heeded[wild, :3] = 0.0, 1.0, 1.0
        heeded[wild, 4] = calm[wild]
        shifts = [np.abs(offsets_of(self.profile, movement, combine([hidden, one]), width) - alone) for one in effects]
        sizes = np.nan_to_num([np.zeros(len(wild)), *shifts], nan=np.inf)
        numbers = np.array([self._own, *self._numbers])[np.argmax(sizes, axis=0)]
        self.state["fault"][drivers[wild]] = np.where(calm, numbers, self._own)[wild]
        return np.where(wild, np.where(calm, alone, 0.0), offset)

    # ---- state -------------------------------------------------------------------------------------------------------
    def states(self) -> list[CommandState]:
        """Of each driver."""
        rows = ([np.asarray(value).tolist() for value in row] for row in self.state.tolist())
        return [CommandState(tuple(samples), tuple(heeded), *others) for samples, heeded, *others in rows]

    def restore(self, driver: int, saved: CommandState) -> None:
        """A driver goes on from a state."""
        self.state[driver] = msgspec.structs.astuple(saved)


def fault_in_words(profile: DriverProfile, fault: int) -> str:
    """What wanted what can't be driven: the effect of that number in the profile, from 1, or the movement itself."""
    if fault > len(profile.effects):
        return "its movement itself"
    effect = profile.effects[fault - 1]
    return f"effect {fault}, {effect.kind} of {', '.join(effect.columns)}"


def _heeded(effects: Sequence[EffectTerms], width: FloatArray) -> FloatArray:
    """What all effects do together, shape (m, 5); see `CommandState`."""
    terms = combine(effects)
    heeded = np.tile((0.0, 1.0, 1.0, 0.0, 1.0), (len(width), 1))
    for column, values in enumerate((terms.location, terms.spread, terms.fine, width)):
        if values is not None:
            heeded[:, column] = values
    return heeded
