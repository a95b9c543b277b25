"""The version, apart from the front door: outputs state it, and nothing below may import what lies above."""

__version__ = "0.1.0"
