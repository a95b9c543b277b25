"""A scenario database in SQLite: select by tag, enrich, write paths and provenance back in one transaction.

Run it twice: the second time everything is up to date and the database is left alone.

python examples/scenario_database.py [OUTPUT FOLDER]
"""

from __future__ import annotations

import json
import sqlite3
import sys
from collections.abc import Hashable, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import pandas as pd

import xosc_lateral as xl

SCHEMA = """
CREATE TABLE IF NOT EXISTS scenario (id INTEGER PRIMARY KEY, path TEXT UNIQUE, seed INTEGER NOT NULL);
CREATE TABLE IF NOT EXISTS tag (scenario_id INTEGER REFERENCES scenario, name TEXT, UNIQUE (scenario_id, name));
CREATE TABLE IF NOT EXISTS lifelike (
    path TEXT PRIMARY KEY, scenario_id INTEGER REFERENCES scenario, sha256 TEXT, seed INTEGER, variant INTEGER,
    profiles TEXT, inputs TEXT, package_version TEXT, segment_seconds REAL, smallest_gap REAL, error TEXT
);
"""


def main(out: Path) -> None:
    """Fill a database with the package's templates, then enrich what is tagged "regression"."""
    out.mkdir(parents=True, exist_ok=True)
    with closing(sqlite3.connect(out / "scenarios.sqlite")) as database:
        fill(database, out / "maneuvers")
        enrich(database, "regression", out / "lifelike")
        enrich(database, "regression", out / "lifelike")


def fill(database: sqlite3.Connection, folder: Path) -> None:
    """Write templates and list them with their tags."""
    database.executescript(SCHEMA)
    with database:
        for seed, name in enumerate(("cut-in", "braking-leader", "overtake-truck")):
            path = folder / f"{name}.xosc"
            if not path.exists():
                xl.write_template(name, folder)
            database.execute("INSERT OR IGNORE INTO scenario (path, seed) VALUES (?, ?)", (str(path), seed))
            tags = ("motorway", "regression") if seed != 1 else ("motorway",)
            database.executemany(
                "INSERT OR IGNORE INTO tag SELECT id, ? FROM scenario WHERE path = ?",
                [(tag, str(path)) for tag in tags],
            )


def enrich(database: sqlite3.Connection, tag: str, folder: Path) -> None:
    """Convert the tagged scenarios and record what is new: all of it or, if anything goes wrong, nothing."""
    selected = pd.read_sql_query(
        "SELECT path AS scenario, seed, id FROM scenario JOIN tag ON tag.scenario_id = scenario.id WHERE tag.name = ?",
        database,
        params=(tag,),
    )
    batch = xl.convert_many(selected.drop(columns="id"), folder, profile="motorway")
    ids = {Path(path).name: int(number) for path, number in zip(selected["scenario"], selected["id"], strict=True)}
    known = dict(database.execute("SELECT path, sha256 FROM lifelike").fetchall())
    outputs = batch.to_frame()
    new = [row for row in outputs.to_dict("records") if known.get(str(folder / row["output"])) != row["output_sha256"]]
    with database:
        database.executemany(
            "INSERT OR REPLACE INTO lifelike VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
            [record(row, folder, ids) for row in new],
        )
    count, gap = database.execute("SELECT count(*), min(smallest_gap) FROM lifelike WHERE error = ''").fetchone()
    converted = int((outputs["state"] != "up to date").sum())
    print(f"{len(selected)} tagged {tag!r}: {converted} converted, {len(new)} recorded")
    print(f"{count} in the database, smallest gap {gap:.2f} m")


def record(row: Mapping[Hashable, Any], folder: Path, ids: dict[str, int]) -> tuple[object, ...]:
    """The database's row of an output."""
    return (
        str(folder / row["output"]),
        ids[Path(row["scenario"]).name],
        row["output_sha256"],
        row["seed"],
        row["variant"],
        json.dumps(row["profiles"]),
        json.dumps(row["inputs"]),
        row["package_version"],
        row["segment_seconds"],
        row["gap_after"],
        row["error"],
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out/examples"))
