"""Every model on the board, in the order in which the field came up with them."""

from __future__ import annotations

from laboratory.board.models.base import LateralModel
from laboratory.board.models.bounded_noise import BoundedNoise
from laboratory.board.models.constant_offset import ConstantOffset
from laboratory.board.models.gaussian_process import GaussianProcess
from laboratory.board.models.intermittent import Intermittent
from laboratory.board.models.lane_centre import LaneCentre
from laboratory.board.models.lc_sigma import LcSigma
from laboratory.board.models.linear_preview import LinearPreview
from laboratory.board.models.ornstein_uhlenbeck import OrnsteinUhlenbeck
from laboratory.board.models.potential_field import PotentialField
from laboratory.board.models.profiles import Autoregressive, TwoLevel, TwoLevelRefined
from laboratory.board.models.sloppy_driver import SloppyDriver
from laboratory.board.models.social_force import SocialForce
from laboratory.board.models.strip_based import StripBased
from laboratory.board.models.sumo_run import SumoRun

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
