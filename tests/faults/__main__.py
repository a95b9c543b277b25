"""A longer attack: ``python -m tests.faults --count 200 --seed 7 [READER...]``; faults land in out/faults."""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from tests.faults.attack import Count, Fault, attack
from tests.faults.doors import DOORS, NEEDS, attack_door
from tests.faults.mutants import mutate
from tests.faults.readers import READERS
from tests.faults.structured import mutate_structure

Attack = Callable[[Path, Count], Iterator[Fault]]
CHANGES = {"bytes": mutate, "structure": mutate_structure}


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("readers", nargs="*")
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--how",
        choices=[*CHANGES, "doors"],
        default="bytes",
        help="damage bytes, change what a file says, or what a simulation says",
    )
    parser.add_argument("--out", type=Path, default=Path("out/faults"))
    given = parser.parse_args()
    faults = 0
    attacks: dict[str, Attack]
    needs = NEEDS | {reader.name: (reader.needs,) for reader in READERS if reader.needs}
    if given.how == "doors":
        attacks = {name: partial(attack_door, name, given.count, given.seed) for name in DOORS}
    else:
        change = CHANGES[given.how]
        attacks = {reader.name: partial(attack, reader, given.count, given.seed, change=change) for reader in READERS}
    for name, attacked in attacks.items():
        if given.readers and name not in given.readers:
            continue
        if missing := [package for package in needs.get(name, ()) if find_spec(package) is None]:
            print(f"{name}: left out, {missing[0]} is not installed", flush=True)
            continue
        tally, begin = Count(), time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            for fault in attacked(Path(folder), tally):
                faults += 1
                given.out.mkdir(parents=True, exist_ok=True)
                path = given.out / f"{name}-{'-'.join(map(str, fault.seed))}-{fault.file}"
                path.write_bytes(fault.data)
                print(f"--- {path}\n{fault.what}", flush=True)
        seconds = time.monotonic() - begin
        print(f"{name}: {tally.refused} refused, {tally.accepted} accepted, {seconds:.0f} s", flush=True)
    print(f"{faults} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    raise SystemExit(main())
