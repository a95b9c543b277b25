"""Recordings with known truth in layouts that are imported, bent: right, or refused with the option that mends it.

The option is then tried. What cannot be known from a recording (a shift below 0.6 m, which side is left where nobody
changes lanes) is not bent.
"""

from __future__ import annotations

import contextlib
import io
import random
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from laboratory.find.engine import Finding, Spec
from tests.kit import recordings as kit
from xosc_lateral.cli import main as command

Rows = pd.DataFrame
TOLERANCES = {"offset": 0.005, "lane_width": 0.02, "speed": 0.3}
"""Of rows of a table that is right; bends widen that of the offset by what they blur. [m], [m/s]"""


@dataclass(frozen=True)
class Bend:
    """One thing that a recording has otherwise."""

    change: Callable[[Rows, float], Rows]
    sizes: tuple[float, ...] = (0.0,)  # of the change, one of them drawn
    mend: str = ""  # columns of a mapping that mend it, as in "x:cm y:cm"
    blur: float = 0.0  # times the size, allowed beside the tolerance of the offset [-]


def scaled(names: str, factor: float) -> Callable[[Rows, float], Rows]:
    return lambda rows, _: rows.assign(**{name: rows[name] * factor for name in names.split()})


def exchanged(a: str, b: str) -> Callable[[Rows, float], Rows]:
    return lambda rows, _: rows.assign(**{a: rows[b], b: rows[a]})


def sideways(rows: Rows, size: float) -> Rows:
    """All are put to the left of the road's direction, as a map that is shifted has them."""
    first = rows["heading"][rows["id"] == "car"].iloc[0]
    return rows.assign(x=rows["x"] - size * np.sin(first), y=rows["y"] + size * np.cos(first))


def blurred(names: str) -> Callable[[Rows, float], Rows]:
    def noisy(rows: Rows, size: float) -> Rows:
        error = np.random.default_rng(7).normal(size=(len(rows), 2))
        return rows.assign(**{name: rows[name] + size * error[:, k] for k, name in enumerate(names.split())})

    return noisy


def gap(rows: Rows, size: float) -> Rows:
    return rows[~rows["time"].between(15.0, 15.0 + size)]


def thinned(rows: Rows, size: float) -> Rows:
    return rows[np.round((rows["time"] - rows["time"].min()) * 25.0).astype(int) % int(size) == 0]


ANY: dict[str, Bend] = {
    "as it is": Bend(lambda rows, _: rows),
    "clock in ms": Bend(scaled("time", 1e3), mend="time:ms"),
    "clock in min": Bend(scaled("time", 1 / 60), mend="time:min"),
    "clock of the epoch": Bend(lambda rows, _: rows.assign(time=rows["time"] + 1.7e9), (1e-6,), blur=1.0),
    "speed in km/h": Bend(scaled("speed", 3.6), mend="speed:km/h"),
    "speed in mph": Bend(scaled("speed", 2.2369), mend="speed:mph"),
    "gap": Bend(gap, (0.5, 3.0)),
    "every other row": Bend(thinned, (2.0, 5.0)),
    "rows in another order": Bend(lambda rows, _: rows.sample(frac=1.0, random_state=1)),
    "rows twice": Bend(lambda rows, _: pd.concat([rows, rows]).sort_values("time", kind="stable")),
    "headers in capitals": Bend(lambda rows, _: rows.rename(columns=str.upper)),
    "speed and time exchanged": Bend(exchanged("speed", "time")),
}
"""Bends of every table."""
TRACKS = ANY | {
    "heading in degrees": Bend(lambda rows, _: rows.assign(heading=np.degrees(rows["heading"])), mend="heading:deg"),
    "heading backwards": Bend(lambda rows, _: rows.assign(heading=rows["heading"] + np.pi)),
    "heading from north": Bend(lambda rows, _: rows.assign(heading=np.pi / 2 - rows["heading"])),
    "y points down": Bend(lambda rows, _: rows.assign(y=-rows["y"], heading=-rows["heading"])),
    "x and y exchanged": Bend(exchanged("x", "y")),
    "places in cm": Bend(scaled("x y", 100.0), mend="x:cm y:cm"),
    "places in ft": Bend(scaled("x y", 1 / 0.3048), mend="x:ft y:ft"),
    "lengths in cm": Bend(scaled("length", 100.0), mend="length:cm"),
    "one id for two": Bend(lambda rows, _: rows.assign(id=rows["id"].replace("beside", "car"))),
    "length and width exchanged": Bend(exchanged("length", "width")),
    "a map aside": Bend(sideways, (1.0, 1.4, -1.2)),
    "noise": Bend(blurred("x y"), (0.02, 0.05), blur=5.0),
    "much noise": Bend(blurred("x y"), (0.3, 0.5)),
    "one vehicle twice": Bend(lambda rows, _: pd.concat([rows, rows[rows["id"] == "car"].assign(id="again")])),
    "speed and heading exchanged": Bend(exchanged("speed", "heading")),
    "rounded to cm": Bend(lambda rows, _: rows.round({"x": 2, "y": 2}), (0.01,), blur=1.0),
}  # fmt: skip
TABLE = ANY | {
    "offset in cm": Bend(scaled("offset", 100.0), mend="offset:cm"),
    "offset in ft": Bend(scaled("offset", 1 / 0.3048), mend="offset:ft"),
    "offset to the right": Bend(scaled("offset", -1.0), mend="offset:-m"),
    "widths in cm": Bend(scaled("lane_width", 100.0), mend="lane_width:cm"),
    "offset and width exchanged": Bend(exchanged("offset", "lane_width")),
    "noise": Bend(blurred("offset"), (0.02, 0.05), blur=5.0),
    "two drives in turns": Bend(lambda rows, _: pd.concat(
        [rows, rows.assign(offset=-0.4, time=rows["time"] + 0.02)]).sort_values("time")),
    "from the left marking": Bend(lambda rows, _: rows.assign(offset=0.5 * rows["lane_width"] - rows["offset"])),
}  # fmt: skip
FOLLOWING = 8.0
"""Behind which others drive as those that the kit has: what a map says needs more than four vehicles. [s]"""
OTHERS = {"fcd": None, "commonroad": "commonroad", "osi": "osi_utilities"}
"""Formats whose files are written in many ways, but not bent; the package that one needs."""


def drive_table(case: kit.Case) -> Rows:
    """A drive with six changes of lane, as a camera has it."""
    time = np.arange(int(150.0 * case.rate)) / case.rate
    place = kit.sway(time) + kit.WIDTH * sum(
        (-1) ** k * 0.5 * (1.0 + np.tanh((time - 20.0 * (k + 1)) / 1.2)) for k in range(6)
    )
    index = np.round(place / kit.WIDTH).astype(int)
    return pd.DataFrame({"time": time, "offset": place - index * kit.WIDTH, "lane_width": kit.WIDTH,
                         "speed": kit.SPEED, "lane_index": index, "lane_count": 2})  # fmt: skip


class Recordings:
    """Files and what is read of them."""

    name = "recordings"

    def make(self, draw: random.Random) -> Spec:
        others = [one for one, needs in OTHERS.items() if needs is None or find_spec(needs)]
        layout = draw.choices(["tracks", "table", *others], [5, 3, *(0.7 for _ in others)])[0]
        case = {
            "hand": draw.choice(["right", "left"]), "against": draw.random() < 0.5,
            "turned": draw.choice([0.0, 2.0, -1.0]),
            "rate": draw.choice([10.0, 25.0, 50.0] if layout in ("tracks", "table") else [10.0]),
            "radius": draw.choice([None, None, 800.0]) if layout != "fcd" else None,
        }  # fmt: skip
        bends = TRACKS if layout == "tracks" else TABLE if layout == "table" else {"as it is": ANY["as it is"]}
        bend = draw.choice(sorted(bends))
        reference = draw.choice(["centre", "rear axle", "front"]) if layout == "tracks" else "centre"
        return {
            "layout": layout,
            "case": case,
            "bend": bend,
            "size": draw.choice(bends[bend].sizes),
            "reference": reference,
        }

    def look(self, spec: Spec, only: Finding | None = None) -> list[Finding]:
        bend = (TRACKS if spec["layout"] == "tracks" else TABLE)[spec["bend"]]
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            case, words = written(spec, folder)
            wrong, text = read(spec, case, words, bend, folder)
            if wrong is None and bend.mend:
                tokens = [one.partition(":") for one in bend.mend.split()]
                options = [(name, unit) for name, _, unit in tokens if f"{name}=COLUMN:{unit}" in text]
                if len(options) < len(tokens):
                    return [self._finding(spec, "refused, the option is not named", text)]
                kept = [f'{name} = "{name}:{unit}"' for name, unit in options]
                wrong, text = read(spec, case, mapped(words, spec, folder, kept), bend, folder)
                if wrong is None or wrong:
                    return [self._finding(spec, f"the option does not mend it: {wrong or 'refused'}", text)]
            if wrong is None and spec["bend"] in ("as it is", "gap", "every other row", "rows in another order",
                                                  "noise", "rounded to cm", "clock of the epoch"):  # fmt: skip
                return [self._finding(spec, "refused, and nothing is wrong", text)]
            said = bool(wrong) and any(word in text for word in ("warning:", "may be", "note: "))
            return [self._finding(spec, f"read wrongly: {wrong}", text, said=said)] if wrong else []

    def _finding(self, spec: Spec, kind: str, text: str, *, said: bool = True) -> Finding:
        where = f"{spec['layout']}, {spec['case']['hand']}"
        return {"stage": spec["bend"], "kind": kind, "context": where, "who": spec["layout"], "t": 0.0, "size": 0.0,
                "said": said, "text": text[-600:]}  # fmt: skip

    def smaller(self, spec: Spec) -> Iterator[Spec]:
        for name, plain in (("radius", None), ("turned", 0.0), ("against", False), ("hand", "right"), ("rate", 25.0)):
            if spec["case"][name] != plain and (name != "rate" or spec["layout"] in ("tracks", "table")):
                yield {**spec, "case": spec["case"] | {name: plain}}
        if spec["reference"] != "centre":
            yield {**spec, "reference": "centre"}

    def size(self, spec: Spec) -> float:
        case = spec["case"]
        return bool(case["radius"]) + bool(case["turned"]) + case["against"] + (case["hand"] == "left")

    def save(self, spec: Spec, folder: Path) -> None:
        written(spec, folder)


def mapped(words: list[str], spec: Spec, folder: Path, columns: list[str]) -> list[str]:
    """With a mapping of columns."""
    lines = [f'reference = "{spec["reference"]}"'] if spec["layout"] == "tracks" else []
    (folder / "mapping.toml").write_text("\n".join([*lines, *(["[columns]", *columns] if columns else [])]) + "\n")
    return [word for word in words if word != "--mapping" and not word.endswith(".toml")] + [
        "--mapping", str(folder / "mapping.toml")]  # fmt: skip


def written(spec: Spec, folder: Path) -> tuple[kit.Case, list[str]]:
    """The files, and the words of the command that reads them."""
    bend, layout = (TRACKS if spec["layout"] == "tracks" else TABLE)[spec["bend"]], spec["layout"]
    case = kit.Case(**{**spec["case"], "radius": spec["case"]["radius"] or np.inf})
    words = ["import", layout]
    if layout == "fcd":
        fcd, net = kit.sumo_files(case, folder)
        (folder / "types.rou.xml").write_text(kit.TYPES)
        return case, [*words, str(fcd), "--net", str(net), "--types", str(folder / "types.rou.xml")]
    if layout in ("commonroad", "osi"):
        write = kit.commonroad_file if layout == "commonroad" else kit.write_osi_trace
        return case, [*words, str(write(case, folder))]
    alone = case.tracks(spec["reference"]).assign(speed=kit.SPEED, width=2.0)
    later = alone[alone["id"] != "car"].assign(time=alone["time"] - FOLLOWING, id=alone["id"] + " 2")
    own = pd.concat([alone, later[later["time"] >= 0.0]]).sort_values("time", kind="stable", ignore_index=True)
    rows = drive_table(case) if layout == "table" else own
    bend.change(rows, spec["size"]).to_csv(folder / "bent.csv", index=False)
    words.append(str(folder / "bent.csv"))
    if layout == "table":
        return case, words
    words += ["--road", str(kit.road_file(case, folder))]
    return case, words if spec["reference"] == "centre" else mapped(words, spec, folder, [])


def read(spec: Spec, case: kit.Case, words: list[str], bend: Bend, folder: Path) -> tuple[str | None, str]:
    """What is wrong in what is read: "" nothing, None: it is refused; and what was said."""
    out = folder / "drives.parquet"
    out.unlink(missing_ok=True)
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            code: Any = command([*words, "-o", str(out), "--force"])
        except SystemExit as ended:
            code = ended.code
    text = said.getvalue()
    if code:
        return (None if "Traceback" not in text else "traceback"), text
    table = pd.read_parquet(out)
    if spec["layout"] == "table":
        return differs(table, drive_table(case), spec, bend), text
    found = {name.rpartition(":")[2]: part for name, part in table.groupby("drive")}
    car = next((found[one] for one in ("car", "1", "901") if one in found), None)
    if car is None:
        return "vehicle", text
    time = car["time"] - (1.7e9 if car["time"].min() > 1e9 else 0.0)
    truth = pd.DataFrame(
        {"time": time, "offset": kit.sway(time.to_numpy()), "lane_width": kit.WIDTH, "speed": kit.SPEED}
    )
    wrong = differs(car.assign(time=time), truth.assign(lane_index=0), spec, bend)
    ahead = kit.LEAD * (1.0 - case.centre("car") / case.radius) - 0.5 * (kit.LENGTHS["car"] + kit.LENGTHS["ahead"])
    lead = np.abs(car["lead_distance"] - ahead).max() if "lead_distance" in car else 0.0
    blur = bend.blur * spec["size"]
    return wrong or ("lead_distance" if lead > 0.2 + 2.0 * blur or np.isnan(lead) else ""), text


def differs(table: Rows, truth: Rows, spec: Spec, bend: Bend) -> str:
    """The first column that is not as it was, "" if all are; rows of both by their times."""
    if len(table) < 20:
        return "rows"
    table = table.sort_values("time", kind="stable") if spec["layout"] == "table" else table
    at = np.searchsorted(truth["time"], table["time"] - table["time"].iloc[0] + truth["time"].iloc[0] - 1e-3)
    if spec["layout"] != "table":
        at = np.arange(len(truth))
    elif np.ptp(table["time"]) > 1.05 * np.ptp(truth["time"]) or np.ptp(table["time"]) < 0.5 * np.ptp(truth["time"]):
        return "time"
    true = truth.iloc[np.clip(at, 0, len(truth) - 1)]
    blur = bend.blur * spec["size"] + (0.02 if spec["layout"] == "osi" else 0.0)
    for name, tolerance in TOLERANCES.items():
        if name in table and np.nanmax(np.abs(table[name].to_numpy() - true[name].to_numpy())) > tolerance + (
            blur if name == "offset" else 0.0
        ):
            return name
    if "lane_index" in table and (table["lane_index"].to_numpy() != true["lane_index"].to_numpy()).mean() > 0.02:
        return "lane_index"
    return ""
