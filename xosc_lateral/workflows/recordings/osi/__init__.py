"""Reads ASAM OSI traces."""
