"""The player: a storyboard on a road network, frame by frame, into nominal motion."""
