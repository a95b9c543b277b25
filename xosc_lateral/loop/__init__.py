"""Scores, residual, tracing, closing the loop."""
