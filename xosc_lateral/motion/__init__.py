"""Playback of a storyboard on a road network, and what follows from it: segments, trajectories."""
