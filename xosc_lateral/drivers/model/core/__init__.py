"""Core models: one package each, what they share in `base`, `mean_reversion` and `noise`, the list in `registry`."""
