"""Every model of the field fitted and scored on the same measured runs, with fair floors and intervals."""
