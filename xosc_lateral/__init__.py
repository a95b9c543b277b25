"""Lifelike lateral movement for OpenSCENARIO traffic."""

__version__ = "0.1.0"
