"""Actions as files have them, one family per file; an action is any struct with a `place` (`place.Content`)."""
