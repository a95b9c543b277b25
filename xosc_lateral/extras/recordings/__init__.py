"""`import` and `reconstruct`: other people's recordings into drives, and into scenarios."""
