"""Road geometry: (road, lane, s, offset) <-> (x, y, z, heading). Numbers only, no files."""
