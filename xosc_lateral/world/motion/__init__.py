"""Nominal motion, and what follows from it: segments, context, deviations, trajectories, gaps."""
