"""`detect`: what a cut-in detector does on scenarios and on measured traffic."""

VERBS = {
    "detect": (
        "xosc_lateral.extras.detect.verb",
        "Cut-in detectors on scenarios and real traffic.",
        "profiles",
        "docs/how_to/detect.md",
    ),
}
CALLS = {
    "detect": "xosc_lateral.extras.detect.call",
    "Detection": "xosc_lateral.extras.detect.detection",
    "Sight": "xosc_lateral.extras.detect.sight",
}
