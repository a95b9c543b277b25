"""`detect`: what a cut-in detector does on scenarios and on measured traffic."""
