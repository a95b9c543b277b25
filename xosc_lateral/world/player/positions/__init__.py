"""Positions while playing: all of them in `resolve`, latitudes and longitudes by the projections of `geo`."""
