"""Names of the core models of this package. (Apart from the models, so that naming one costs no import.)"""

from enum import StrEnum


class ModelKind(StrEnum):
    """Core models of this package; `registry` knows those of plug-ins too, and older names."""

    TWO_LEVEL = "two-level"
    """The paper's, to the letter."""
    AUTOREGRESSIVE = "autoregressive"
    """Ours."""
