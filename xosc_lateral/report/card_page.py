"""A driver profile's card as a page: what it does, where it comes from, how true it is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.evaluation.metrics import DURATION, free_runs, summarise
from xosc_lateral.evaluation.spectra import Spectrum, spectrum
from xosc_lateral.formats.profiles import profile_hash
from xosc_lateral.report.cards import amount, effect_line, provenance_items
from xosc_lateral.report.figures import GRID, SAMPLED, figure_style, new_figure, new_panels
from xosc_lateral.report.render import KeyFigure, render_page

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

SHOWN_DRIVERS, SHOWN_S = 6, 120.0
"""Sample paths that are drawn, and their length. [s]"""

TICK_M = 0.5
"""Between the ticks of offsets. [m]"""


def card_page(profile: DriverProfile, seed: int = 0) -> str:
    """HTML page; same profile and seed, same bytes.

    Parameters
    ----------
    profile : DriverProfile
    seed : int
        Of the free runs that are drawn and summed up.
    """
    runs, step = free_runs(profile, seed), profile.model.step
    summary = summarise(runs, step)
    known = profile.provenance
    side = "left" if summary.mean_offset > 0 else "right"
    within = "" if known.drives == 1 else f"one driver over {DURATION / 60:g} min: {summary.spread_within:.2f} m"
    return render_page(
        "card.html",
        title=f"Driver profile {profile.name}",
        provenance={
            "profile sha256": profile_hash(profile),
            "inputs": {name: digest[:12] for name, digest in known.inputs.items()},
            "seed of the free runs": seed,
        },
        profile=profile,
        known=known,
        numbers=[
            KeyFigure(f"{abs(summary.mean_offset):.2f} m", f"mean offset, to the {side}"),
            KeyFigure(f"{summary.spread:.2f} m", "standard deviation over all drivers", within),
            KeyFigure(
                f"{summary.low:+.2f} to {summary.high:+.2f}\N{NO-BREAK SPACE}m",
                "5 % to 95 %",
                "positive: left of the lane centre",
            ),
            KeyFigure(f"{summary.lateral_speed:.3f} m/s", "lateral speed", "root mean square"),
        ],
        paths=_paths(runs, step),
        places=_places(runs, spectrum(list(runs), step)),
        effects=[effect_line(effect) for effect in profile.effects],
        facts=[
            {"fact": name, "value": value} for name, value in (("fitted on", amount(profile)), *provenance_items(known))
        ],
    )


@figure_style()
def _paths(runs: FloatArray, step: float) -> Figure:
    from matplotlib.ticker import MultipleLocator

    figure, axes = new_panels(min(SHOWN_DRIVERS, len(runs)), sharex=True, sharey=True, panel_height=0.6)
    for number, (axis, run) in enumerate(zip(axes[:, 0], runs, strict=False), start=1):
        shown = run[: round(SHOWN_S / step) + 1]
        axis.plot(step * np.arange(len(shown)), shown, color=SAMPLED, label=f"driver {number}")
        axis.axhline(0.0, color=GRID, linewidth=0.8)
        axis.set_title(f"Driver {number}")
    axes[0, 0].yaxis.set_major_locator(MultipleLocator(TICK_M))
    axes[len(axes) // 2, 0].set_ylabel("offset [m]")
    axes[-1, 0].set_xlabel("time [s]")
    return figure


@figure_style()
def _places(runs: FloatArray, power: Spectrum) -> Figure:
    figure, axes = new_figure(1, 2, height=3.0)
    place, spectral = axes[0]
    edges = np.linspace(-1.2, 1.2, 97)
    density, _ = np.histogram(runs, edges, density=True)
    place.plot(0.5 * (edges[1:] + edges[:-1]), density, color=SAMPLED, label="density")
    place.set(xlabel="offset [m], positive to the left", ylabel="density [1/m]", title="Distribution")
    spectral.loglog(power.frequency, power.density, color=SAMPLED, label="power density")
    spectral.set(xlabel="frequency [Hz]", ylabel="power density [m²/Hz]", title="Spectrum")
    return figure
