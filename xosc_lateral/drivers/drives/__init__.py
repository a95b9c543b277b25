"""Measured drives: rows as recorded, cuts, resampling. One way from raw rows to runs."""
