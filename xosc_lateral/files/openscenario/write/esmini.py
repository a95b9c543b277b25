"""What esmini (3.6.0) wants of a scenario; the one place of its quirks.

All outputs are written such that it plays them to the millimetre, since other players mind none of that:

- vertices at least 0.1 m apart, which it would merge (`path_pieces`), and paths cut where a car stands;
- lane offset actions as half cosines whose duration follows from the lateral acceleration (`offset_chain`);
- triggers without an edge, which it would miss in its first frame.

What is left are elements at which it stops instead of going on without them: taken out and named here. It reads every
version, and passes over the `Motion` of vertices, which 1.4 has, since their times say the same.
"""

from __future__ import annotations

from xosc_lateral.files.openscenario.element import local_name
from xosc_lateral.files.openscenario.write.losses import Losses

_STOPS_AT = {
    ("Polyline", "Interpolation"),
    ("RoutingAction", "PreferredLaneLayerAction"),
    ("RoutingAction", "RandomRouteAction"),
    ("EntityCondition", "RelativeAngleCondition"),
    ("ScenarioObject", "ExternalObjectReference"),
    ("Position", "GeoPosition"),
}
"""(tag above, tag): it ends with an error where it reads one."""


def fit_esmini(losses: Losses) -> None:
    """Take out what stops esmini.

    Raises
    ------
    FormatError
        In a condition, an entity, or a maneuver of a scenario that stays reactive.
    """
    for item in list(losses.root.iter("{*}*")):
        parent = item.getparent()
        if parent is None or (local_name(parent), local_name(item)) not in _STOPS_AT:
            continue
        if local_name(item) == "ExternalObjectReference":
            losses.refuse(item, local_name(item), hint="")
        losses.element(item, "esmini would stop there")
