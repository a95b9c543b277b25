"""What proves the claims of the documentation."""
