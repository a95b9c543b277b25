"""OpenSCENARIO XML 1.0 to 1.3: reader and writer."""

from xosc_lateral.formats.openscenario.read import read_scenario

__all__ = ["read_scenario"]
