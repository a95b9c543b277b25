"""Writing scenarios: trajectories in place of maneuvers, or lane offsets on top of them."""

from xosc_lateral.formats.openscenario.provenance import provenance_of, refuse_converted
from xosc_lateral.formats.openscenario.write.trajectory_scenario import WrittenScenario, write_trajectory_scenario

__all__ = ["WrittenScenario", "provenance_of", "refuse_converted", "write_trajectory_scenario"]
