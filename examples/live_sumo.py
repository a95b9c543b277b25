"""Drivers in SUMO with the sublane model, inside your own loop: the extra `sumo`.

python examples/live_sumo.py [OUT]
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import xosc_lateral as xl

NODES = '<nodes><node id="a" x="0" y="0"/><node id="b" x="2000" y="0"/></nodes>'
EDGES = '<edges><edge id="e" from="a" to="b" numLanes="2" speed="36" width="3.75"/></edges>'
ROUTES = """<routes><vType id="car"/><route id="r" edges="e"/>
<flow id="cars" type="car" route="r" begin="0" end="30" vehsPerHour="1800" departLane="best" departSpeed="max"/>
</routes>"""


def main(folder: Path) -> None:
    for name, text in (("nod", NODES), ("edg", EDGES), ("rou", ROUTES)):
        (folder / f"road.{name}.xml").write_text(text, encoding="utf-8")
    try:
        import libsumo
        import sumo
    except ImportError as error:
        print(f"nothing is run:\n{error}")
        return
    program = Path(sumo.SUMO_HOME) / "bin" / "netconvert"
    subprocess.run([program, "-n", "road.nod.xml", "-e", "road.edg.xml", "-o", "road.net.xml"], cwd=folder, check=True)
    words = ["-n", str(folder / "road.net.xml"), "-r", str(folder / "road.rou.xml"), "--step-length", "0.1"]
    libsumo.start(["sumo", *words, "--lateral-resolution", "4", "--no-step-log"])
    traffic = xl.SumoTraffic(libsumo, xl.read_profile("motorway"), seed=1)
    for _ in range(200):
        traffic.steer()
        libsumo.simulationStep()
    for name in libsumo.vehicle.getIDList()[:4]:
        print(f"{name}: {libsumo.vehicle.getLateralLanePosition(name):+.3f} m from the lane's centre")
    libsumo.close()


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/live")
    out.mkdir(parents=True, exist_ok=True)
    main(out)
