"""Where motion and driver meet: offsets sampled for every road-following segment of a played scenario."""
