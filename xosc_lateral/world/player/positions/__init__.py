"""Positions while playing: all of them in `resolve`, from road coordinates in `on_road`, from latitudes in `geo`."""
