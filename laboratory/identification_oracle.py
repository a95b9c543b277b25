"""What the data can show of a planted effect: its size and z by who knows what acts, and what the car does without."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from laboratory.identification_cases import as_provided
from laboratory.identification_drives import parts_of, unit, with_mean
from xosc_lateral.extras.loop.model import fit_model
from xosc_lateral.extras.loop.significance import LEAST_SHIFT_S, MANY_DRIVES
from xosc_lateral.extras.loop.timeline import Coarse, join_drives
from xosc_lateral.files.drives import drives_of_table

Values = np.ndarray


def coarse_of(table: pd.DataFrame) -> Coarse:
    """A table at 1 Hz."""
    return Coarse.of(join_drives(drives_of_table(table, {})))


def oracle(case: dict[str, Any], bare: pd.DataFrame, coarse: Coarse) -> dict[str, float]:
    """Size and z of what was planted, in the table's own noise.

    Generalised least squares of the offsets on what the effect does in this very table, up to its size, whitened by the
    movement without it. The error is that movement's own: of its rows in all rotations, or, where there are many
    drives, from drive to drive. Of an effect in two parts (both neighbours) the part with the smaller z.
    """
    without = coarse_of(as_provided(case, bare))
    parts = [with_mean(bare, case["name"], case["size"], case["seed"], part) for part in parts_of(case["name"], bare)]
    valid = coarse.valid & without.valid
    whitener = fit_model(without, ()).whitener
    told = np.stack([coarse_of(as_provided(case, part)).offset - without.offset for part in parts], axis=1)
    design, seen, noise = (whitener.rows(values)[valid] for values in (told, coarse.offset, without.offset))
    inverse = np.linalg.inv(design.T @ design)
    sizes = inverse @ (design.T @ seen)
    if coarse.drives >= MANY_DRIVES:
        scores = np.stack([np.bincount(coarse.drive[valid], column * noise) for column in design.T], axis=1)
        power = scores.T @ scores
    else:
        power = power_of_rotations(design, noise - noise.mean())
    errors = np.sqrt(np.diag(inverse @ power @ inverse))
    weaker = int(np.argmin(np.abs(sizes) / errors))
    size, error = case["size"] * sizes[weaker], case["size"] * errors[weaker]
    return {"oracle_z": float(size / error), "oracle_size": float(size), "oracle_error": float(error)}


def power_of_rotations(design: Values, noise: Values) -> Values:
    """Mean outer product of the scores of rotated noise, shape (k, k), over all rotations of a minute and more."""
    turned = np.fft.rfft(noise)[:, None] * np.conj(np.fft.rfft(design, axis=0))
    scores = np.fft.irfft(turned, len(noise), axis=0)[LEAST_SHIFT_S:-LEAST_SHIFT_S]
    return np.asarray(scores.T @ scores / len(scores))


def oracle_between(case: dict[str, Any], table: pd.DataFrame) -> dict[str, float]:
    """The same between drives: their mean offsets on what was planted, lane told."""
    means = table.groupby("drive")[["offset", "speed", "lane_index"]].mean()
    usual = unit(table.groupby("drive")["speed"].transform("mean").to_numpy())
    own = pd.Series(usual, index=table["drive"]).groupby(level=0).first().loc[means.index]
    design = np.stack([own, means["lane_index"], np.ones(len(means))], axis=1)
    sizes = np.linalg.lstsq(design, means["offset"], rcond=None)[0]
    left = means["offset"] - design @ sizes
    error = float(np.sqrt(left @ left / (len(means) - 3) * np.linalg.inv(design.T @ design)[0, 0]))
    return {"oracle_z": float(sizes[0]) / error, "oracle_size": float(sizes[0]), "oracle_error": error}
