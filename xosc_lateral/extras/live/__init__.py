"""`live` and `export`: the driver as a part of somebody else's running simulation."""

VERBS = {
    "live": (
        "xosc_lateral.extras.live.verbs",
        "Drivers in a simulation that runs.",
        "",
        "docs/live.md",
    ),
    "export": (
        "xosc_lateral.extras.live.verbs",
        "Drivers as parts for other tools.",
        "",
        "docs/live.md",
    ),
}
CALLS = {
    "live_esmini": "xosc_lateral.extras.live.call",
    "live_sumo": "xosc_lateral.extras.live.call",
    "Traffic": "xosc_lateral.extras.live.traffic",
    "Moment": "xosc_lateral.extras.live.traffic",
    "EsminiTraffic": "xosc_lateral.extras.live.esmini",
    "SumoTraffic": "xosc_lateral.extras.live.sumo",
    "export_c": "xosc_lateral.extras.live.export",
    "export_fmu": "xosc_lateral.extras.live.export",
    "LiveRun": "xosc_lateral.extras.live.call",
}
SERVICES = {"told_by_player": "xosc_lateral.extras.live.user_player"}
"""What `convert --player LIBRARY` has this extra do."""
