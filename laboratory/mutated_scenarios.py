"""Scenarios that nobody wrote: field scenarios with a few changed values, played here and by the reference player.

    python -m laboratory.mutated_scenarios FOLDER... --esmini PATH [--count 150] [--seed 1] [--keep FOLDER]

A mutant has one to three changes, each of one place: a number (lanes by one, else to between a half and twice of it),
a word for another that the standard has there, or start triggers of two events exchanged. Those that the reference
player can't play are drawn anew. They agree as in `laboratory.agreement`. Docs: docs/validation/playing.md.
"""

from __future__ import annotations

import argparse
import random
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from lxml import etree

from laboratory.agreement import Tally, compared, scenarios

LANES = ("laneId", "dLane", "AbsoluteTargetLane", "RelativeTargetLane")
"""Attributes, and elements whose value is a lane."""
NUMBERS = ("value", "s", "ds", "offset", "dt", "dx", "dy", "delay", "targetLaneOffset", "distance", "tolerance", "time")
WORDS = {
    "dynamicsShape": ("linear", "cubic", "sinusoidal", "step"),
    "dynamicsDimension": ("time", "rate", "distance"),
    "priority": ("overwrite", "parallel", "skip"),
    "conditionEdge": ("none", "rising", "falling", "risingOrFalling"),
    "rule": ("lessThan", "greaterThan"),
    "freespace": ("true", "false"),
    "triggeringEntitiesRule": ("any", "all"),
    "followingMode": ("position", "follow"),
    "continuous": ("true", "false"),
    "maximumExecutionCount": ("1", "2"),
}
PLAYED = (".//{*}Init//{*}Private//*", ".//{*}Story//*")
REFERENCES = {"LogicFile": "filepath", "SceneGraphFile": "filepath", "Directory": "path"}
DRAWS = 4
"""Times the number of mutants, after which no more are drawn."""


def places(root: etree._Element) -> list[Callable[[random.Random], None]]:
    """All that can be changed in one place."""
    found: list[Callable[[random.Random], None]] = []

    def number(item: etree._Element, name: str, chance: random.Random) -> None:
        value = float(item.get(name) or "")
        is_lane = name in LANES or etree.QName(item).localname in LANES
        changed = value + chance.choice((-1, 1)) if is_lane else round(value * 2.0 ** chance.uniform(-1, 1), 3)
        item.set(name, f"{changed:g}")

    def word(item: etree._Element, name: str, chance: random.Random) -> None:
        item.set(name, chance.choice([one for one in WORDS[name] if one != item.get(name)]))

    for item in (one for path in PLAYED for one in root.iterfind(path) if isinstance(one.tag, str)):
        for name in () if etree.QName(item).localname == "Knot" else map(str, item.attrib):
            if name in WORDS:
                found.append(partial(word, item, name))
            elif name in LANES + NUMBERS and _is_number(item.get(name)):
                found.append(partial(number, item, name))
    triggers = [one for one in root.iterfind(".//{*}Event/{*}StartTrigger") if len(one)]
    if len(triggers) > 1:
        found.append(lambda chance: _exchange(*chance.sample(triggers, 2)))
    return found


def _is_number(text: str | None) -> bool:
    try:
        return abs(float(text or "")) > 0.0
    except ValueError:
        return False


def _exchange(one: etree._Element, other: etree._Element) -> None:
    mine, theirs = list(one), list(other)
    one.extend(theirs)
    other.extend(mine)


def mutants(sources: list[Path], folder: Path, seed: int) -> Iterator[Path]:
    """Without end; each leads to its source's road and catalogs."""
    chance = random.Random(seed)
    for k in range(1, 10**6):
        source = chance.choice(sources)
        tree = etree.parse(str(source), etree.XMLParser(recover=True))
        changes, road = places(tree.getroot()), tree.find(".//{*}LogicFile")
        if not changes or road is None or not (source.parent / (road.get("filepath") or "")).is_file():
            continue
        for change in chance.sample(changes, min(chance.randint(1, 3), len(changes))):
            change(chance)
        for item in tree.iter("{*}LogicFile", "{*}SceneGraphFile", "{*}Directory"):
            name = REFERENCES[etree.QName(item).localname]
            item.set(name, str((source.parent / (item.get(name) or "")).resolve()))
        path = folder / f"m{k:04d}_{source.stem}.xosc"
        tree.write(str(path), encoding="utf-8", xml_declaration=True)
        yield path


def main() -> None:
    """Draw, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="+")
    parser.add_argument("--esmini", type=Path, required=True)
    parser.add_argument("--count", type=int, default=150, help="of mutants that the reference player plays")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--step", type=float, default=0.02)
    parser.add_argument("--time-limit", type=float, default=30.0)
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="where mutants are written to")
    options = parser.parse_args()
    tally = Tally()
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.keep or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        sources = scenarios(options.folder, None)
        run = (options.esmini.resolve(), options.step, options.time_limit)
        for drawn, path in enumerate(mutants(sources, folder, options.seed)):
            if tally.agreeing + tally.differing >= options.count or drawn >= DRAWS * options.count:
                break
            compared(path, *run, tally, allowed=[path.anchor])
    print(tally)


if __name__ == "__main__":
    main()
