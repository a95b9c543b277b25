"""Which effects a driver profile lacks: residual, selection, estimates, and the error before and after."""
