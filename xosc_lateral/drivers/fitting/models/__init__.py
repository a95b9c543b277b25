"""Fits the core models: a package each."""
