"""A longer attack: ``python -m tests.faults --count 200 --seed 7 [READER...]``; faults land in out/faults."""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from tests.faults.attack import Count, attack
from tests.faults.mutants import mutate
from tests.faults.readers import READERS
from tests.faults.structured import mutate_structure

CHANGES = {"bytes": mutate, "structure": mutate_structure}


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("readers", nargs="*")
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--how", choices=[*CHANGES], default="bytes", help="damage bytes, or change what a file says")
    parser.add_argument("--out", type=Path, default=Path("out/faults"))
    given = parser.parse_args()
    faults = 0
    for reader in READERS:
        if given.readers and reader.name not in given.readers:
            continue
        tally, begin = Count(), time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            for fault in attack(reader, given.count, given.seed, Path(folder), tally, CHANGES[given.how]):
                faults += 1
                given.out.mkdir(parents=True, exist_ok=True)
                path = given.out / f"{reader.name}-{'-'.join(map(str, fault.seed))}-{fault.file}"
                path.write_bytes(fault.data)
                print(f"--- {path}\n{fault.what}", flush=True)
        seconds = time.monotonic() - begin
        print(f"{reader.name}: {tally.refused} refused, {tally.accepted} accepted, {seconds:.0f} s", flush=True)
    print(f"{faults} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    raise SystemExit(main())
