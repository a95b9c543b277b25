"""`convert`: load, play, decide, sample, write, check; its call, its settings, its page."""
