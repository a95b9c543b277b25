"""What `import xosc_lateral` offers, one file per verb: paths and plain values in, results that explain themselves out.

The command line is a thin layer over these calls; `docs/api.md` lists what is promised.
"""
