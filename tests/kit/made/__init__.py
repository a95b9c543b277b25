"""Scenarios written for the purpose: every action and condition, on roads of every shape, as chance combines them."""
