"""Which effects a driver profile lacks: residual, selection, estimates, and the error before and after."""

VERBS = {
    "close-loop": (
        "xosc_lateral.extras.loop.verb",
        "Find and add what a profile lacks.",
        "profiles",
        "docs/closing_the_loop.md",
    ),
}
CALLS = {
    "close_loop": "xosc_lateral.extras.loop.call",
    "plan_loop": "xosc_lateral.extras.loop.call",
    "ClosedLoop": "xosc_lateral.extras.loop.call",
    "LoopPlan": "xosc_lateral.extras.loop.call",
}
