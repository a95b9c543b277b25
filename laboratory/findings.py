"""Findings about a scenario file: against the schema of its version, and those of the ASAM checker bundle."""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections import Counter
from functools import cache, lru_cache
from pathlib import Path

from lxml import etree

from xosc_lateral.files.xml import parse_xml

XSD = Path(__file__).parents[1] / "tests" / "data" / "xsd"
FILES = {0: "1.0.0", 1: "1.1.1", 2: "1.2.0", 3: "1.3.0"}
"""Schema by minor version."""
_NUMBERS = re.compile(r"-?\d+(\.\d+)?|\b(line|row|column)\b.*")
_CONFIG = """<?xml version="1.0" encoding="UTF-8"?>
<Config><Param name="InputFile" value="{path}"/><CheckerBundle application="xoscBundle">
<Param name="resultFile" value="{result}"/></CheckerBundle></Config>
"""


@cache
def _schema(minor: int) -> etree.XMLSchema:
    return etree.XMLSchema(etree.parse(str(XSD / f"OpenSCENARIO-{FILES[minor]}.xsd")))


def schema_findings(path: Path) -> Counter[str]:
    """Errors by their text, numbers aside; the file is read as the product reads it."""
    root = parse_xml(path.read_bytes(), path)
    header = root.find("{*}FileHeader")
    minor = int(re.sub(r"\D", "", (header.get("revMinor") if header is not None else None) or "0") or 0)
    schema = _schema(min(minor, max(FILES)))
    schema.validate(root)
    return Counter(_NUMBERS.sub("", error.message) for error in schema.error_log)


@lru_cache(maxsize=1)
def checker_findings_of_input(checker: Path, path: Path) -> Counter[str]:
    """As `checker_findings`, kept for the next output of the same input."""
    return checker_findings(checker, path)


def checker_findings(checker: Path, path: Path) -> Counter[str]:
    """Issues by rule and text, numbers aside."""
    with tempfile.TemporaryDirectory() as folder:
        config, result = Path(folder) / "config.xml", Path(folder) / "result.xqar"
        config.write_text(_CONFIG.format(path=path.resolve(), result=result))
        subprocess.run([str(checker), "-c", str(config)], capture_output=True, check=False, cwd=folder, timeout=120)
        if not result.is_file():
            return Counter({"the checker gave no result": 1})
        root = etree.parse(str(result)).getroot()
    return Counter(
        f"{issue.get('ruleUID', '').rpartition(':')[2]}: {_NUMBERS.sub('', issue.get('description') or '')}"
        for issue in root.iter("{*}Issue")
    )
