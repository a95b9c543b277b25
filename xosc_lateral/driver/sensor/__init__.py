"""What the driver does and what the sensor adds: told apart in measured offsets, kept apart in a profile."""
