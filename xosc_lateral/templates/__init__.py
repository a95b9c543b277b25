"""Maneuver-based motorway scenarios to start from."""
