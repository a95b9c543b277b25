"""States of offset streams as package version 0.1 saved them: all attributes of its objects, by their names there."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from xosc_lateral.driver.effects import Cycle, Drift, HiddenEffect, Population, Regimes
from xosc_lateral.driver.models.autoregressive.driver import draw_drivers
from xosc_lateral.driver.models.autoregressive.model import AutoregressiveModel
from xosc_lateral.driver.models.base import Start
from xosc_lateral.driver.models.two_level.model import TwoLevelModel
from xosc_lateral.driver.profile import DriverProfile, sampling_hash
from xosc_lateral.driver.records import plain
from xosc_lateral.driver.seeds import AutoregressiveSeed, DriveSeed, generator
from xosc_lateral.driver.versions import as_version_1
from xosc_lateral.errors import DriverProfileError

BLOCK = 64
"""Model steps that version 0.1 drew at once. [-]"""

TERMS = ("location", "spread", "rate", "fine")


def from_version_1(state: Mapping[str, Any], profile: DriverProfile) -> dict[str, Any]:
    """A state's values as the present version writes them.

    Raises
    ------
    DriverProfileError
        If it is of another profile, or has a core model that version 0.1 didn't know.
    """
    if state["profile"] != _hash(profile):
        raise DriverProfileError(f"the state belongs to another profile than {profile.name}")
    same = ("seed", "factor", "start", "time", "known", "widths", "recalled", "looked", "phase", "samples", "curve")
    movement = state["movement"]
    return {name: state[name] for name in same} | {
        "profile": sampling_hash(profile),
        "row": movement["row"],
        "answers": [_response(response, state["recalled"]) for response in state["answers"]],
        "process": _process(movement, profile, state),
    }


def _hash(profile: DriverProfile) -> str:
    return hashlib.sha256(json.dumps(as_version_1(profile.to_dict()), sort_keys=True).encode()).hexdigest()


def _response(saved: Mapping[str, Any], recalled: int) -> dict[str, Any]:
    rows = saved["rows"]
    response = {name: saved[name] for name in ("taken", "given", "settled")} | {"held": rows or None}
    return {"response": response, "ready": [], "drop": max(0, recalled - saved["given"])}


def _process(movement: Mapping[str, Any], profile: DriverProfile, state: Mapping[str, Any]) -> dict[str, Any]:
    """Core and hidden effects. Version 0.1 held blocks that begin at whole multiples of `BLOCK`."""
    row = movement["row"]
    place = row % BLOCK
    left = BLOCK - place if place else 0
    hidden = [effect for effect in profile.effects if isinstance(effect, HiddenEffect)]
    terms = [movement["terms"][name] for name in TERMS]
    values = {
        "begun_at": state["time"],
        "core": None,
        "hidden": [_hidden(effect, own) for effect, own in zip(hidden, movement["hidden"], strict=True)],
        "terms": [None if part is None else part[place:] if place else [] for part in terms],
        "first": row,
        "drawn": row + left if hidden else 0,
        "coarse": movement["coarse"][place:] if place else [],
        "fine": movement["fine"][place:] if place else [],
    }
    if movement["core"] is not None:
        values["core"] = _core(movement, profile, state["seed"])
    return values


def _hidden(effect: HiddenEffect, old: Mapping[str, Any]) -> dict[str, Any]:
    if isinstance(effect, Drift):
        return {"rng": _rng(old["_rng"]), "value": old["_wander"], "begun": old["_keep"] is not None}
    if isinstance(effect, Cycle):
        return {"rng": _rng(old["_rng"]), "phase": old["_start"], "kicks": old["_kicks"], "begun_at": old["_begin"]}
    if isinstance(effect, Regimes):
        return {"rng": _rng(old["_rng"]), "on": old["_on"], "end": old["_end"], "begun_at": old["_begin"]}
    if isinstance(effect, Population):
        return dict(zip(("shift", "spread", "fine"), old["_driver"], strict=True))
    return {}


def _core(movement: Mapping[str, Any], profile: DriverProfile, seed: Mapping[str, Any]) -> dict[str, Any]:
    if isinstance(profile.model, TwoLevelModel):
        return _two_level(movement["core"])
    if not isinstance(profile.model, AutoregressiveModel):
        raise DriverProfileError(f"version 0.1 had no {profile.model.kind} model")
    # The driver was not saved but drawn anew from the same seed.
    begun = None if movement["begun"] is None else Start(**movement["begun"])
    own = np.random.SeedSequence(seed["entropy"], spawn_key=tuple(seed["spawn_key"]))
    rng = generator(own, DriveSeed.CORE, AutoregressiveSeed.DRIVER)
    driver = draw_drivers(profile.model, begun, rng, 1)
    return _autoregressive(movement["core"]) | {"driver": plain(driver)}


def _two_level(old: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "chain": _rng(old["_chain_rng"]),
        "noise": _rng(old["_noise_rng"]),
        "bins": [old["_state"]],
        "levels": _column(old["_levels"]),
        "white": _column(old["_white"]),
        "fade": _column(old["_fade"]),
        "clock": _clock(old["_pace"]["object"]),
    }


def _autoregressive(old: Mapping[str, Any]) -> dict[str, Any]:
    coarse, fine = old["_coarse"]["object"], old["_fine"]["object"]
    factors = coarse["_factors"]["object"]
    made = [_column(part) for part in factors["_made"]]
    queue = {"skip": [0]}
    return {
        "factors": {
            "quick": _wander(factors["_wander"]["object"]),
            "slow": _wander(factors["_slow"]["object"]),
            "coarse": made[0],
            "fine": made[1],
        },
        "coarse": queue
        | {
            "made": _column(coarse["_made"]),
            "bridge": _column(old["_coarse_pull"]),
            "rng": _rng(coarse["_rng"]),
            "past": _column(coarse["_past"]),
            "held": _column(coarse["_held"]),
        },
        "fine": queue
        | {
            "made": _column(fine["_made"]),
            "bridge": _column(old["_fine_pull"]),
            "rng": _rng(fine["_rng"]),
            "last_factor": _column(fine["_last_factor"]),
            "noise": _column(fine["_noise"]),
        },
        "knees": [[bend[0]] for bend in old["_bends"]],
        "limits": [[bend[1]] for bend in old["_bends"]],
        "clock": _clock(old["_pace"]["object"]),
    }


def _wander(old: Mapping[str, Any]) -> dict[str, Any]:
    return {"rng": _rng(old["_rng"]), "values": _column(old["_values"])}


def _clock(old: Mapping[str, Any]) -> dict[str, Any]:
    return {"time": old["_tau"], "held": _column(old["_held"]), "first": old["_first"]}


def _column(old: Mapping[str, Any]) -> Any:
    """An array of shape (n,) as one of shape (n, 1)."""
    return [[value] for value in old["array"]] or {"shape": [0, 1]}


def _rng(old: Mapping[str, Any]) -> Any:
    return old["generator"]
