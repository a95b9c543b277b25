"""A motorway of two lanes for SUMO, with cars and trucks."""

from __future__ import annotations

import subprocess
from pathlib import Path

ROUTES = """<routes>
<vType id="car" speedDev="0.1"/><vType id="truck" vClass="truck" maxSpeed="25"/><route id="r" edges="e0 e1"/>
<flow id="cars" type="car" route="r" begin="0" end="{end}" vehsPerHour="{cars}" departLane="best" departSpeed="max"/>
<flow id="trucks" type="truck" route="r" begin="0" end="{end}" vehsPerHour="{trucks}" departLane="0" departSpeed="max"/>
</routes>"""

CONFIG = """<configuration><input><net-file value="run.net.xml"/><route-files value="run.rou.xml"/></input>
<time><step-length value="0.1"/><end value="{end}"/></time>
<processing><lateral-resolution value="{sublane}"/><collision.action value="warn"/></processing></configuration>"""


def write_run(
    folder: Path,
    *,
    end: float = 40.0,
    cars: int = 1200,
    trucks: int = 240,
    sublane: float = 4.0,
    left_hand: bool = False,
) -> Path:
    """Its configuration."""
    import sumo

    places = {"a": (0, 0), "b": (3000, 0), "c": (6000, 600)}
    nodes = "".join(f'<node id="{name}" x="{x}" y="{y}"/>' for name, (x, y) in places.items())
    edges = "".join(
        f'<edge id="e{k}" from="{here}" to="{there}" numLanes="2" speed="36" width="3.75"/>'
        for k, (here, there) in enumerate(("ab", "bc"))
    )
    (folder / "run.nod.xml").write_text(f"<nodes>{nodes}</nodes>")
    (folder / "run.edg.xml").write_text(f"<edges>{edges}</edges>")
    (folder / "run.rou.xml").write_text(ROUTES.format(end=end, cars=cars, trucks=trucks))
    (folder / "run.sumocfg").write_text(CONFIG.format(end=end, sublane=sublane))
    program = Path(sumo.SUMO_HOME) / "bin" / "netconvert"
    words = [str(program), "-n", "run.nod.xml", "-e", "run.edg.xml", "-o", "run.net.xml"]
    words += ["--lefthand"] if left_hand else []
    subprocess.run(words, cwd=folder, check=True, capture_output=True)
    return folder / "run.sumocfg"
