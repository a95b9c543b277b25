"""Machines that make inputs from seeds, judge what the product makes of them, and shrink what is wrong."""
