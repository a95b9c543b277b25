"""What the reference player makes of the outputs, in both modes, over folders of other people's scenarios.

    python -m laboratory.player_outputs FOLDER... --player PATH [--checker PATH] [--once] [--limit N] [--csv FILE]

PATH is esmini's executable (a headless build is enough) and that of the ASAM checker bundle (`qc_openscenario` of the
package `asam-qc-openscenarioxml`). Every scenario is converted in both modes; input and outputs are played with frames
of 0.01 s, controllers off. Per scenario and mode:

- far: the largest distance between a car in the player and where it was written to be. In trajectory mode the whole
  path; in lane-offset mode to the sides of the sampled path, on road-following stretches, from the end of the first
  transition on (at once where the scenario begins with the stretch). [cm]
- turn: by how much more a car's heading changes within 0.01 s, above 5 m/s, than around that time in the played input
  and (in trajectory mode) in what was written; in lane-offset mode its direction of movement, too, but for the time of
  the scenario's own lateral actions. [mrad]
- late: the largest difference of an event's start from that in the input, and how many no longer start. In trajectory
  mode those of what is no motion. [s]
- schema, checker: findings that the input does not have. `said`: the conversion warned of a shifted event.

Scenarios that the player can't play, or that `convert` refuses in a line, are counted apart. `--once` takes one
scenario of each name, that of the first folder. Rows go to the CSV file as they come, and what is in it already is not
measured again.
"""

from __future__ import annotations

import argparse
import tempfile
import traceback
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from lxml import etree

import xosc_lateral as xl
from laboratory.agreement import scenarios
from laboratory.findings import checker_findings, checker_findings_of_input, schema_findings
from laboratory.in_player import PlayerRun, Span, beside, distance, run, sharpest, shifts, within

MODES = ("trajectory", "lane-offset")
BOUNDS = {"far_cm": 5.0, "turn_mrad": 0.3, "late_s": 0.05, "lost": 0, "schema": 0, "checker": 0}
"""What is asked of each measure."""
TITLES = (
    "5 cm to what was written",
    "turns within 0.3 mrad in 0.01 s",
    "events within 0.05 s",
    "no event lost",
    "no new finding of the schema",
    "none of the ASAM checker",
)
UNITS = {"far_cm": "cm", "turn_mrad": "mrad", "late_s": "s"}
LATERAL = ("LaneChangeAction", "LaneOffsetAction", "LateralDistanceAction", "FollowTrajectoryAction")
OURS = "xosc-lateral"


@dataclass(slots=True)
class Measured:
    """One output in the player, or why there is none (`apart`)."""

    scenario: str
    mode: str
    apart: str = ""
    far_cm: float = 0.0
    turn_mrad: float = 0.0
    late_s: float = 0.0
    lost: int = 0
    schema: int = 0
    checker: int = 0
    said: bool = False
    what: str = ""

    def row(self) -> str:
        """For people."""
        if self.apart:
            return f"{self.scenario[:44]:44} {self.mode:11} {self.apart}: {self.what[-1000:]}"
        numbers = f"{self.far_cm:7.2f} cm {self.turn_mrad:8.3f} mrad {self.late_s:6.3f} s"
        counts = f"{self.lost} lost {self.schema} schema {self.checker} checker"
        return (
            f"{self.scenario[:44]:44} {self.mode:11} {numbers} {counts} {'said ' if self.said else ''}{self.what[:140]}"
        )


def actions(scenario: Path) -> Iterator[tuple[str, etree._Element, set[str]]]:
    """Name, element and actors of every action of an event."""
    for group in etree.parse(str(scenario)).getroot().iter("{*}ManeuverGroup"):
        actors = {item.get("entityRef") or "" for item in group.iter("{*}EntityRef")}
        for action in group.iter("{*}Action"):
            yield action.get("name") or "", action, actors


def kept_actions(output: Path) -> set[str]:
    """Names of what is no motion in a trajectory output."""
    root = etree.parse(str(output)).getroot()
    events = [event for event in root.iter("{*}Event") if (event.get("name") or "").startswith("kept ")]
    return {action.get("name") or "" for event in events for action in event.iter("{*}Action")}


def followers(output: Path) -> set[str]:
    """Entities with a trajectory."""
    return {
        actor
        for _, action, actors in actions(output)
        if action.find(".//{*}FollowTrajectoryAction") is not None
        for actor in actors
    }


def own_lateral(output: Path, played: PlayerRun) -> Mapping[str, list[Span]]:
    """When the scenario's own lateral actions move which entity aside.

    Their first frames count as ours, but for those of trajectories, which begin elsewhere.
    """
    found: dict[str, list[Span]] = {}
    for name, action, actors in actions(output):
        kind = next((tag for tag in LATERAL if action.find(f".//{{*}}{tag}") is not None), None)
        if kind is None or name.startswith(OURS):
            continue
        first = 0.0 if kind == "FollowTrajectoryAction" else 0.03
        for actor in actors:
            found.setdefault(actor, []).extend((start + first, end + 0.03) for start, end in played.spans(name))
    return found


def settled(output: Path, played: PlayerRun) -> Mapping[str, list[Span]]:
    """From the end of the first transition of each of our acts to the act's end; at once if it was put down aside."""
    placed = {
        private.get("entityRef")
        for private in etree.parse(str(output)).getroot().iter("{*}Private")
        if private.find(".//{*}LaneOffsetActionDynamics[@dynamicsShape='step']") is not None
    }
    found: dict[str, list[Span]] = {}
    for name, _, actors in actions(output):
        if name.startswith(OURS) and name.endswith("action 1"):
            for (begin, end), (_, act_end) in zip(
                played.spans(name), played.spans(name[: -len(" action 1")]), strict=False
            ):
                for actor in actors:
                    found.setdefault(actor, []).append((0.0 if begin <= 0.02 and actor in placed else end, act_end))
    return found


def on_stretches(made: xl.Conversion, output: Path, played: PlayerRun) -> Mapping[str, list[Span]]:
    """Where the offsets are to be followed, by entity."""
    after = settled(output, played)
    found: dict[str, list[Span]] = {}
    for item in made.to_dict()["entities"]:
        for start, end in item["segments"]:
            begins = [
                max(start, begin) for begin, until in after.get(item["name"], ()) if begin < end and until > start
            ]
            if begins:
                found.setdefault(item["name"], []).append((min(begins), end - 0.1))
    return found


def measure(path: Path, mode: str, plain: PlayerRun, folder: Path, options: argparse.Namespace) -> Measured:
    """Convert in one mode, play, compare."""
    output = folder / path.name
    made = xl.convert(
        path, output, mode=mode, seed=options.seed, time_limit=options.time_limit, allow=options.folders, force=True
    )
    played = run(options.player, output, made.end_time - 0.005, folder)
    by_trajectory = mode == "trajectory"
    spans = {} if by_trajectory else on_stretches(made, output, played)
    lateral = {} if by_trajectory else own_lateral(output, played)
    result = Measured(path.stem, mode)
    meant = {str(name): one for name, one in made.to_frame().groupby("name")}
    for name in sorted((followers(output) if by_trajectory else set(meant)) & set(plain.rows)):
        rows = played.rows.get(name)
        if rows is None:
            result.far_cm, result.what = np.inf, f"{name} is not there"
            continue
        far = distance(meant[name], rows) if by_trajectory else beside(meant[name], rows)
        if not by_trajectory:
            far = np.where(within(rows["time"].to_numpy(), spans.get(name, [])), far, np.nan)
        _worse(result, "far_cm", 100.0 * np.abs(far), rows["time"].to_numpy(), name)
        for by_path in (False,) if by_trajectory else (False, True):
            others = [plain.rows[name], meant[name]] if by_trajectory else [plain.rows[name]]
            time, turn = sharpest(rows, others, by_path=by_path)
            turn = np.where(within(time, lateral.get(name, [])), 0.0, turn)
            _worse(result, "turn_mrad", 1e3 * turn, time, name)
    kept = kept_actions(output) if by_trajectory else plain.starts.keys()
    before = {name: times for name, times in plain.starts.items() if name in kept}
    result.late_s, result.lost = shifts(before, played.starts, made.end_time)
    found = [schema_findings(output) - schema_findings(path)]
    if options.checker is not None:
        found.append(checker_findings(options.checker, output) - checker_findings_of_input(options.checker, path))
    result.schema, result.checker = found[0].total(), found[-1].total() if options.checker is not None else 0
    result.said = any("with the offsets" in line for line in made.warnings)
    result.what += " ".join(next(iter(one), "") for one in found)
    return result


def _worse(result: Measured, field: str, values: np.ndarray, time: np.ndarray, name: str) -> None:
    """Keep the worst value; name who and when where it is beyond its bound."""
    if not np.isfinite(values).any() or np.nanmax(values) <= getattr(result, field):
        return
    worst = int(np.nanargmax(values))
    setattr(result, field, float(values[worst]))
    if values[worst] > BOUNDS[field]:
        result.what += f"{field.partition('_')[0]}: {name} at {time[worst]:.2f} s; "


def summary(table: pd.DataFrame) -> str:
    """As in docs/playing.md: for each mode how many outputs keep each bound, and the worst one."""
    modes = {mode: rows for mode in MODES if len(rows := table[table["mode"] == mode])}
    lines = ["| | " + " | ".join(f"{mode} mode, {len(rows)} outputs | worst" for mode, rows in modes.items()) + " |"]
    lines.append("|---|" + "---|---|" * len(modes))
    for (name, bound), title in zip(BOUNDS.items(), TITLES, strict=True):
        cells = [
            f"{100.0 * np.mean(rows[name] <= bound + 1e-9):.1f} % | {_worst(rows, name)}" for rows in modes.values()
        ]
        lines.append(f"| {title} | {' | '.join(cells)} |")
    for mode, rows in modes.items():
        quiet = int(((rows["late_s"] > BOUNDS["late_s"]) & ~rows["said"].astype(str).eq("True")).sum())
        close = 100.0 * np.mean(rows["far_cm"] <= 2.0)
        lines.append(f"{mode}: {close:.0f} % within 2 cm; {quiet} with an event that is off and not warned of")
    return "\n".join(lines)


def _worst(rows: pd.DataFrame, name: str) -> str:
    """The largest value, and whose it is if it is beyond the bound."""
    worst, unit = rows[name].max(), UNITS.get(name, "")
    whose = f" (`{rows.loc[rows[name].idxmax(), 'scenario']}`)" if worst > BOUNDS[name] else ""
    return f"{worst:.3g} {unit}".strip() + whose


def outputs(path: Path, scenario: str, options: argparse.Namespace) -> Iterator[Measured]:
    """Measure those of one scenario."""
    with tempfile.TemporaryDirectory() as name:
        plain = run(options.player, path, options.time_limit, Path(name))
        if not plain.rows or max(one["time"].max() for one in plain.rows.values()) < 0.03:
            yield Measured(scenario, "", "not played by the player")
            return
        for mode in options.mode or MODES:
            try:
                yield replace(measure(path, mode, plain, Path(name), options), scenario=scenario)
            except xl.XoscLateralError as error:
                yield Measured(scenario, mode, f"refused ({mode})", what=" ".join(str(error).split())[-150:])
            except Exception:
                yield Measured(scenario, mode, f"traceback ({mode})", what=traceback.format_exc())


def chosen(options: argparse.Namespace) -> Iterator[tuple[str, Path]]:
    """Scenarios, each with what tells it from the others."""
    names: set[str] = set()
    for path in scenarios(options.places, options.limit):
        if not options.once or path.stem.lower() not in names:
            yield path.stem if options.once else "/".join(path.parts[-4:]), path
        names.add(path.stem.lower())


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("places", type=Path, nargs="+", metavar="FOLDER")
    parser.add_argument("--player", type=Path, required=True)
    parser.add_argument("--checker", type=Path)
    parser.add_argument("--mode", choices=MODES, action="append")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--time-limit", type=float, default=30.0)
    parser.add_argument("--limit", type=int, help="this many scenarios, evenly spread")
    parser.add_argument("--once", action="store_true", help="one scenario of each name")
    parser.add_argument("--csv", type=Path, help="where all rows go")
    options = parser.parse_args()
    options.player = options.player.resolve()
    options.folders = [place if place.is_dir() else place.parent.parent for place in options.places]
    found: list[Measured] = []
    if options.csv is not None and options.csv.exists():
        rows = pd.read_csv(options.csv, keep_default_na=False).to_dict("records")
        found = [Measured(**{str(name): value for name, value in row.items()}) for row in rows]
    known = {one.scenario for one in found}
    for scenario, path in chosen(options):
        if scenario in known:
            continue
        for one in outputs(path, scenario, options):
            found.append(one)
            print(one.row(), flush=True)
        if options.csv is not None:
            pd.DataFrame([asdict(one) for one in found]).to_csv(options.csv, index=False)
    measured = pd.DataFrame([asdict(one) for one in found if not one.apart])
    print(summary(measured) if len(measured) else "nothing was measured")
    apart = Counter(one.apart for one in found if one.apart)
    print(", ".join(f"{count} {what}" for what, count in apart.items()))


if __name__ == "__main__":
    main()
