"""Conditions as files have them: on an entity's state (`entity`), on values (`value`)."""
