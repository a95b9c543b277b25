"""What the driver does and what the sensor adds: separated in measured offsets, kept apart in a profile."""
