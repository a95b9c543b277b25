"""What a conversion costs by the number of entities, and by its duration.

    python -m benchmarks.scale [--entities 64 128 256 500] [--seconds 60] [--driver NAME] [--profile]
    python -m benchmarks.scale --entities 1 --speeds 11.5 --seconds 86400

Cars 35 m apart, a lane for each speed; every tenth changes lanes. CPU seconds, each size in a process of its own for
its memory; the exponent is that from one size to the next. (A day is driven at 41 km/h: roads end at 1000 km.)
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import resource
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from xosc_lateral.pipeline.convert import convert_scenario
from xosc_lateral.pipeline.settings import ConvertSettings
from xosc_lateral.templates.motorway import Bend, Motorway, Straight
from xosc_lateral.templates.settings import Settings
from xosc_lateral.templates.storyboard import Actor, PlannedEvent, Plot, Vehicle, at_time, lane_change
from xosc_lateral.templates.template import Template

GAP = 35.0
"""[m]"""


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--entities", type=int, nargs="+", default=[64, 128, 256, 500])
    arguments.add_argument(
        "--speeds", type=float, nargs="+", default=[24.0, 29.0, 34.0], help="by lane, slow first [m/s]"
    )
    arguments.add_argument("--seconds", type=float, default=60.0)
    arguments.add_argument("--driver", default="motorway-refined", help="profile; this one reacts to neighbours")
    arguments.add_argument("--profile", action="store_true", help="print where the time goes")
    options = arguments.parse_args()
    before: tuple[int, float] | None = None
    for number in options.entities:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            cpu, memory = pool.apply(
                measure, (number, options.seconds, options.speeds, options.driver, options.profile)
            )
        steep = f", exponent {math.log(cpu / before[1]) / math.log(number / before[0]):.2f}" if before else ""
        print(f"{number} entities: {cpu:.1f} s of CPU, {memory:.0f} MB{steep}", flush=True)
        before = number, cpu


def measure(
    number: int, seconds: float, speeds: Sequence[float], driver: str, profile: bool = False
) -> tuple[float, float]:
    """CPU seconds and peak memory [MB] of one conversion; imports come before."""
    settings = ConvertSettings(profile=driver, time_limit=seconds)
    made = {"small": (2, 2.0), "large": (number, seconds)}
    with tempfile.TemporaryDirectory() as folder:
        small, large = (write(Path(folder) / name, *size, speeds) for name, size in made.items())
        convert_scenario(small, small.with_name("out.xosc"), settings)
        begin = time.process_time()
        if profile:
            import cProfile

            cProfile.runctx(
                "convert_scenario(large, large.with_name('out.xosc'), settings)", globals(), locals(), sort=1
            )
        else:
            convert_scenario(large, large.with_name("out.xosc"), settings)
        return time.process_time() - begin, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def write(folder: Path, number: int, seconds: float, speeds: Sequence[float]) -> Path:
    """The scenario beside its road."""

    def plot(settings: Settings) -> Plot:
        length = 500.0 + GAP * number / len(speeds) + max(speeds) * seconds
        parts = (Straight(300.0), Bend(-1800.0, 350.0, 150.0), Bend(1800.0, 350.0, 150.0))
        rest = Straight(length - sum(part.length for part in parts))
        motorway = Motorway(alignment=(*parts, rest), lanes=len(speeds), lane_width=3.5, left_hand=False)
        lanes = [k % len(speeds) for k in range(number)]
        actors = tuple(
            Actor(f"Car{k}", Vehicle.CAR, lane, 50.0 + GAP * (k // len(speeds)), speeds[lane])
            for k, lane in enumerate(lanes)
        )
        steps = tuple(
            PlannedEvent(f"Car{k}", f"Change{k}", lane_change(motorway.lane(1), 5), at_time(round(5.0 + 0.05 * k, 2)))
            for k in range(0, number, 10)
            if len(speeds) > 1 and lanes[k] != 1
        )
        return Plot("Many cars", motorway, actors, steps, duration=seconds)

    folder.mkdir()
    for name, text in Template("many", "Many cars", (), plot).files().items():
        (folder / name).write_text(text)
    return folder / "many.xosc"


if __name__ == "__main__":
    main()
