"""Trailers: drawn behind their tractor on a drawbar, the coupler always in the hitch.

Derived here: the line from hitch to coupler keeps its direction towards where the trailer was (a tractrix in small
steps); its length is the drawbar's.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import atan2, cos, hypot, nan, pi, sin

from xosc_lateral.world.player.angles import wrap
from xosc_lateral.world.player.state import EntityState, free

_TRACTOR_HITCH = -1.0
_TRAILER_COUPLER = 2.0
"""Where a file says nothing of hitch and coupler: [m] ahead of the reference point."""


def connect(tow: EntityState, trailer: EntityState) -> None:
    """Hitch a trailer; whatever pulled it before lets go."""
    if trailer.tow is not None:
        disconnect(trailer.tow)
    tow.trailer, trailer.tow = trailer, tow


def disconnect(tow: EntityState) -> None:
    """Let the trailer go."""
    if tow.trailer is not None:
        tow.trailer.tow = None
        tow.trailer = None


def drawn_by(front: EntityState) -> Iterator[tuple[EntityState, EntityState]]:
    """All that hangs on a vehicle: each with what pulls it, from the front."""
    while front.trailer is not None:
        yield front, front.trailer
        front = front.trailer


def align_trailers(front: EntityState) -> None:
    """Put all trailers straight behind their tractor."""
    for tow, trailer in drawn_by(front):
        pose = tow.plane
        reach = _hitch(tow) - _coupler(trailer)
        trailer.put_in_world(free(pose.x + reach * cos(pose.heading), pose.y + reach * sin(pose.heading), pose.heading))
        trailer.set_speed(front.speed)


def pull_trailers(entities: Iterable[EntityState]) -> None:
    """Draw every trailer to where its hitch has gone: it turns so that its coupler is there."""
    for front in entities:
        if front.tow is None:
            for tow, trailer in drawn_by(front):
                _pull(tow, trailer)
                trailer.set_speed(tow.speed)


def _pull(tow: EntityState, trailer: EntityState) -> None:
    pose, pulled = tow.plane, trailer.plane
    hitch_x = pose.x + _hitch(tow) * cos(pose.heading)
    hitch_y = pose.y + _hitch(tow) * sin(pose.heading)
    dx, dy = pulled.x - hitch_x, pulled.y - hitch_y
    length = hypot(dx, dy)
    if length < 1e-9:
        dx, dy, length = -cos(pulled.heading), -sin(pulled.heading), 1.0
    reach = _coupler(trailer) / length
    heading = wrap(atan2(dy, dx) + pi)
    trailer.put_in_world(free(hitch_x + reach * dx, hitch_y + reach * dy, heading, nan))


def _hitch(state: EntityState) -> float:
    hitch = state.entity.hitch_x
    return _TRACTOR_HITCH if hitch is None else hitch


def _coupler(state: EntityState) -> float:
    coupler = state.entity.coupler_x
    return _TRAILER_COUPLER if coupler is None else coupler
