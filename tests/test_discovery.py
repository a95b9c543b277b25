"""What a package's files define is found in the order of their names, whatever order a folder lists them in."""

from __future__ import annotations

import sys
from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

import xosc_lateral.base.plugins as discovery
from xosc_lateral.base.plugins import defined_in
from xosc_lateral.drivers.model import effects
from xosc_lateral.drivers.model.effects import ColumnEffect, Effect, HiddenEffect
from xosc_lateral.extras.loop.selection import TERMS

NAME = "made_for_discovery"


class Thing(ABC):
    @abstractmethod
    def size(self) -> float: ...


@pytest.fixture
def package(tmp_path: Path) -> Iterator[ModuleType]:
    files = {
        "zebra": "class Zebra(Thing):\n def size(self): return 1.0\nclass Ant(Thing):\n def size(self): return 2.0",
        "apple": "from made_for_discovery.zebra import Zebra\nclass Apple(Zebra): pass\nclass _Core(Zebra): pass",
        "half": "class Half(Thing): pass\nclass Other: pass\nkinds = (Half, Other)",
    }
    for name, text in files.items():
        (tmp_path / f"{name}.py").write_text(f"from tests.test_discovery import Thing\n{text}\n")
    made = ModuleType(NAME)
    made.__path__ = [str(tmp_path)]
    sys.modules[NAME] = made
    yield made
    for name in [name for name in sys.modules if name.partition(".")[0] == NAME]:
        del sys.modules[name]


@pytest.mark.parametrize("turned", [False, True])
def test_files_by_name_classes_as_written(package: ModuleType, monkeypatch: pytest.MonkeyPatch, turned: bool) -> None:
    """Private ones, abstract ones, others' and those that a file only imports are not its own."""
    listed = list(discovery.iter_modules(package.__path__))
    monkeypatch.setattr(discovery, "iter_modules", lambda path: listed[::-1] if turned else listed)
    assert [one.__name__ for one in defined_in(NAME, thing())] == ["Apple", "Zebra", "Ant"]


def thing() -> type:
    """As the package's files import it: this module may be known under another name here."""
    from tests import test_discovery

    return test_discovery.Thing


def test_a_file_that_cannot_be_imported_is_no_file_less(package: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "broken.py").write_text("import no_such_package_anywhere\n")
    with pytest.raises(ModuleNotFoundError, match="no_such_package_anywhere"):
        defined_in(NAME, Thing)


def test_every_file_of_effects_that_names_none_holds_what_effects_are_made_from() -> None:
    homes = {kind.__module__.rpartition(".")[2] for kind in effects.EFFECTS}
    written = {path.stem for folder in effects.__path__ for path in Path(folder).glob("*.py")} - {"__init__"}
    assert written - homes == {"base", "ends", "response"}
    assert not {Effect, ColumnEffect, HiddenEffect} & set(effects.EFFECTS)


def test_terms_of_one_component_weigh_the_same() -> None:
    for kind in TERMS:
        assert {one.weight for one in TERMS if one.component == kind.component} == {kind.weight}
