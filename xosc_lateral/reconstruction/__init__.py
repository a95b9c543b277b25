"""A recording's vehicles as maneuvers: speeds, lane changes, encounters, drivers. Numbers only, no files."""
