"""Core models: one package each, what they share in `base` and `noise`, the list in `registry`."""
