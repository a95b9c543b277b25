"""Terms of the model, one file each: columns, test, estimate, remove, describe.

A new one is a class here and its effect under `driver/effects`, and a line in `identification/stages.py`. Nothing is
imported here: the search needs `base`, and the terms need the search.
"""
