"""`xosc-lateral fit`."""

from __future__ import annotations

from typing import Annotated

import typer

from xosc_lateral.cli import VERBS, group_of_verbs
from xosc_lateral.cli.words import Library, Mapped, Tables, Written, command, warn, write_stdout

app = group_of_verbs()


def _known_model(text: str) -> str:
    from xosc_lateral.base.errors import DriverProfileError
    from xosc_lateral.drivers.model.core.registry import model_named

    try:
        return model_named(text).model.kind
    except DriverProfileError as error:
        raise typer.BadParameter(str(error)) from error


@command(
    app, "fit", VERBS["fit"],
    "fit drives.csv.gz -o mine.json", "fit monday.csv tuesday.csv -o profiles/ --name anna --map speed=v_kmh:km/h",
    "fit smoothed.csv -o mine.json --valid-below 0.3",
)  # fmt: skip
def fit(
    tables: Tables,
    *,
    output: Annotated[
        str, typer.Option("--output", "-o", metavar="PROFILE.json", help="Profile to write: file, folder/, or -.")
    ],
    model: Annotated[
        str,
        typer.Option(
            parser=_known_model,
            metavar="[two-level|autoregressive|PLUG-IN]",
            help="two-level: Neis and Beyerer; autoregressive: the default; best: the same.",
        ),
    ] = "autoregressive",
    corrected: Annotated[
        bool, typer.Option("--corrected", help="Two-level model: freed of its fit's bias, by simulation.")
    ] = False,
    mapped: Mapped,
    name: Annotated[str, typer.Option(help="Name of the profile; default: the file's name.")] = "",
    source: Annotated[str, typer.Option(help="Description of the drives, for the provenance.")] = "",
    licence: Annotated[str, typer.Option(help="Licence of the drives, for the provenance.")] = "",
    sensor_noise: Annotated[
        float | None,
        typer.Option(
            help="Standard deviation of the sensor's error, rounding included [m]; default: estimated.", min=1e-4, max=2
        ),
    ] = None,
    left_hand: Annotated[bool, typer.Option("--left-hand", help="Drives of left-hand traffic.")] = False,
    neighbours: Annotated[
        bool | None,
        typer.Option(
            "--neighbours/--no-neighbours",
            help="Whether to fit how drivers keep away from vehicles beside them; default: where they are known.",
        ),
    ] = None,
    valid_below: Annotated[
        float | None,
        typer.Option(
            metavar="HZ",
            min=0.02,
            max=2.5,
            help="Frequency up to which tables show driving that do not state it: smoothed tracks. [Hz]",
        ),
    ] = None,
    prior: Annotated[
        str,
        typer.Option(
            metavar="PROFILE|none",
            help="Whose fast movement it has above the band that the tables show; rural: only where they state one.",
        ),
    ] = "rural",
    library: Library = None,
    said: Written,
) -> None:
    """Fit a driver profile to measured drives."""
    from xosc_lateral import fit, write_profile
    from xosc_lateral.drivers.model.drivability import fit_warnings
    from xosc_lateral.files.output_paths import STDOUT, claim, output_file
    from xosc_lateral.files.profiles import describe_profile, profile_bytes, profile_record
    from xosc_lateral.workflows.profiles.fit import band_warnings
    from xosc_lateral.workflows.profiles.profiles import PROFILE_SUFFIXES

    usual = name or tables[0].name.split(".")[0]
    written = None if output == STDOUT else output_file(output, f"{usual}.json", PROFILE_SUFFIXES)
    claim([written], tables, force=said.force)
    profile = fit(
        tables,
        name=name or (usual if written is None else written.stem),
        model=model,
        corrected=corrected,
        columns=mapped.mapping(),
        source=source,
        licence=licence,
        sensor_noise=sensor_noise,
        left_hand=left_hand,
        neighbours=neighbours,
        valid_below=valid_below,
        prior=None if prior == "none" else prior,
        library=library or (),
    )
    if written is None:
        write_stdout(profile_bytes(profile))
    else:
        write_profile(profile, written, force=said.force)
    facts = None if written is None else {"output": str(written), **profile_record(profile)}
    said.say_words(describe_profile(profile), facts)
    warn([*fit_warnings(profile, sensor_noise), *band_warnings(profile)])
