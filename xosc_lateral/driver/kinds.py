"""Names of the core models that can be fitted."""

from enum import StrEnum


class ModelKind(StrEnum):
    """Core models that can be fitted."""

    TWO_LEVEL = "two-level"
    """The paper's, to the letter."""
    BEST = "best"
    """Ours."""
