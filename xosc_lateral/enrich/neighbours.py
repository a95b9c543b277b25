"""Whose answer to vehicles beside them drivers have."""

from __future__ import annotations

from enum import StrEnum


class Neighbours(StrEnum):
    """What a conversion does where a profile's own answer to neighbours is not known, or whether there is any."""

    PROFILE = "profile"
    BORROW = "borrow"
    NONE = "none"
