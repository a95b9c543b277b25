"""A driver as C source: templates that hold the model, in `extras/live/c`, and the profile's numbers as tables."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from textwrap import wrap

from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.names import in_c_comment, in_c_identifier
from xosc_lateral.base.segment import CONTEXT_UNITS
from xosc_lateral.base.version import __version__
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.extras.live.c_numbers import inputs_of, numbers_of
from xosc_lateral.files.atomic import together, write_atomically
from xosc_lateral.files.output_paths import claim, output_folder, template_mark


def identifier(profile: DriverProfile) -> str:
    """What names in C begin with."""
    return "driver_" + in_c_identifier(profile.name)


def export_c(profile: DriverProfile, folder: str | Path, *, force: bool = False) -> list[Path]:
    """Write a driver as C99 into a folder: header, source, the profile's numbers, a CMake file and an example loop.

    Raises `DriverProfileError` if the profile has an effect or a core model of a plug-in; `FormatError` if a file is
    there that is not to be replaced (`force`).
    """
    texts = c_sources(profile) | {name: filled(name, profile) for name in ("CMakeLists.txt", "example.c")}
    written = [output_folder(folder) / name for name in texts]
    claim(written, force=force)
    with together():
        for path, text in zip(written, texts.values(), strict=True):
            mark = template_mark(text, "# ", "") if path.suffix == ".txt" else template_mark(text, "/* ", " */")
            write_atomically(path, text + mark)
    return written


def _fields(profile: DriverProfile) -> dict[str, str]:
    """What columns are called in C: other names than the usual begin with x_, and so are no words of C.

    Raises `DriverProfileError` where two have the same.
    """
    columns: dict[str, str] = {}
    for column in inputs_of(profile):
        field = column if column in CONTEXT_UNITS else "x_" + in_c_identifier(column)
        if field in columns:
            raise DriverProfileError(f"profile {profile.name}: {columns[field]!r} and {column!r} are both {field} in C")
        columns[field] = column
    return {column: field for field, column in columns.items()}


def c_sources(profile: DriverProfile) -> dict[str, str]:
    """Header, source and numbers of a driver, by file name."""
    name, fields = identifier(profile), _fields(profile)
    (sizes, numbers), what = numbers_of(profile), _about(profile)
    words = {
        "WHAT": what,
        "SIZES": "\n".join(f"#define DRIVER_{key} {value}" for key, value in sizes.items()),
        "MEMORY": str(_memory(sizes)),
        "PREVIEW": repr(round(sizes["LOOKS"] * profile.model.step, 9)),
        "INPUTS": "\n".join(
            f"    double {field}; /* [{CONTEXT_UNITS.get(column, 'as in the profile')}] */"
            for column, field in fields.items()
        ),
        "KNOWN": "\n".join(
            f"#define DRIVER_KNOWS_{field} UINT64_C({1 << k})" for k, field in enumerate(fields.values())
        ),
        "ALL_KNOWN": str((1 << len(fields)) - 1),
        "MOVEMENT_FAULT": str(len(profile.effects) + 1),
    }
    return {
        f"{name}.h": filled("driver.h", profile, words),
        f"{name}.c": filled("driver.c", profile),
        f"{name}_profile.h": _named("\n".join([f"/* {what}\n */", *numbers, ""]), profile),
    }


def _about(profile: DriverProfile) -> str:
    """The driver's name, and the licences that its profile states, as lines of a comment."""
    licences = {"profile": profile.metadata.licence, "drives that it was fitted to": profile.provenance.licence}
    lines = [f"Driver {profile.name} of xosc-lateral {__version__}, in C99."]
    for what, licence in licences.items():
        lines += wrap(f"Licence of the {what}: {licence}", 115) if licence else []
    return in_c_comment("\n * ".join(lines))


def filled(template: str, profile: DriverProfile, words: Mapping[str, str] | None = None) -> str:
    """A template with words in place of those between @, and names of the profile's own."""
    text = files("xosc_lateral.extras.live").joinpath("c", template).read_text(encoding="utf-8")
    known = words or {}  # in one go: what a profile says is no template
    return _named(re.sub(r"@([A-Z_]+)@", lambda match: known.get(match[1], match[0]), text), profile)


def _named(text: str, profile: DriverProfile) -> str:
    return re.sub(r"\bDRIVER(?=_|\.h|\b)", identifier(profile), text)


def _memory(sizes: Mapping[str, int]) -> int:
    """Bytes of `DRIVER_state`, whose fields all have eight; the C compiler checks it."""
    history = sizes["ROWS"] * (sizes["COMPONENTS"] + 1)
    per_size = sum(sizes[name] for name in ("STEPS", "EVERY", "TAPS", "COMPONENTS", "LAGS")) + 10 * sizes["HIDDEN"]
    return 8 * (108 + history + per_size)
