"""``python -m xosc_lateral``."""

from xosc_lateral.cli import main

main()
