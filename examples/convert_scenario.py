"""A maneuver-based scenario in, a lifelike one out: the result as data, and as a page.

python examples/convert_scenario.py [OUTPUT FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

from xosc_lateral.formats.atomic import write_atomically
from xosc_lateral.pipeline.convert import convert_scenario
from xosc_lateral.pipeline.settings import ConvertSettings
from xosc_lateral.report.scenario import conversion_page
from xosc_lateral.templates import find_template


def main(out: Path) -> None:
    """Write a template, convert it, say what changed."""
    out.mkdir(parents=True, exist_ok=True)
    for name, text in find_template("overtake-truck").files({"ego_speed": "35"}).items():
        write_atomically(out / name, text)

    conversion = convert_scenario(
        out / "overtake-truck.xosc", out / "overtake-truck_lifelike.xosc", ConvertSettings(seed=7)
    )

    for entity in conversion.enriched.entities:
        profile = "no profile" if entity.profile is None else entity.profile.name
        print(f"{entity.name:9} {entity.segment_seconds:5.1f} s, offsets +-{entity.offset_spread:.2f} m ({profile})")
    for before, after in zip(conversion.enriched.gaps_before, conversion.enriched.gaps_after, strict=False):
        print(f"smallest gap of {' and '.join(after.names)}: {before.distance:.2f} m -> {after.distance:.2f} m")
    page = write_atomically(out / "overtake-truck_report.html", conversion_page(conversion))
    print(f"written: {conversion.output} and {page}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out/examples"))
