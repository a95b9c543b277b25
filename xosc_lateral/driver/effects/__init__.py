"""Effects that a profile can hold, one per file."""
