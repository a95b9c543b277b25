"""The lateral model: chains, noise, effects, profiles, sampling. Numbers only, no XML, roads or files."""
