"""Evidence for an assessor: claims, what tests them, and what they are tested to be here."""
