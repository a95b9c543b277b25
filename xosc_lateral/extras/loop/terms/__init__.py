"""Terms of the model, one file each: columns, test, estimate, remove, describe.

A new one is a class in a file here, which says at which stages it is tested (`selection` finds it),
and its effect under `drivers/model/effects`. Nothing is imported here: the search needs `base`, and the terms need
the search.
"""
