"""A driver over a pipe, as a bench in any language would use it: one line of JSON in, one out.

python examples/live_stdio.py [OUT]
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path


def main(folder: Path) -> None:
    words = [sys.executable, "-m", "xosc_lateral", "live", "stdio", "--profile", "motorway", "--seed", "1"]
    answers = []
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as pipe:
        assert pipe.stdin is not None and pipe.stdout is not None
        for k in range(6):
            vehicles = {"a": {"speed": 30.0, "lane_width": 3.5, "left_distance": None}}
            print(json.dumps({"time": 0.2 * k, "vehicles": vehicles}), file=pipe.stdin, flush=True)
            answers.append(pipe.stdout.readline())
    (folder / "answers.jsonl").write_text("".join(answers), encoding="utf-8")
    print("".join(answers[:2]), end="")


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/live")
    out.mkdir(parents=True, exist_ok=True)
    main(out)
