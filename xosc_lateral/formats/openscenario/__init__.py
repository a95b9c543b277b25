"""OpenSCENARIO XML 1.0 to 1.3: reader and writer."""

from xosc_lateral.formats.openscenario.distribution import LogicalScenario, is_distribution, read_distribution
from xosc_lateral.formats.openscenario.read import read_scenario

__all__ = ["LogicalScenario", "is_distribution", "read_distribution", "read_scenario"]
