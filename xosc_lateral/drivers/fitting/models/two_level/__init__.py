"""Fits the two-level model of Neis and Beyerer to the letter."""
