"""The lateral model: chains, noise, effects, profiles, sampling, fitting. Numbers only, no XML, roads or files."""
