"""How true sampled movement is to measured movement: metrics, distances, spectra, classifier test, comparison."""
