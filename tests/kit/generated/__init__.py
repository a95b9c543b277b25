"""Scenarios from seeds, as plain data: roads, what may be in them, their text."""
