"""`live` and `export`: the driver as a part of somebody else's running simulation."""
