"""Writing scenarios: trajectories in place of maneuvers, or lane offsets on top of them."""
