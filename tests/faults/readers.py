"""Every reader, with a small good file to begin from and the use that is made of what it reads.

A use returns normally only when what came out makes sense; it raises `NonsenseError` when nonsense was let in.
"""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Iterable
from pathlib import Path
from unittest import mock

import numpy as np
import pandas as pd

from examples.driver_simulator import simulate_drive
from tests.faults.reader import NonsenseError, Reader, sane
from tests.faults.recordings import RECORDINGS
from tests.kit.profiles import REFINED, simulated_profile
from tests.kit.scenario_files import ROAD, declarations, entity, parameter, scenario_text, vehicle
from xosc_lateral.base.errors import DriverProfileError, FormatError
from xosc_lateral.base.limits import DISTANCES, context_range
from xosc_lateral.drivers.drives.drive import all_runs
from xosc_lateral.drivers.model.sampled_offsets import sample_free
from xosc_lateral.drivers.model.stream import OffsetStream
from xosc_lateral.extras.loop.columns import Role
from xosc_lateral.files.mapping import read_mapping
from xosc_lateral.files.openscenario.distribution import read_distribution
from xosc_lateral.files.openscenario.provenance import facts_in, without_provenance
from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.files.profiles import list_profiles, profile_bytes, read_profile
from xosc_lateral.files.tables import read_context
from xosc_lateral.workflows.batch.jobs import plan_batch
from xosc_lateral.workflows.batch.journal import Journal
from xosc_lateral.workflows.batch.manifest import MANIFEST, ManifestRow, read_manifest, write_manifest
from xosc_lateral.workflows.batch.verify import reproduce, verify
from xosc_lateral.workflows.conversion.convert import convert_scenario
from xosc_lateral.workflows.conversion.settings import ConvertSettings, OutputMode
from xosc_lateral.workflows.profiles.cards import card_text
from xosc_lateral.workflows.result import given_drives, given_profile, naming


# ---- tables ----------------------------------------------------------------------------------------------------------
def _drive_files(folder: Path) -> Iterable[Path]:
    table = simulate_drive(40.0, 3).table.iloc[::2].round(4)
    for name, write in (("d.csv", table.to_csv), ("d.csv.gz", table.to_csv)):
        write(folder / name, index=False)
        yield folder / name
    table.to_parquet(folder / "d.parquet")
    yield folder / "d.parquet"


def _use_drives(path: Path) -> None:
    given = given_drives([path])
    with naming(given):
        runs = all_runs(given.drives)
    for run in runs:
        sane(run.offset, -12.0, 12.0, "offset")
        sane(run.lane_width, 0.5, 13.0, "lane width")
        for name, values in run.context.items():
            believed = context_range(name)
            known = values[~np.isnan(values) & ~(np.isposinf(values) & (name in DISTANCES))]  # nobody within reach
            sane(known, believed.low, believed.high, name)


def _context_files(folder: Path) -> Iterable[Path]:
    rows = ["time,wind_speed,rain,curvature", *(f"{k / 5:.1f},{3 + k % 4},{k % 2},0.00{k % 9}" for k in range(50))]
    (folder / "c.csv").write_text("\n".join(rows) + "\n")
    yield folder / "c.csv"
    pd.read_csv(folder / "c.csv").to_parquet(folder / "c.parquet")
    yield folder / "c.parquet"


def _use_context(path: Path) -> None:
    for name, (time, values) in read_context(path).items():
        believed = context_range(name)
        sane(time, -1e10, 1e10, "time")
        sane(values, believed.low, believed.high, name)


def _request_files(folder: Path) -> Iterable[Path]:
    _scenario(folder)
    rows = [
        "scenario,profile,profile:Ego,seed,variants,parameter:Twice,parameters,user:tag",
        'a.xosc,motorway,motorway-vehicle-1,7,2,31.5,"{""Speed"": ""20""}",x',
        "a.xosc,,,1,,,,",
    ]
    (folder / "r.csv").write_text("\n".join(rows) + "\n")
    yield folder / "r.csv"
    pd.read_csv(folder / "r.csv").to_parquet(folder / "r.parquet")
    yield folder / "r.parquet"


def _use_requests(path: Path) -> None:
    if len(plan_batch([path], path.parent / "out", ConvertSettings())) > 1_000_000:
        raise NonsenseError("a million jobs")


# ---- profiles --------------------------------------------------------------------------------------------------------
def _profile_files(folder: Path) -> Iterable[Path]:
    for number, source in enumerate([*list_profiles()[:3], None]):
        path = folder / f"p{number}.json"
        path.write_bytes(profile_bytes(simulated_profile()) if source is None else source.read_bytes())
        yield path


def _use_profile(path: Path) -> None:
    profile = read_profile(path)
    for sampled in sample_free(profile, 60.0, 5):
        sane(sampled.offset, -15.0, 15.0, "offset")


def _driver_files(folder: Path) -> Iterable[Path]:
    _scenario(folder)
    return list(_profile_files(folder))


def _use_driver(path: Path) -> None:
    """What sampling alone does not reach: words about the profile, context and neighbours of a scenario."""
    settings = ConvertSettings(profile=str(path), time_limit=3.0, step=0.05, ego=frozenset())
    made = convert_scenario(path.with_name("a.xosc"), path.with_name("out.xosc"), settings)
    json.dumps(made.to_dict(), allow_nan=False)
    card_text(given_profile(path))


STREAMED = {"motorway": "motorway", "refined": REFINED}
"""A state's file -> the profile that it is of."""


def _stream_files(folder: Path) -> Iterable[Path]:
    for name, profile in STREAMED.items():
        stream = OffsetStream(read_profile(profile), 3)
        for k in range(400):
            stream.step({"speed": 30.0 + 0.01 * k})
        (folder / f"{name}.json").write_text(json.dumps(stream.to_dict()))
        yield folder / f"{name}.json"


def _use_stream(path: Path) -> None:
    try:
        state = json.loads(path.read_bytes())
    except (ValueError, RecursionError):
        return  # a caller's own file, and its reader's error
    try:
        stream = OffsetStream.from_dict(read_profile(STREAMED[path.stem]), state)
    except DriverProfileError as error:
        raise DriverProfileError(f"{path}: {error}") from error
    sane([stream.step({"speed": 30.0}) for _ in range(100)], -15.0, 15.0, "offset")


# ---- scenarios -------------------------------------------------------------------------------------------------------
def _scenario(folder: Path) -> Path:
    shutil.copy(ROAD, folder / "road.xodr")
    declared = declarations(parameter("Speed", "30"), parameter("Twice", "${$Speed * 2}"))
    text = scenario_text(parameters=declared, entities=entity("Ego", vehicle(speed="$Twice")))
    (folder / "a.xosc").write_text(text.replace('value="33"', 'value="$Speed"'))
    return folder / "a.xosc"


def _scenario_files(folder: Path) -> Iterable[Path]:
    return [_scenario(folder), folder / "road.xodr"]


def _use_scenario(path: Path) -> None:
    settings = ConvertSettings(profile="motorway", time_limit=5.0, step=0.05)
    convert_scenario(path.with_name("a.xosc"), path.with_name("out.xosc"), settings)
    read_scenario(path.with_name("out.xosc"))


def _distribution_files(folder: Path) -> Iterable[Path]:
    _scenario(folder)
    bounds = '<Range lowerLimit="20" upperLimit="30"/>'
    parts = {
        "Deterministic": '<DeterministicSingleParameterDistribution parameterName="Speed">'
        f'<DistributionRange stepWidth="2.5">{bounds}</DistributionRange></DeterministicSingleParameterDistribution>',
        'Stochastic numberOfTestRuns="9" randomSeed="3"': '<StochasticDistribution parameterName="Speed">'
        f'<NormalDistribution expectedValue="25" variance="4">{bounds}</NormalDistribution></StochasticDistribution>',
    }
    one = '<ParameterValueSet><ParameterAssignment parameterRef="Speed" value="{}"/></ParameterValueSet>'
    sets = f"<ValueSetDistribution>{one.format(20)}{one.format(30)}</ValueSetDistribution>"
    many = f"<DeterministicMultiParameterDistribution>{sets}</DeterministicMultiParameterDistribution>"
    for name, content in {**parts, "Deterministic ": 9 * many}.items():
        path = folder / f"{name[:3]}{len(name)}.xosc"
        path.write_text(
            '<?xml version="1.0"?><OpenSCENARIO><FileHeader revMajor="1" revMinor="1" date="2024-01-01T00:00:00" '
            'author="a" description="d"/><ParameterValueDistribution><ScenarioFile filepath="a.xosc"/>'
            f"<{name}>{content}</{name.split()[0]}></ParameterValueDistribution></OpenSCENARIO>"
        )
        yield path


def _use_distribution(path: Path) -> None:
    count = sum(1 for _ in read_distribution(path).parameter_sets(1))
    if count > 1_000_000:
        raise NonsenseError(f"{count} parameter sets")


# ---- outputs and configuration ---------------------------------------------------------------------------------------
def _output_files(folder: Path) -> Iterable[Path]:
    for number, mode in enumerate((OutputMode.AUTO, OutputMode.LANE_OFFSET)):
        settings = ConvertSettings(profile="motorway", time_limit=3.0, step=0.05, mode=mode)
        convert_scenario(_scenario(folder), folder / f"o{number}.xosc", settings)
        shutil.copy(folder / f"o{number}.xosc", folder / f"o{number}.good")
        yield folder / f"o{number}.xosc"


def _use_output(path: Path) -> None:
    (found,) = verify(path).checked
    if not found.problems:
        good, now = (file.read_bytes() for file in (path.with_suffix(".good"), path))
        if without_provenance(good) != without_provenance(now):
            raise NonsenseError("called good")
        return
    try:
        (again,) = reproduce(path, path.with_name("again.xosc")).checked
    except FormatError as error:  # it names the scenario that the provenance states
        raise FormatError(str(error), path=path) from error
    if not again.problems and facts_in(path.read_bytes()) is None:
        raise NonsenseError("made again from nothing")


def _configuration_files(folder: Path) -> Iterable[Path]:
    text = 'library = ["team"]\nego = ["Ego", "Other"]\nneighbours = "profile"  # or none\n'
    (folder / "config.toml").write_text(text)
    (folder / "team").mkdir()
    yield folder / "config.toml"


def _use_configuration(path: Path) -> None:
    with mock.patch("xosc_lateral.files.configuration.configuration_file", return_value=path):
        ConvertSettings.of()
        list_profiles()


def _mapping_files(folder: Path) -> Iterable[Path]:
    lines = ['separator = ";"', 'decimal = ","', "[columns]", 'time = "t"', 'speed = "v:km/h"', "[values.rain]"]
    lines += ['"on" = 1.0', '"off" = 0.0', "[roles]", 'rain = "weather"']
    (folder / "m.toml").write_text("\n".join(lines) + "\n")
    yield folder / "m.toml"


def _use_mapping(path: Path) -> None:
    mapping = read_mapping(path)
    sane([source.factor for source in mapping.columns.values()], -1e9, 1e9, "factor")
    if mapping.layout.separator == mapping.decimal or not set(mapping.roles.values()) <= {*map(str, Role)}:
        raise NonsenseError("a mapping that no table is read by")


# ---- what a batch leaves ---------------------------------------------------------------------------------------------
def manifest_row(number: int) -> ManifestRow:
    return ManifestRow(f"{number}.xosc", "a.xosc", "ab" * 32, number, 1, "auto", {"p": "1"}, "cd" * 32, "0.1.0")


def _state_files(folder: Path) -> Iterable[Path]:
    write_manifest((manifest_row(number) for number in range(20)), folder / MANIFEST)
    lines = [json.dumps({"row": manifest_row(number).to_dict(), "seconds": 0.5}) for number in range(20)]
    (folder / "journal.jsonl").write_text("\n".join(lines) + "\n")
    return [folder / MANIFEST, folder / "journal.jsonl"]


def _use_state(path: Path) -> None:
    said: list[str] = []
    with Journal(path.parent, path.with_name("journal.jsonl"), said.append) as journal:
        for output in journal:
            if not math.isfinite(journal.timing(output).seconds) or not isinstance(journal.row(output), ManifestRow):
                raise NonsenseError(output)
        journal.finish()
    for row in read_manifest(path.with_name(MANIFEST)):
        json.dumps(row.to_dict(), allow_nan=False)


READERS = (
    Reader("drives", _drive_files, _use_drives),
    Reader("context", _context_files, _use_context),
    Reader("requests", _request_files, _use_requests),
    *RECORDINGS,
    Reader("profile", _profile_files, _use_profile),
    Reader("driver", _driver_files, _use_driver, share=0.2),
    Reader("stream", _stream_files, _use_stream),
    Reader("scenario", _scenario_files, _use_scenario),
    Reader("distribution", _distribution_files, _use_distribution),
    Reader("output", _output_files, _use_output, share=0.5),
    Reader("mapping", _mapping_files, _use_mapping),
    Reader("configuration", _configuration_files, _use_configuration),
    Reader("state", _state_files, _use_state),
)
