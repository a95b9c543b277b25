"""Every model on the board, in the order in which the field came up with them."""

from __future__ import annotations

from benchmarks.board.models.base import LateralModel
from benchmarks.board.models.bounded_noise import BoundedNoise
from benchmarks.board.models.constant_offset import ConstantOffset
from benchmarks.board.models.gaussian_process import GaussianProcess
from benchmarks.board.models.intermittent import Intermittent
from benchmarks.board.models.lane_centre import LaneCentre
from benchmarks.board.models.lc_sigma import LcSigma
from benchmarks.board.models.linear_preview import LinearPreview
from benchmarks.board.models.ornstein_uhlenbeck import OrnsteinUhlenbeck
from benchmarks.board.models.potential_field import PotentialField
from benchmarks.board.models.profiles import Autoregressive, TwoLevel, TwoLevelRefined
from benchmarks.board.models.sloppy_driver import SloppyDriver
from benchmarks.board.models.social_force import SocialForce
from benchmarks.board.models.strip_based import StripBased
from benchmarks.board.models.sumo_run import SumoRun

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
