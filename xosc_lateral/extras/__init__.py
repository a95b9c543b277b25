"""The registry of extras: what the core finds by name, and never imports."""

VERBS = {
    "reconstruct": ("extras.recordings.reconstruct_verb", "Turn a recording into a maneuver-based scenario."),
    "detect": ("extras.detect.verb", "Cut-in detectors on scenarios and real traffic."),
    "close-loop": ("extras.loop.verb", "Find and add what a profile lacks."),
    "import": ("extras.recordings.import_verb", "Convert recordings into drive tables."),
    "dossier": ("extras.dossier.verb", "Evidence for an assessor."),
    "live": ("extras.live.verbs", "Drivers in a simulation that runs."),
    "export": ("extras.live.verbs", "Drivers as parts for other tools."),
}
"""Verb -> its module, what it does."""

PAGES = {
    "extras.recordings.import_verb": "docs/real_data.md, docs/formats.md",
    "extras.recordings.reconstruct_verb": "docs/how_to/from_a_recording.md",
    "extras.loop.verb": "docs/closing_the_loop.md",
    "extras.live.verbs": "docs/live.md",
    "extras.detect.verb": "docs/how_to/detect.md",
    "extras.dossier.verb": "docs/how_to/in_your_pipeline.md",
}
"""Module of verbs -> pages that say more."""

CALLS = {
    "reconstruct": "extras.recordings.reconstruct",
    "close_loop": "extras.loop.call",
    "plan_loop": "extras.loop.call",
    "detect": "extras.detect.call",
    "dossier": "extras.dossier.call",
    "import_drives": "extras.recordings.importers",
    "read_maneuvers": "extras.recordings.maneuvers",
    "live_esmini": "extras.live.call",
    "live_sumo": "extras.live.call",
    "Traffic": "extras.live.traffic",
    "Moment": "extras.live.traffic",
    "EsminiTraffic": "extras.live.esmini",
    "SumoTraffic": "extras.live.sumo",
    "export_c": "extras.live.c_driver",
    "export_fmu": "extras.live.fmu",
    "LiveRun": "extras.live.call",
    "Reconstruction": "extras.recordings.reconstruction",
    "ClosedLoop": "extras.loop.call",
    "LoopPlan": "extras.loop.call",
    "Detection": "extras.detect.detection",
    "Sight": "extras.detect.sight",
    "Dossier": "extras.dossier.call",
    "ImportedDrives": "extras.recordings.importers",
}
"""Public name -> module that has it."""

SERVICES = {
    "recognised": "extras.recordings.importers.foreign_table",
    "mapping_text": "extras.recordings.importers.foreign_table",
}
"""What verbs of the core ask for -> module that has it."""
