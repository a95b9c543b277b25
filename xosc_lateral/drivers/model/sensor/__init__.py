"""What a sensor adds to a drive: the noise and rounding of a profile's data."""
