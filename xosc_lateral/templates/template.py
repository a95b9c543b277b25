"""What a template is: a name, its parameters, and a function that makes a plot of their values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from xosc_lateral.templates.parameter import Parameter, Settings
from xosc_lateral.templates.storyboard import Plot
from xosc_lateral.templates.surroundings import COMMON


@dataclass(frozen=True, slots=True)
class Template:
    """A maneuver-based scenario with its road, parameterised.

    Parameters
    ----------
    name : str
        As on the command line, and of the files.
    summary : str
        One line.
    own_parameters : tuple of Parameter
        Beside the common ones.
    plot : callable
        Settings to a `Plot`.
    """

    name: str
    summary: str
    own_parameters: tuple[Parameter, ...]
    plot: Callable[[Settings], Plot]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters, its own ones first."""
        return self.own_parameters + COMMON

    def files(self, chosen: Mapping[str, str] | None = None) -> dict[str, str]:
        """File name -> text of the scenario and its road; same settings, same bytes.

        Raises `XoscLateralError` for an unknown parameter or a value out of range.

        Parameters
        ----------
        chosen : mapping of str to str, optional
            Parameters that differ from their defaults, as text.
        """
        settings = Settings(self.parameters, chosen or {})
        plot = self.plot(settings)
        road = f"{self.name}.xodr"
        scenario = plot.to_xml(road, settings, self.parameters)
        return {f"{self.name}.xosc": scenario, road: plot.motorway.to_xml(self.name)}
