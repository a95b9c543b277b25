"""Nominal motion, and what follows from it: segments, deviations, trajectories, gaps."""
