"""Many conversions, unattended: jobs, workers, journal, manifest, verification."""
