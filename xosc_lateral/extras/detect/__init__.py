"""`detect` and `vary`: what a cut-in detector does on scenarios, on families of them, and on measured traffic."""

VERBS = {
    "detect": (
        "xosc_lateral.extras.detect.verb",
        "Cut-in detectors on scenarios and real traffic.",
        "profiles",
        "docs/how_to/detect.md",
    ),
    "vary": (
        "xosc_lateral.extras.detect.verb",
        "A scenario's lane changes as long as real ones.",
        "",
        "docs/how_to/from_a_recording.md",
    ),
}
CALLS = {
    "detect": "xosc_lateral.extras.detect.call",
    "Detection": "xosc_lateral.extras.detect.detection",
    "vary": "xosc_lateral.extras.detect.vary",
    "Variations": "xosc_lateral.extras.detect.vary",
    "Sight": "xosc_lateral.extras.detect.sight",
}
