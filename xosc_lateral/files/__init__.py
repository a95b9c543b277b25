"""Reads and writes every format; the only folder that touches the disk."""
