"""Evidence for an assessor: claims, what tests them, and what they are tested to be here."""

VERBS = {
    "dossier": (
        "xosc_lateral.extras.dossier.verb",
        "Evidence for an assessor.",
        "template",
        "docs/how_to/dossier.md",
    ),
}
CALLS = {
    "dossier": "xosc_lateral.extras.dossier.call",
    "Dossier": "xosc_lateral.extras.dossier.call",
}
SERVICES = {
    "openlabel": "xosc_lateral.extras.dossier.labels",
    "quality_result": "xosc_lateral.extras.dossier.labels",
}
"""What `convert --labels` has this extra do."""
