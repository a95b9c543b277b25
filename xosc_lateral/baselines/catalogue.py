"""Every model on the board, in the order in which the field came up with them."""

from __future__ import annotations

from xosc_lateral.baselines.base import LateralModel
from xosc_lateral.baselines.bounded_noise import BoundedNoise
from xosc_lateral.baselines.constant_offset import ConstantOffset
from xosc_lateral.baselines.gaussian_process import GaussianProcess
from xosc_lateral.baselines.intermittent import Intermittent
from xosc_lateral.baselines.lane_centre import LaneCentre
from xosc_lateral.baselines.lc_sigma import LcSigma
from xosc_lateral.baselines.linear_preview import LinearPreview
from xosc_lateral.baselines.ornstein_uhlenbeck import OrnsteinUhlenbeck
from xosc_lateral.baselines.potential_field import PotentialField
from xosc_lateral.baselines.profiles import Autoregressive, TwoLevel, TwoLevelRefined
from xosc_lateral.baselines.sloppy_driver import SloppyDriver
from xosc_lateral.baselines.social_force import SocialForce
from xosc_lateral.baselines.strip_based import StripBased
from xosc_lateral.baselines.sumo_run import SumoRun

MODELS: dict[str, type[LateralModel]] = {
    "lane-centre": LaneCentre,
    "constant": ConstantOffset,
    "ornstein-uhlenbeck": OrnsteinUhlenbeck,
    "sloppy-driver": SloppyDriver,
    "lc-sigma": LcSigma,
    "sumo": SumoRun,
    "strips": StripBased,
    "potential-field": PotentialField,
    "social-force": SocialForce,
    "bounded-noise": BoundedNoise,
    "gaussian-process": GaussianProcess,
    "linear-preview": LinearPreview,
    "intermittent": Intermittent,
    "two-level": TwoLevel,
    "two-level-refined": TwoLevelRefined,
    "autoregressive": Autoregressive,
}
"""Name on the command line -> class."""
