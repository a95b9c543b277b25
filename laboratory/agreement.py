"""Agreement with the reference player: every scenario of a folder is played here and there, and all rows compared.

    python -m laboratory.agreement FOLDER... --esmini PATH [--half 1 --without FOLDER] [--limit N] [--step 0.02]

PATH is esmini's executable; a headless build is enough (docs/playing.md says which version was used). Several
folders or scenarios may be given; `--limit N` takes N, evenly spread. A scenario agrees when no row is more than 0.10 m
or 0.05 m/s away, and the ends are no more than 0.1 s apart. What esmini can't play is counted apart, and so is what
differs where esmini itself comes to another end with another seed (it draws a way at junctions).
"""

from __future__ import annotations

import argparse
import hashlib
import itertools
import re
import signal
import subprocess
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from xosc_lateral.base.errors import XoscLateralError
from xosc_lateral.workflows.conversion.load import Played, play_scenario
from xosc_lateral.world.motion.nominal import Activity

FARTHEST = 0.10
"""[m]"""
FASTEST = 0.05
"""[m/s]"""
ENDS_APART = 0.1
"""[s]"""
_FOR_CARLA = re.compile(rb"description\s*=\s*[\"']CARLA")
OTHER_SEEDS = (2, 3, 4)
"""Of the reference player's chance: what comes out otherwise with one of them is nothing to agree with."""
_NUMBER = re.compile(r"\d+$")
PATIENCE = 120.0
"""For one scenario in the other player. [s]"""


def reference_rows(
    esmini: Path,
    scenario: Path,
    step: float,
    limit: float,
    switches: Sequence[str] = (),
    seed: int = 1,
    messages: Path | None = None,
) -> pd.DataFrame:
    """`time,name,x,y,h,speed` as esmini logs them; empty if it can't play the scenario. What it says: in `messages`."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.csv"
        command = [str(esmini), "--osc", str(scenario.resolve()), "--headless", "--fixed_timestep", str(step)]
        command += ["--disable_controllers", "--disable_stdout", "--seed", str(seed), "--csv_logger", str(log)]
        command += ["--logfile_path", str(messages or Path(folder) / "log.txt"), *_options(switches)]
        player = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        _wait(player, log, limit)
        rows = _logged(_written(log), limit)
    return pd.DataFrame(rows, columns=["time", "name", "x", "y", "h", "speed"])


def _wait(player: subprocess.Popen[bytes], log: Path, limit: float) -> None:
    """Until it ends; a scenario without an end is stopped after the limit."""
    for _ in range(int(PATIENCE / 0.2)):
        try:
            player.wait(0.2)
            return
        except subprocess.TimeoutExpired:
            if _last_time(_written(log)) > limit:
                break
    player.send_signal(signal.SIGINT)  # it then quits by itself, and has said all it had to
    try:
        player.wait(5.0)
    except subprocess.TimeoutExpired:
        player.kill()
        player.wait()


def _options(words: Sequence[str]) -> list[str]:
    """Names of switches, as words of the command line; other words are values."""
    return [word if word.startswith("--") or word.isdecimal() else f"--{word}" for word in words]


def _written(log: Path) -> Path:
    """The log: one that is drawn from a distribution has its number in its name."""
    return next(log.parent.glob(f"{log.stem}_*_of_*{log.suffix}"), log)


def _last_time(log: Path) -> float:
    if not log.is_file():
        return 0.0
    with log.open("rb") as file:
        file.seek(max(log.stat().st_size - (1 << 16), 0))
        tail = file.read()
    lines = tail.split(b"\n")[1:-1]  # the first and the last one may be cut
    fields = lines[-1].split(b",") if lines else tail.split(b",")[-3:]
    return float(fields[1]) if len(fields) > 2 and fields[0].strip().isdigit() else 0.0


def _logged(log: Path, limit: float) -> list[tuple[float, str, float, float, float, float]]:
    """Rows up to the limit: a scenario without an end may have been logged far beyond."""
    if not log.is_file():
        return []
    with log.open(errors="replace") as lines:
        return list(itertools.takewhile(lambda row: row[0] < limit + 1e-6, _rows(lines)))


def _rows(lines: Iterable[str]) -> Iterator[tuple[float, str, float, float, float, float]]:
    columns: list[str] = []
    wanted = ("World_Position_X", "World_Position_Y", "World_Heading_Angle", "Current_Speed")
    for line in lines:
        fields = [field.strip() for field in line.split(",")]
        if fields[0].startswith("Index"):
            columns = [name.removeprefix("#1 ").split(" [")[0] for name in fields if name.startswith("#1 ")]
        elif columns and fields[0].isdigit():
            # frames without entities have no line end of their own: only the last of a line has names
            own = next((k for k in range(0, len(fields) - 2, 2) if not _NUMBER.match(fields[k + 2])), len(fields))
            fields = fields[own:]
            for first in range(2, len(fields) - len(columns) + 1, len(columns)):
                one = dict(zip(columns, fields[first : first + len(columns)], strict=True))
                x, y, heading, speed = (float(one[name]) for name in wanted)
                yield float(fields[1]), one["Entity_Name"], x, y, heading, speed


def own_rows(played: Played) -> pd.DataFrame:
    """The same columns."""
    frames = []
    for entity in played.motion.entities:
        rows = (entity.activity & Activity.ACTIVE) != 0
        x, y, *_ = played.network.header_offset.apply(entity.x, entity.y, entity.z, entity.heading)
        values = {"time": entity.time, "x": x, "y": y, "speed": entity.speed}
        frames.append(pd.DataFrame({name: column[rows] for name, column in values.items()}).assign(name=entity.name))
    return pd.concat(frames)


def difference(theirs: pd.DataFrame, ours: pd.DataFrame, step: float, limit: float) -> str:
    """What is different; empty if they agree."""
    if set(theirs["name"]) != set(ours["name"]):
        return f"other entities: {', '.join(sorted(set(theirs['name']) ^ set(ours['name'])))[:80]}"
    frames = [
        frame.assign(row=np.rint(frame["time"] / step).astype(int)).drop_duplicates(["name", "row"], keep="last")
        for frame in (theirs, ours)
    ]
    both = frames[0].merge(frames[1], on=["name", "row"], suffixes=("", "_ours"))
    away = np.hypot(both["x"] - both["x_ours"], both["y"] - both["y_ours"])
    faster = (both["speed"] - both["speed_ours"]).abs()
    end, own_end = theirs["time"].max(), ours["time"].max()
    found = []
    if min(end, own_end) < limit - 0.1 and abs(end - own_end) > ENDS_APART:
        found.append(f"ends at {own_end:.2f} instead of {end:.2f} s")
    if away.max() > FARTHEST or faster.max() > FASTEST:
        first = both[(away > FARTHEST) | (faster > FASTEST)].iloc[0]
        found.append(f"{away.max():.2f} m, {faster.max():.2f} m/s, first {first['name']} at {first['time']:.2f} s")
    if len(both) < 0.98 * len(frames[0]):
        found.append(f"{len(both)} of {len(frames[0])} rows")
    return "; ".join(found)


def scenarios(
    places: Sequence[Path], limit: int | None, half: int | None = None, without: Sequence[Path] = ()
) -> list[Path]:
    """Scenarios in the folders: no catalogs, none twice, none for CARLA; `limit` of them, evenly spread.

    `half` takes those whose name hashes to it (0 is looked at when something is mended, 1 is not), so that all versions
    of a scenario stay together; names that occur in one of the folders `without` are left out.
    """
    known = {path.stem.lower() for folder in without for path in folder.rglob("*.xosc")}
    kept: dict[bytes, Path] = {}
    for path in (path for place in places for path in ([place] if place.is_file() else sorted(place.rglob("*.xosc")))):
        name, data = path.stem.lower(), path.read_bytes()
        is_played = b"<Storyboard" in data and not _FOR_CARLA.search(data)
        if is_played and name not in known and half in (None, half_of(path)):
            kept.setdefault(b" ".join(data.split()), path)
    found = list(kept.values())
    if limit is None or limit >= len(found):
        return found
    return [found[k] for k in np.linspace(0, len(found) - 1, limit).astype(int)]


def half_of(path: Path) -> int:
    """0 or 1: by its name, so that all versions of a scenario are in the same half."""
    return int(hashlib.sha256(path.stem.lower().encode()).hexdigest()[0] >= "8")


@dataclass
class Tally:
    """Of one half."""

    agreeing: int = 0
    differing: int = 0
    not_played_there: int = 0
    left_to_chance: int = 0

    def __str__(self) -> str:
        return (
            f"{self.agreeing} of {self.agreeing + self.differing} agree; {self.not_played_there} can't be played "
            f"by the reference player, {self.left_to_chance} differ and come out there otherwise with another seed"
        )


def compared(
    path: Path,
    esmini: Path,
    step: float,
    limit: float,
    tally: Tally,
    *,
    allowed: Iterable[Path | str] = (),
    switches: Sequence[str] = (),
) -> None:
    """Count one scenario, and print what differs; `allowed`: where its road may lie."""
    theirs = reference_rows(esmini, path, step, limit, switches)
    if theirs["time"].nunique() < 3:
        tally.not_played_there += 1
        return
    try:
        played = play_scenario(path, step=step, time_limit=limit, allowed=[Path(one) for one in allowed])
        found = difference(theirs, own_rows(played), step, limit)
    except XoscLateralError as error:
        found = " ".join(str(error).split())
    others = (reference_rows(esmini, path, step, limit, switches, seed) for seed in OTHER_SEEDS)
    if found and any(difference(theirs, other, step, limit) for other in others):
        tally.left_to_chance += 1
        return
    tally.agreeing += not found
    tally.differing += bool(found)
    if found:
        print(f"{path.parent.name}/{path.name}: {found}", flush=True)


def main() -> None:
    """Compare, print what differs and how many agree."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="+")
    parser.add_argument("--esmini", type=Path, required=True)
    parser.add_argument(
        "--esmini-option", action="append", default=[], metavar="NAME", help="such as align_routepositions"
    )
    parser.add_argument("--limit", type=int, help="this many scenarios, evenly spread")
    parser.add_argument("--step", type=float, default=0.02)
    parser.add_argument("--time-limit", type=float, default=60.0)
    parser.add_argument("--half", type=int, choices=(0, 1), help="only names that hash to this half")
    parser.add_argument("--without", type=Path, action="append", default=[], help="leave out names that occur there")
    options = parser.parse_args()
    folders = [place for place in options.folder if place.is_dir()]
    tallies = {0: Tally(), 1: Tally()}
    for path in scenarios(options.folder, options.limit, options.half, options.without):
        run = (options.esmini.resolve(), options.step, options.time_limit)
        compared(path, *run, tallies[half_of(path)], allowed=folders, switches=options.esmini_option)
    whole = Tally(*(sum(amounts) for amounts in zip(*(astuple(tally) for tally in tallies.values()), strict=True)))
    if options.half is None:
        for half, tally in tallies.items():
            print(f"half {half}: {tally}")
    print(whole)


if __name__ == "__main__":
    main()
