"""ASAM OSI traces [1]_, out and in, through asam-osi-utilities and osi-python (extra `osi`).

References
----------
.. [1] ASAM OSI (Open Simulation Interface) 3.8, with its trace file formats.
"""
