"""`xosc-lateral profiles`: the library of driver profiles."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import xosc_lateral as xl
from xosc_lateral.cli import VERBS, group_of_verbs
from xosc_lateral.cli.words import Options, Printing, Writing, command, say, say_json, write_stdout
from xosc_lateral.files.output_paths import STDOUT, is_folder, output_file
from xosc_lateral.files.profiles import facts_of, profile_bytes
from xosc_lateral.workflows.profiles import profiles

Name = Annotated[str, typer.Argument(metavar="NAME|PATH", help="Driver profile.", show_default=False)]
Names = Annotated[list[str], typer.Argument(metavar="NAME|PATH...", help="Driver profiles.", show_default=False)]
Page = Annotated[str | None, typer.Option(metavar="PAGE.html", help="Also write a page with figures.")]

# What is said of one option stays together.
# fmt: off
app = group_of_verbs()
group = typer.Typer(help="Driver profiles: those shipped, and your own.", no_args_is_help=True)
app.add_typer(group, name="profiles", short_help=VERBS["profiles"])


@command(group, "list", "List profiles.", "profiles list --tag truck --where country=DE")
def list_(
    *, options: Annotated[Options, xl.list_profiles], reply: Printing,
) -> None:
    """List all profiles with model and source, and name files that cannot be read."""
    reply.say(xl.list_profiles(**options))


@command(group, "show", "Show one profile's card.", "profiles show motorway --report card.html")
def show(
    profile: Name, *, options: Annotated[Options, xl.read_profile], report: Page = None, reply: Writing,
) -> None:
    """A profile's card: what it does, where it comes from, how realistic it is."""
    from xosc_lateral.workflows.conversion.driver_context import NEIGHBOURS
    from xosc_lateral.workflows.conversion.proof import proofs_of
    from xosc_lateral.workflows.profiles.cards import card, card_text

    driver = xl.read_profile(profile, **options)
    if report is not None:
        profiles.write_card(driver, report, force=reply.force)
    if reply.as_json:
        say_json(card(driver))
    elif not reply.quiet:
        beside = [effect for effect in driver.effects if NEIGHBOURS.intersection(effect.columns)]
        say("\n".join([card_text(driver), *(f"  converted  {one}" for one in proofs_of(driver, beside))]))


@command(
    group, "compare", "Compare several profiles.", "profiles compare motorway motorway-vehicle-1 --report compared.html"
)
def compare(
    names: Names, *, options: Annotated[Options, xl.compare_profiles], report: Page = None, reply: Writing,
) -> None:
    """Compare profiles, and show which are not distinguishable."""
    if len(names) < 2:
        raise typer.BadParameter("at least two profiles are needed", param_hint="NAME|PATH...")
    compared = xl.compare_profiles(*names, **options)
    if report is not None:
        compared.write_report(report, force=reply.force)
    reply.say(compared)


@command(
    group, "derive", "Make a driver from stated figures.",
    "profiles derive --preset drowsy -o drowsy.json",
    "profiles derive motorway --sdlp 0.25 --mean 0.1 -o calm.json",
)
def derive(
    *,
    base: Annotated[str, typer.Argument(metavar="[BASE]", help="Profile that gives what is not stated.")] = "motorway",
    output: Annotated[str, typer.Option("--output", "-o", help="File, folder/ or -.")] = "-",
    options: Annotated[Options, profiles.derive_profile],
    reply: Writing,
) -> None:
    """A driver from stated figures, sampled until he has them within 2 %; what can't be had together is refused.

    The base gives what is not stated. Of a population the typical driver is taken.
    """
    if not options["name"] and output.endswith(".json"):
        options["name"] = output_file(output, "", (".json",)).stem
    made = profiles.derive_profile(base, **options)
    if output == STDOUT:
        write_stdout(profile_bytes(made.profile))
        return
    path = xl.write_profile(made.profile, output, force=reply.force)
    reply.say_words(str(made), {"output": str(path), **made.profile.provenance.fit}, err=False)


@command(
    group, "add", "Add a profile to a library.", "profiles add mine.json --library team/ --tag truck --set country=DE"
)
def add(
    profile: Name, *, options: Annotated[Options, profiles.add_profile], reply: Writing,
) -> None:
    """Put a profile into a library's folder, with tags and metadata."""
    path = profiles.add_profile(profile, **options, force=reply.force)
    reply.say_written(path, id=path.stem)


@command(group, "tag", "Change tags and metadata.", "profiles tag mine --library team/ --tag night --remove day")
def tag(
    name: Name, *, options: Annotated[Options, profiles.tag_profile], reply: Printing,
) -> None:
    """Change tags and metadata of a profile of your own, in its file."""
    changed = profiles.tag_profile(name, **options)
    facts = {**facts_of(changed), "tags": list(changed.metadata.tags)}
    reply.say_words(", ".join(f"{key} {value}" for key, value in facts.items() if value), facts, err=False)


@command(group, "remove", "Delete profiles from a library.", "profiles remove mine --library team/")
def remove(names: Names, *, options: Annotated[Options, profiles.remove_profiles], reply: Printing) -> None:
    """Delete the files of profiles of your own, all or none; `profiles uses` says which outputs used them."""
    reply.say_written(profiles.remove_profiles(names, **options))


@command(group, "rename", "Give a profile another id.", "profiles rename mine night-driver --library team/")
def rename(
    name: Name,
    new: Annotated[str, typer.Argument(metavar="NEW", help="Its new id.", show_default=False)],
    *, options: Annotated[Options, profiles.rename_profile], reply: Writing,
) -> None:
    """Change a profile's id, in its file and as the file's name. Its hash changes with it."""
    path = profiles.rename_profile(name, new, **options, force=reply.force)
    reply.say_written(path, id=path.stem)


@command(group, "uses", "Find outputs that used a profile.", "profiles uses mine out/ --library team/")
def uses(
    name: Annotated[str, typer.Argument(metavar="ID", help="Profile, in the library or no longer.")],
    outputs: Annotated[list[Path], typer.Argument(metavar="FOLDER...", help="Of batches, or their manifests.")],
    *, options: Annotated[Options, profiles.find_uses], reply: Printing,
) -> None:
    """Which outputs of batches have offsets of a profile, of which vehicles, and whether it is the same now."""
    reply.say(profiles.find_uses(name, outputs, **options))


@command(
    group, "export", "Copy profiles, to pass them on.", "profiles export motorway motorway-vehicle-1 -o for-a-friend/"
)
def export(
    names: Names, *,
    output: Annotated[str, typer.Option("--output", "-o", help="One profile: file or -; several: folder/.",
        show_default=False)],
    options: Annotated[Options, xl.read_profile], reply: Writing,
) -> None:
    """Write profiles to a file or a folder, to pass them on."""
    chosen = [xl.read_profile(name, **options) for name in names]
    if len(chosen) > 1 and not is_folder(output):
        raise typer.BadParameter("several profiles go to a folder: -o FOLDER/", param_hint="-o")
    if output == STDOUT:
        write_stdout(profile_bytes(chosen[0]))
        return
    written = [xl.write_profile(profile, output, force=reply.force) for profile in chosen]
    reply.say_written(written)


@command(group, "check", "Check a library for broken files.", "profiles check --library team/")
def check(*, options: Annotated[Options, xl.read_profile], reply: Printing) -> None:
    """Read every profile of the library; exit with 1 if one cannot be read or its id is not its file's name."""
    entries = xl.list_profiles(**options)
    wrong = [entry.problem for entry in entries if entry.problem]
    if reply.as_json:
        problems = [{"path": str(entry.path), "problem": entry.problem} for entry in entries if entry.problem]
        say_json({"checked": len(entries), "problems": problems})
    else:
        for problem in wrong:
            say(problem)
        if not reply.quiet:
            say(f"{len(entries)} files, {len(wrong)} with problems")
    if wrong:
        raise typer.Exit(1)
