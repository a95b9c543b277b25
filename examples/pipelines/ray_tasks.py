"""Ray: a task for each scenario; needs ray, and this package on its workers.

python examples/pipelines/ray_tasks.py FOLDER
"""

from __future__ import annotations

import sys
from pathlib import Path

import ray

import xosc_lateral as xl


@ray.remote
def lifelike(scenario: bytes, files: dict[str, bytes], seed: int) -> bytes:
    """One variant; `files`: roads and catalogs by name."""
    return xl.convert(scenario, road=files, seed=seed).data


def convert_folder(folder: Path) -> list[bytes]:
    """Every scenario of a folder, sorted by name."""
    roads = ray.put({path.name: path.read_bytes() for path in folder.glob("*.xodr")})  # sent once
    scenarios = [path.read_bytes() for path in sorted(folder.glob("*.xosc"))]
    return ray.get([lifelike.remote(scenario, roads, 1) for scenario in scenarios])


if __name__ == "__main__":
    print(f"{sum(map(len, convert_folder(Path(sys.argv[1]))))} bytes")
