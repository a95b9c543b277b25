"""From files to files: one scenario, or a whole database of them."""
