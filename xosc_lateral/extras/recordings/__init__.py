"""`import` and `reconstruct`: other people's recordings into drives, and into scenarios."""

VERBS = {
    "import": (
        "xosc_lateral.extras.recordings.import_verb",
        "Convert recordings into drive tables.",
        "profiles",
        "docs/real_data.md, docs/formats.md",
    ),
    "reconstruct": (
        "xosc_lateral.extras.recordings.reconstruct_verb",
        "Turn a recording into a maneuver-based scenario.",
        "verify",
        "docs/how_to/from_a_recording.md",
    ),
}
CALLS = {
    "read_maneuvers": "xosc_lateral.extras.recordings.reconstruct",
    "reconstruct": "xosc_lateral.extras.recordings.reconstruct",
    "import_drives": "xosc_lateral.extras.recordings.importers",
    "Reconstruction": "xosc_lateral.extras.recordings.reconstruction",
    "ImportedDrives": "xosc_lateral.extras.recordings.importers",
}
SERVICES = {
    "drives_of": "xosc_lateral.extras.recordings.recordings",
    "is_left_handed": "xosc_lateral.extras.recordings.importers.fcd",
    "write_osi": "xosc_lateral.extras.recordings.osi_write",
}
