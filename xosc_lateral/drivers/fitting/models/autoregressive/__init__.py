"""Fits the autoregressive core model: coarse part, match of spectra, settings."""
