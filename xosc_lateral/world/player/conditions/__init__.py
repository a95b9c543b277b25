"""Conditions while playing, one per file. A new one is a file here and a line in the tuples of `registry`."""
