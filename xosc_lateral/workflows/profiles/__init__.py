"""Verbs about profiles: fit, sample, evaluate, compare, close the loop."""
