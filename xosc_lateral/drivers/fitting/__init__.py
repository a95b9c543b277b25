"""Driver profiles from measured drives, and from stated figures."""
