"""``python -m xosc_lateral``."""

import sys
from os import sep

if __name__ == "__main__":
    if not sys.flags.safe_path and not __file__.startswith(f"{sys.path[0]}{sep}xosc_lateral{sep}"):
        del sys.path[0]  # the working folder, which may be anybody's

    from xosc_lateral.cli import main

    main()
