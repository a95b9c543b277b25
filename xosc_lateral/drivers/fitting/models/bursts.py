"""Bursts: drivers who move in one second as they haven't for a minute.

Standard deviations of snippets say how far the size of movement varies from snippet to snippet, and nothing about the
few fast seconds that set off an alarm. The kurtosis of lateral speed does. A volatility with a memory of seconds that
reaches it makes snippets differ too much; one that is new every second leaves them as they are [1]_.

References
----------
.. [1] T. Bollerslev, "A conditionally heteroskedastic time series model for speculative prices", Review of Economics
   and Statistics 69, 1987: volatility that lasts and shocks with heavy tails beside each other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from msgspec.structs import replace

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.model.core.autoregressive.model import AutoregressiveModel
from xosc_lateral.drivers.model.core.autoregressive.parameters import COARSE_EVERY

Draw = Callable[[AutoregressiveModel], FloatArray]
"""Paths of a model, shape (drivers, n), from the same sources of chance at each call. [lane widths]"""

BURST_TIME = 0.5
"""Memory of bursts: a seventh of the logarithm is left a coarse step later, a fiftieth after two. [s]"""

MORE_VARIANCE = np.array([0.0, 0.1, 0.2, 0.35, 0.55, 0.8])
"""That is tried in the factor's logarithm: with the last, one second in a hundred is six times as lively. [-]"""

MANY_DRIVES, PIECE = 6, 300
"""From so many drives on they are what chance draws; of fewer, pieces of so many rows (a minute). [-], [rows]"""


def with_bursts(
    model: AutoregressiveModel, runs: Sequence[FloatArray], drives: Sequence[str], draw: Draw
) -> AutoregressiveModel:
    """A model whose lateral speeds have the kurtosis of measured ones, as far as that is beyond chance.

    From runs of shape (n_i,) [lane widths], and whose drive each is of. What is lacking counts less the more of it
    could be chance (James and Stein's estimate); where all of it could be, the model stays as it is.
    """
    measured, error = _measured(runs, drives)
    paths = draw(model)
    shown = log_kurtosis(paths)
    lack = measured - shown
    if not abs(lack) > error:
        return model
    wanted = shown + lack * (1.0 - (error / lack) ** 2)
    if lack < 0.0:
        return _calmed(model, wanted, draw, paths)
    fast = replace(model, coarse_volatility=replace(model.coarse_volatility, correlation_time=BURST_TIME))
    return _bursting(fast, wanted, draw, _level(paths))


LESS_SHARE = (0.0, 0.1, 0.25, 0.5, 0.75, 1.0)
"""Of what volatilities vary within seconds, as tried. [-]"""


def _calmed(model: AutoregressiveModel, wanted: float, draw: Draw, paths: FloatArray) -> AutoregressiveModel:
    """A model whose volatilities vary within seconds by so much less that lateral speeds have a log kurtosis.

    What differs from window to window without being lively in any second is no volatility: a driver who corrects now
    and then. Typical movement and acceleration stay as large as in `paths`.
    """

    def calm(share: float) -> AutoregressiveModel:
        coarse, fine = model.coarse_volatility, model.fine_volatility
        return replace(
            model,
            coarse_volatility=replace(coarse, within=share * coarse.within),
            fine_volatility=replace(fine, within=share * fine.within),
        )

    shown = np.maximum.accumulate([log_kurtosis(draw(calm(share))) for share in LESS_SHARE])
    made = calm(float(np.interp(wanted, shown, LESS_SHARE)))
    now = draw(made)
    slow, fast = (float(np.exp(level(paths) - level(now))) for level in (_level, _roughness))
    coarse, fine = made.coarse, made.fine
    return replace(
        made, coarse=replace(coarse, scale=coarse.scale * slow), fine=replace(fine, damping=fine.damping * fast)
    )


def _roughness(paths: FloatArray) -> float:
    """Mean logarithm of the standard deviations of paths' second differences. [log of the unit]"""
    return float(np.log(np.diff(paths, 2, axis=1).std(axis=1) + 1e-12).mean())


def _bursting(model: AutoregressiveModel, wanted: float, draw: Draw, level: float) -> AutoregressiveModel:
    """A model whose coarse volatility varies within seconds by so much more that lateral speeds have a log kurtosis.

    Typical movement is then as large as a `level` says. [log of lane widths]
    """

    def varying(variance: float) -> AutoregressiveModel:
        return replace(model, coarse_volatility=replace(model.coarse_volatility, within=variance))

    tried, shown = (model.coarse_volatility.within + MORE_VARIANCE).tolist(), list[float]()
    for variance in tried:
        shown.append(max([log_kurtosis(draw(varying(variance))), *shown]))
        if shown[-1] > wanted:  # what comes has more still
            break
    made = varying(float(np.interp(wanted, shown, tried[: len(shown)])))
    scale = made.coarse.scale * float(np.exp(level - _level(draw(made))))
    return replace(made, coarse=replace(made.coarse, scale=scale))


def log_kurtosis(paths: FloatArray) -> float:
    """Logarithm of the kurtosis of lateral speeds over a second, about 0, of paths of shape (k, n). [-]"""
    square = (paths[:, COARSE_EVERY:] - paths[:, :-COARSE_EVERY]) ** 2
    return float(np.log((square**2).mean()) - 2.0 * np.log(square.mean()))


def _measured(runs: Sequence[FloatArray], drives: Sequence[str]) -> tuple[float, float]:
    """The same of runs, and its standard error, by what each drive (or piece) does to it. [-]"""
    several = len(set(drives)) >= MANY_DRIVES
    sums: dict[str, FloatArray] = {}
    for number, (run, drive) in enumerate(zip(runs, drives, strict=True)):
        square = (run[COARSE_EVERY:] - run[:-COARSE_EVERY]) ** 2
        pieces = [square] if several else np.array_split(square, -(-len(run) // PIECE))
        for part, piece in enumerate(pieces):
            key = drive if several else f"{number} {part}"
            sums[key] = sums.get(key, np.zeros(3)) + np.array([(piece**2).sum(), piece.sum(), len(piece)])
    each = np.array(list(sums.values()))
    whole = each.sum(axis=0)
    powers = np.array([1.0, -2.0, 1.0])  # log of n * sum of fourth powers / square of the sum of squares
    influence = (each / whole) @ powers
    count = max(len(each), 2)
    return float(np.log(whole) @ powers), float(np.sqrt((influence**2).sum() * count / (count - 1)))


def _level(paths: FloatArray) -> float:
    """Mean logarithm of paths' standard deviations, half of the offset's, half of its change's. [log of the unit]"""
    return float(np.mean([np.log(np.diff(paths, k, axis=1).std(axis=1) + 1e-12).mean() for k in range(2)]))
