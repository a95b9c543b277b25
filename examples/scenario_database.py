"""A scenario database in SQLite: select by tag, enrich, write paths and provenance back in one transaction.

Run it twice: the second time everything is up to date and the database is left alone.

python examples/scenario_database.py [OUTPUT FOLDER]
"""

from __future__ import annotations

import json
import sqlite3
import sys
from contextlib import closing
from pathlib import Path

from xosc_lateral.formats.atomic import write_atomically
from xosc_lateral.pipeline.batch import Outcome, State, convert_many
from xosc_lateral.pipeline.jobs import plan_batch
from xosc_lateral.pipeline.request import Request
from xosc_lateral.pipeline.settings import ConvertSettings
from xosc_lateral.templates import TEMPLATES

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
    """Write templates and list them with their tags; what is there already stays."""
    folder.mkdir(exist_ok=True)
    database.executescript(SCHEMA)
    with database:
        for seed, template in enumerate(TEMPLATES[:3]):
            path = folder / f"{template.name}.xosc"
            for name, text in template.files().items():
                if not (folder / name).exists():
                    write_atomically(folder / name, text)
            database.execute("INSERT OR IGNORE INTO scenario (path, seed) VALUES (?, ?)", (str(path), seed))
            tags = ("motorway", "regression") if seed != 1 else ("motorway",)
            database.executemany(
                "INSERT OR IGNORE INTO tag SELECT id, ? FROM scenario WHERE path = ?",
                [(tag, str(path)) for tag in tags],
            )


def enrich(database: sqlite3.Connection, tag: str, folder: Path) -> None:
    """Convert the tagged scenarios and record what is new: all of it or, if anything goes wrong, nothing."""
    selected = database.execute(
        "SELECT path, id, seed FROM scenario JOIN tag ON tag.scenario_id = scenario.id WHERE tag.name = ?", (tag,)
    ).fetchall()
    requests = [Request(Path(path), ConvertSettings(profile="motorway-car", seed=seed)) for path, _, seed in selected]
    ids = {Path(path).name: scenario_id for path, scenario_id, _ in selected}
    batch = plan_batch(requests, folder)
    known = dict(database.execute("SELECT path, sha256 FROM lifelike").fetchall())
    outcomes = list(convert_many(batch))
    new = [outcome for outcome in outcomes if known.get(str(folder / outcome.row.output)) != outcome.row.output_hash]
    converted = sum(outcome.state is not State.UP_TO_DATE for outcome in outcomes)
    with database:
        database.executemany(
            "INSERT OR REPLACE INTO lifelike VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
            [record(outcome, folder, ids) for outcome in new],
        )
    count, gap = database.execute("SELECT count(*), min(smallest_gap) FROM lifelike WHERE error = ''").fetchone()
    print(f"{len(selected)} tagged {tag!r}: {converted} converted, {len(new)} recorded")
    print(f"{count} in the database, smallest gap {gap:.2f} m")


def record(outcome: Outcome, folder: Path, ids: dict[str, int]) -> tuple[object, ...]:
    """The database's row of an output."""
    row = outcome.row
    return (
        str(folder / row.output),
        ids[row.scenario],
        row.output_hash,
        row.seed,
        row.variant,
        json.dumps(dict(row.profiles)),
        json.dumps(dict(row.inputs)),
        row.package_version,
        row.segment_seconds,
        row.gap_after,
        row.error,
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out/examples"))
