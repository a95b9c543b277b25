"""Numbers of the normal distribution."""

NORMAL_95 = 1.96
"""Standard errors to either side that a 95 % interval has. [-]"""

MAD_TO_SD = 1.4826
"""Standard deviation over median absolute deviation: one over the 75 % quantile. [-]"""
