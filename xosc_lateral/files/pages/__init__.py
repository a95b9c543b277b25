"""Results into text, JSON, HTML."""
