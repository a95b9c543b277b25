"""Lateral models of the field, one small class per file, all with one protocol: `fit` and `sample`."""
