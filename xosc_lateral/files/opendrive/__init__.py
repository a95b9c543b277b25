"""Read OpenDRIVE 1.1-1.8, leniently: what is odd but clear is repaired and noted, what is unclear is refused."""
