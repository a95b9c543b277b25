"""Versions, apart from the front door: outputs state them, and nothing below may import what lies above."""

__version__ = "0.2.0"

BEHAVIOUR = 9
"""What decides the bytes of an output from the same inputs, settings and seed: playing, sampling, writing.

It grows by one with every change of those bytes, so that batches make anew what an older program wrote, and no more.
`tests/test_behaviour.py` holds outputs that may change only together with it.
"""
