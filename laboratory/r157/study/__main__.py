"""What lifelike traffic does to a safety verdict: the public ALKS scenarios, nominal against many seeds.

    python -m laboratory.r157.study FOLDER_OF_SCENARIOS OUTPUT_FOLDER [--seeds 100] [--profile NAME] [--table DRIVES]
        [--page PAGE.md]

FOLDER_OF_SCENARIOS holds the concrete scenarios of github.com/openMSL/sl-3-1-osc-alks-scenarios. Written are
study.json (all numbers), study.md (tables) and verdict.svg (one figure). With a drive table, false alarms are counted
on measured vehicles too. With a page, its tables are put between that page's markers.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import xosc_lateral as xl
from laboratory.r157.study.alarms import detection_times, false_alarms, measured_alarms
from laboratory.r157.study.encounters import Target, targets_of
from laboratory.r157.study.figure import save_figure, verdict_figure
from laboratory.r157.study.verdicts import GAPS, Verdicts, verdicts_of

FloatArray = NDArray[np.float64]


def study(scenarios: Sequence[Path], profile_name: str, seeds: int, table: Path | None) -> dict[str, Any]:
    """All numbers; same inputs, same numbers."""
    profile = xl.read_profile(profile_name)
    targets: list[Target] = []
    contacts = {}
    for path in scenarios:
        found, troubled = targets_of(path, profile, seeds)
        targets += found
        contacts[path.stem] = troubled
    cut_ins = [target for target in targets if "cut_in" in target.scenario]
    verdicts = {target.scenario: verdicts_of(target) for target in cut_ins}
    record: dict[str, Any] = {
        "profile": profile_name,
        "seeds": seeds,
        "scenarios": [path.stem for path in scenarios],
        "runs_with_new_contacts": contacts,
        "false_alarms": false_alarms(targets),
        "detection": {target.scenario: detection_times(target) for target in cut_ins},
        "verdicts": {name: one.record() for name, one in verdicts.items()},
    }
    if table is not None:
        record["false_alarms_measured"] = measured_alarms(table, profile)
    record["_verdicts"] = verdicts
    return record


def markdown(record: dict[str, Any]) -> str:
    """Tables for a document."""
    lines = [f"{len(record['scenarios'])} scenarios, {record['seeds']} seeds each, profile `{record['profile']}`.", ""]
    lines += [
        "| scenario, vehicle | criterion | hours | alarms per hour, nominal | lifelike | 95 % | runs with one |",
        "|---|---|---|---|---|---|---|",
    ]
    for scenario, criteria in record["false_alarms"].items():
        for name, one in criteria.items():
            low, high = one["interval"]
            share = 100.0 * one["runs_with_alarm"]
            rates = f"{one['nominal']:.1f} | {one['lifelike']:.1f} | {low:.1f} to {high:.1f}"
            lines.append(f"| {_short(scenario)} | {name} | {one['hours']:.2f} | {rates} | {share:.0f} % |")
    for name, one in record.get("false_alarms_measured", {}).items():
        if name == "hours":
            lines += ["", f"On {one:.2f} h of measured vehicles that keep their lane, either side:", ""]
            lines += ["| criterion | measured, per hour | sampled, per hour | nominal |", "|---|---|---|---|"]
        else:
            lines.append(f"| {name} | {one['measured']:.1f} | {one['sampled']:.1f} | 0.0 |")
    lines += [
        "",
        "| scenario | criterion | nominal: after [s] | lifelike: median [s] | 5 % to 95 % [s] | before the action |",
    ]
    lines += ["|---|---|---|---|---|---|"]
    for scenario, criteria in record["detection"].items():
        for name, one in criteria.items():
            low, middle, high = one["quantiles"]
            lines.append(
                f"| {_short(scenario)} | {name} | {one['nominal']:.2f} | {middle:.2f} | {low:.2f} to {high:.2f} "
                f"| {100 * one['early']:.0f} % |"
            )
    heads = [
        "scenario",
        "model",
        "verdict turns at a gap of [m], nominal",
        "lifelike, 5 % to 95 %",
        "verdicts that flip",
    ]
    heads += ["of those within 5 m of the limit", "smallest gap at the limit [m], nominal", "lifelike, 5 % to 95 %"]
    lines += ["", "| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for scenario, models in record["verdicts"].items():
        for name, one in models.items():
            low, high = one["limit_range"]
            least, _, most = one["smallest_gap_at_limit"]
            lines.append(
                f"| {_short(scenario)} | {name} | {one['limit_nominal']:.2f} | {low:.2f} to {high:.2f} "
                f"| {100 * one['flips']:.1f} % | {100 * one['flips_within_5_m_of_the_limit']:.1f} % "
                f"| {one['smallest_gap_at_limit_nominal']:.2f} | {least:.2f} to {most:.2f} |"
            )
    return "\n".join(lines) + "\n"


def _short(scenario: str) -> str:
    return scenario.removeprefix("alks_scenario_").replace("_template", "").replace("_", " ")


def main() -> None:
    """Run and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenarios", type=Path)
    parser.add_argument("output", type=Path)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--profile", default="motorway")
    parser.add_argument("--table", type=Path)
    parser.add_argument(
        "--page", type=Path, help="page whose tables, between two markers, are replaced; and its figure"
    )
    parser.add_argument("--only", nargs="+", metavar="PART", help="scenarios whose name has one of these parts")
    args = parser.parse_args()
    paths = sorted(args.scenarios.glob("*.xosc"))
    if args.only:
        paths = [path for path in paths if any(part in path.name for part in args.only)]
    if not paths:
        raise SystemExit(f"{args.scenarios}: no .xosc files")
    record = study(paths, args.profile, args.seeds, args.table)
    verdicts: dict[str, Verdicts] = record.pop("_verdicts")
    args.output.mkdir(parents=True, exist_ok=True)
    (args.output / "study.json").write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    (args.output / "study.md").write_text(markdown(record), encoding="utf-8")
    save_figure(verdict_figure(verdicts, GAPS), args.output / "verdict.svg")
    print(markdown(record))
    if args.page is not None:
        _put_into(args.page, markdown(record))
        shutil.copyfile(args.output / "verdict.svg", args.page.parent / "verdict.svg")


def _put_into(page: Path, text: str) -> None:
    marked = re.compile(r"(<!-- r157: begin -->\n).*(<!-- r157: end -->)", re.DOTALL)
    page.write_text(marked.sub(lambda match: match[1] + text + match[2], page.read_text("utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
