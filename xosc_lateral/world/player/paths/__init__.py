"""Trajectories as curves to be followed, one shape per file; `registry` knows them all."""
