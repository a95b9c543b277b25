"""Writing scenarios: trajectories in place of maneuvers, or lane offsets on top of them."""

from xosc_lateral.formats.openscenario.provenance import provenance_of, refuse_converted
from xosc_lateral.formats.openscenario.write.build import named
from xosc_lateral.formats.openscenario.write.lane_offset_scenario import write_lane_offset_scenario
from xosc_lateral.formats.openscenario.write.offset_chain import OffsetChain, offset_chains
from xosc_lateral.formats.openscenario.write.result import WrittenScenario
from xosc_lateral.formats.openscenario.write.sampled import motion_unknown_to
from xosc_lateral.formats.openscenario.write.target import STANDARD, Player, TargetPlayer, target
from xosc_lateral.formats.openscenario.write.trajectory_scenario import write_trajectory_scenario

__all__ = [
    "STANDARD",
    "OffsetChain",
    "Player",
    "TargetPlayer",
    "WrittenScenario",
    "motion_unknown_to",
    "named",
    "offset_chains",
    "provenance_of",
    "refuse_converted",
    "target",
    "write_lane_offset_scenario",
    "write_trajectory_scenario",
]
