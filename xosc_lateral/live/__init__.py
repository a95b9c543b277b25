"""The driver as a part of somebody else's running simulation."""
