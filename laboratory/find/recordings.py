"""Recordings with known truth in layouts that are imported, bent: right, or refused with the option that mends it.

The option is then tried. What cannot be known from a recording (a shift below 0.6 m, which side is left where nobody
changes lanes) is not bent.
"""

from __future__ import annotations

import contextlib
import io
import random
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from laboratory.find.engine import Finding, Spec
from tests.kit import recordings as kit
from tests.kit.generated import layouts
from tests.kit.generated.layouts import LAYOUTS
from xosc_lateral import Drive, read_drives
from xosc_lateral.cli import main as command

Rows = pd.DataFrame
TOLERANCES = {"offset": 0.005, "lane_width": 0.02, "speed": 0.3}
"""Of rows of a table that is right; bends widen that of the offset by what they blur. [m], [m/s]"""


@dataclass(frozen=True)
class Bend:
    """One thing that a recording has otherwise."""

    change: Callable[[Rows, float], Rows]
    sizes: tuple[float, ...] = (0.0,)  # of the change, one of them drawn
    mend: str = ""  # columns of a mapping that mend it, as in "x:cm, distance_left=offset"
    blur: float = 0.0  # times the size, allowed beside the tolerance of the offset [-]

    def mends(self) -> dict[str, str]:
        """Standard name -> COLUMN:UNIT."""
        tokens = re.findall(r"(\w+)(?:=(\w+))?((?::[^,]+)?)", self.mend)
        return {name: (column or name) + unit for name, column, unit in tokens}


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


def marked(value: float) -> Callable[[Rows, float], Rows]:
    """Every thirtieth second without a place, but for a number that stands for none."""
    return lambda rows, _: rows.assign(offset=rows["offset"].where(rows["time"] % 30.0 < 29.0, value))


def frozen(names: str) -> Callable[[Rows, float], Rows]:
    """What a tracker holds on to while it sees nothing."""

    def held(rows: Rows, size: float) -> Rows:
        seen = ~rows["time"].between(15.0, 15.0 + size)
        kept = {name: rows[name].where(seen) for name in names.split()}
        who = rows["id"] if "id" in rows else pd.Series(0, index=rows.index)
        return rows.assign(**{name: values.groupby(who).ffill() for name, values in kept.items()})

    return held


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
    "places in cm": Bend(scaled("x y", 100.0), mend="x:cm, y:cm"),
    "places in ft": Bend(scaled("x y", 1 / 0.3048), mend="x:ft, y:ft"),
    "lengths in cm": Bend(scaled("length", 100.0), mend="length:cm"),
    "one id for two": Bend(lambda rows, _: rows.assign(id=rows["id"].replace("beside", "car"))),
    "length and width exchanged": Bend(exchanged("length", "width")),
    "a map aside": Bend(sideways, (1.0, 1.4, -1.2)),
    "noise": Bend(blurred("x y"), (0.02, 0.05), blur=5.0),
    "much noise": Bend(blurred("x y"), (0.3, 0.5)),
    "one vehicle twice": Bend(lambda rows, _: pd.concat([rows, rows[rows["id"] == "car"].assign(id="again")])),
    "speed and heading exchanged": Bend(exchanged("speed", "heading")),
    "heading 90 degrees off": Bend(lambda rows, _: rows.assign(heading=rows["heading"] + np.pi / 2)),
    "heading of the compass": Bend(
        lambda rows, _: rows.assign(heading=(90.0 - np.degrees(rows["heading"])) % 360.0), mend="heading:compass"),
    "places in km": Bend(scaled("x y", 1e-3), mend="x:km, y:km"),
    "clock of frames": Bend(lambda rows, _: rows.assign(time=np.round(rows["time"] * 25.0)), mend="time:1/25 s"),
    "speed backwards": Bend(scaled("speed", -1.0)),
    "speed in kn": Bend(scaled("speed", 3600 / 1852), mend="speed:kn"),
    "lengths in ft": Bend(scaled("length width", 1 / 0.3048), mend="length:ft, width:ft"),
    "frozen": Bend(frozen("x y"), (1.0, 4.0)),
    "x mirrored": Bend(lambda rows, _: rows.assign(x=-rows["x"], heading=np.pi - rows["heading"])),
    "clocks of their own": Bend(
        lambda rows, _: rows.assign(time=rows["time"] - rows.groupby("id")["time"].transform("min"))),
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
    "from the left marking": Bend(lambda rows, _: rows.assign(offset=0.5 * rows["lane_width"] - rows["offset"]),
                                  mend="distance_left=offset"),
    "from the right marking": Bend(lambda rows, _: rows.assign(offset=0.5 * rows["lane_width"] + rows["offset"]),
                                   mend="distance_right=offset"),
    "from the marking, in cm": Bend(
        lambda rows, _: rows.assign(offset=50.0 * rows["lane_width"] - 100.0 * rows["offset"]),
        mend="distance_left=offset:cm"),
    "from the marking, no lanes": Bend(lambda rows, _: rows.assign(
        offset=0.5 * rows["lane_width"] - rows["offset"]).drop(columns=["lane_index", "lane_count"]),
        mend="distance_left=offset"),
    "in lane widths": Bend(
        lambda rows, _: rows.assign(offset=rows["offset"] / kit.WIDTH), mend=f"offset:{kit.WIDTH} m"),
    "lanes from the left": Bend(lambda rows, _: rows.assign(lane_index=1 - rows["lane_index"])),
    "half widths": Bend(scaled("lane_width", 0.5)),
    "twice the widths": Bend(scaled("lane_width", 2.0)),
    "wider lanes": Bend(scaled("lane_width", 1.4), mend="lane_width:0.714 m"),
    "narrower lanes": Bend(scaled("lane_width", 0.7), mend="lane_width:1.43 m"),
    "widths in ft": Bend(scaled("lane_width", 1 / 0.3048), mend="lane_width:ft"),
    "missing as -999": Bend(marked(-999.0)),
    "missing as -1": Bend(marked(-1.0)),
    "missing as 0": Bend(marked(0.0)),
    "frozen": Bend(frozen("offset"), (4.0,)),
    "speed backwards": Bend(scaled("speed", -1.0), mend="speed:-m/s"),
    "clock of frames": Bend(lambda rows, _: rows.assign(time=np.round(rows["time"] * 25.0)), mend="time:1/25 s"),
    "as distances": Bend(lambda rows, _: distances(rows)),
    "as distances, exchanged": Bend(lambda rows, _: exchanged("distance_left", "distance_right")(distances(rows), 0.0)),
    "as distances, in cm": Bend(lambda rows, _: scaled("distance_left distance_right", 100.0)(distances(rows), 0.0),
                                mend="distance_left:cm, distance_right:cm"),
    "as distances, one negative": Bend(lambda rows, _: scaled("distance_right", -1.0)(distances(rows), 0.0),
                                       mend="distance_right:-m"),
    "as distances, of the wheels": Bend(lambda rows, _: distances(rows, 0.8)),
    "decimal commas": Bend(lambda rows, _: rows.map(lambda one: f"{one:.6f}".replace(".", ","))),
    "clock times": Bend(lambda rows, _: rows.assign(
        time=(pd.Timestamp("2026-11-28 14:03:05") + pd.to_timedelta(rows["time"], unit="s")).map(str)), mend=""),
}  # fmt: skip
UNBENT = ("as it is", "gap", "every other row", "rows in another order", "noise", "rounded to cm",
          "clock of the epoch", "as distances", "decimal commas", "clock times", "clocks of their own")  # fmt: skip
"""Bends of what nothing is wrong with: it is read."""
OF_LAYOUTS = (
    *("as it is", "gap", "rows in another order", "noise", "rounded to cm", "a map aside", "one vehicle twice"),
    *("y points down", "x and y exchanged", "one id for two"),
)
"""Bends of public layouts."""
FREE_RATES = ("tracks", "table")
FOLLOWING = 8.0
"""Behind which others drive as those that the kit has: what a map says needs more than four vehicles. [s]"""
OTHERS = {"fcd": None, "commonroad": "commonroad", "osi": "osi_utilities"}
"""Formats whose files are written in many ways, but not bent; the package that one needs."""


def distances(rows: Rows, half: float = 0.0) -> Rows:
    """In place of offset and width, to the markings, from points so far to each side. [m]"""
    wide = 0.5 * rows["lane_width"] - half
    made = rows.assign(distance_left=wide - rows["offset"], distance_right=wide + rows["offset"])
    return made.drop(columns=["offset", "lane_width"])


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
        layout = draw.choices(["tracks", "table", "public", *others], [5, 4, 4, *(0.5 for _ in others)])[0]
        case = {
            "hand": draw.choice(["right", "left"]), "against": draw.random() < 0.5,
            "turned": draw.choice([0.0, 2.0, -1.0]),
            "rate": {"public": 25.0}.get(layout, draw.choice([10.0, 25.0, 50.0]) if layout in FREE_RATES else 10.0),
            "radius": draw.choice([None, None, 800.0]) if layout != "fcd" else None,
        }  # fmt: skip
        bends = {"tracks": sorted(TRACKS), "table": sorted(TABLE), "public": OF_LAYOUTS}.get(layout, ["as it is"])
        bend = draw.choice(bends)
        if bend == "clock of frames":
            case["rate"] = 25.0
        reference = draw.choice(["centre", "rear axle", "front"]) if layout == "tracks" else "centre"
        return {
            "layout": layout,
            "case": case,
            "bend": bend,
            "size": draw.choice(_bend(layout, bend).sizes),
            "reference": reference,
            "public": draw.choice(sorted(LAYOUTS)) if layout == "public" else "",
        }

    def look(self, spec: Spec, only: Finding | None = None) -> list[Finding]:
        bend = _bend(spec["layout"], spec["bend"])
        mends = {**(LAYOUTS[spec["public"]].mend if spec["public"] else {}), **bend.mends()}
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            case, words = written(spec, folder)
            (wrong, text), kept = read(spec, case, words, bend, folder), dict[str, str]()
            while wrong is None and mends:
                left = {name: column for name, column in mends.items() if name not in kept}
                more = {name: column for name, column in left.items() if _is_named(name, column, text)}
                if not more:
                    break
                kept |= more
                wrong, text = read(spec, case, mapped(words, spec, folder, kept), bend, folder)
            if wrong is None and (spec["bend"] in UNBENT or bend.mend):
                kind = "refused, and nothing is wrong" if not mends else "refused, the option is not named"
                return [self._finding(spec, kind, text)]
            said = bool(wrong) and any(word in text for word in ("warning:", "may be", "note: "))
            kind = f"read wrongly: {wrong}" if not kept else f"the option does not mend it: {wrong}"
            return [self._finding(spec, kind, text, said=said)] if wrong else []

    def _finding(self, spec: Spec, kind: str, text: str, *, said: bool = True) -> Finding:
        where = f"{spec['public'] or spec['layout']}, {spec['case']['hand']}"
        return {"stage": spec["bend"], "kind": kind, "context": where, "who": spec["public"] or spec["layout"],
                "t": 0.0, "size": 0.0, "said": said, "text": text[-600:]}  # fmt: skip

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


def _bend(layout: str, name: str) -> Bend:
    return (TABLE if layout == "table" else TRACKS)[name]


def _is_named(name: str, column: str, text: str) -> bool:
    """Whether a message names an option: with its unit, where it is one of units."""
    unit = column.partition(":")[2]
    said = f"{name}=COLUMN:{unit}" in text or f"{name}={column}" in text
    return said or (f"{name}=COLUMN" in text and (not unit or "no column" in text))


def mapped(words: list[str], spec: Spec, folder: Path, columns: Mapping[str, str]) -> list[str]:
    """With a mapping of columns."""
    public = LAYOUTS[spec["public"]] if spec["public"] else None
    reference = public.reference if public else spec["reference"]
    lines = [] if spec["layout"] == "table" else [f'reference = "{reference}"']
    stated = [f'{name} = "{column}"' for name, column in columns.items()]
    lines += ["[columns]", *stated] if columns else []
    lines += public.lines if public else []
    (folder / "mapping.toml").write_text("\n".join(lines) + "\n")
    return [word for word in words if word != "--mapping" and not word.endswith(".toml")] + [
        "--mapping", str(folder / "mapping.toml")]  # fmt: skip


def written(spec: Spec, folder: Path) -> tuple[kit.Case, list[str]]:
    """The files, and the words of the command that reads them."""
    bend, layout = _bend(spec["layout"], spec["bend"]), spec["layout"]
    case = kit.Case(**{**spec["case"], "radius": spec["case"]["radius"] or np.inf})
    words = ["import", layout]
    if layout == "fcd":
        fcd, net = kit.sumo_files(case, folder)
        (folder / "types.rou.xml").write_text(kit.TYPES)
        return case, [*words, str(fcd), "--net", str(net), "--types", str(folder / "types.rou.xml")]
    if layout in ("commonroad", "osi"):
        write = kit.commonroad_file if layout == "commonroad" else kit.write_osi_trace
        return case, [*words, str(write(case, folder))]
    public = LAYOUTS[spec["public"]] if spec["public"] else None
    alone = case.tracks(public.reference if public else spec["reference"]).assign(speed=kit.SPEED, width=2.0)
    later = alone[alone["id"] != "car"].assign(time=alone["time"] - FOLLOWING, id=alone["id"] + " 2")
    own = pd.concat([alone, later[later["time"] >= 0.0]]).sort_values("time", kind="stable", ignore_index=True)
    rows = drive_table(case) if layout == "table" else own
    bent, road = bend.change(rows, spec["size"]), str(kit.road_file(case, folder))
    if public:
        words = ["import", public.format, str(layouts.write(public, bent, folder)), "--road", road]
        return case, mapped(words, spec, folder, {}) if public.lines or public.reference != "centre" else words
    separator = ";" if spec["bend"] == "decimal commas" else ","
    bent.to_csv(folder / "bent.csv", index=False, sep=separator)
    words.append(str(folder / "bent.csv"))
    if layout == "table":
        return case, words
    words += ["--road", road]
    return case, words if spec["reference"] == "centre" else mapped(words, spec, folder, {})


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
    text = said.getvalue().partition("licence:")[0]
    if code:
        return (None if "Traceback" not in text else "traceback"), text
    table = pd.read_parquet(out)
    if spec["layout"] == "table":  # as fits read it
        table = pd.concat([as_frame(drive) for drive in read_drives(out)])
        return differs(table, drive_table(case), spec, bend), text
    found = {re.split("[:-]", str(name))[-1]: part for name, part in table.groupby("drive")}
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
    blur = bend.blur * spec["size"] if not spec["public"] or LAYOUTS[spec["public"]].has_length else np.inf
    return wrong or ("lead_distance" if lead > 0.2 + 2.0 * blur or np.isnan(lead) else ""), text


def as_frame(drive: Drive) -> Rows:
    """Its columns."""
    return pd.DataFrame({"time": drive.time, "offset": drive.offset, **drive.context})


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
    blur += LAYOUTS[spec["public"]].blur if spec["public"] else 0.0
    for name, tolerance in TOLERANCES.items():
        if name in table and np.nanmax(np.abs(table[name].to_numpy() - true[name].to_numpy())) > tolerance + (
            blur if name == "offset" else 0.0
        ):
            return name
    if "lane_index" in table and (table["lane_index"].to_numpy() != true["lane_index"].to_numpy()).mean() > 0.02:
        return "lane_index"
    return ""
