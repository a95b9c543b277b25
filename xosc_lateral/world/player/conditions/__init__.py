"""Conditions while playing; each family's module lists its own in `CHECKS`."""
