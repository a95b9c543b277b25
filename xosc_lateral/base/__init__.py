"""What everything stands on: errors, limits, arrays, rows. Imports nothing."""
