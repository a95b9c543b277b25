"""Truth values in words that the standard does not have: one remark each, wherever and however often they stand."""

from __future__ import annotations

from pathlib import Path

import pytest
from lxml import etree

from xosc_lateral.files.openscenario.element import XmlElement
from xosc_lateral.files.openscenario.read import BOOLEANS, note_spellings
from xosc_lateral.world.scenario.parameters import Scope


def remarks(text: str) -> list[str]:
    root = XmlElement(etree.fromstring(f"<OpenSCENARIO>\n{text}\n</OpenSCENARIO>"), Path("made.xosc"), Scope({}))
    return [f"{note.line}: {note.element}: {note.what}" for note in note_spellings(root)]


@pytest.mark.parametrize("word", ["True", "TRUE", " True "])
def test_a_word_that_means_true_is_remarked_with_its_element_and_line(word: str) -> None:
    (found,) = remarks(f'<A/>\n<RelativeDistanceCondition freespace="{word}"/>')
    assert found.startswith("3: RelativeDistanceCondition")
    assert "freespace='True' is read as true;" in found or "freespace='TRUE' is read as true;" in found


@pytest.mark.parametrize("word", ["true", "1", "false", "0", "False", "no", "$free"])
def test_the_standard_s_own_words_and_what_is_not_true_are_not(word: str) -> None:
    assert remarks(f'<A freespace="{word}"/>') == []


def test_a_word_that_stands_several_times_is_one_remark_at_its_first_place() -> None:
    (found,) = remarks('<A closed="True"/>\n<B><A closed="True"/></B>\n<A closed="True"/>')
    assert found.startswith("2: A")
    assert "(3 times)" in found


def test_each_attribute_and_each_spelling_is_told_apart() -> None:
    assert len(remarks('<A closed="True"/><A closed="TRUE"/><A loop="True"/>')) == 3


def test_other_attributes_may_say_what_they_like() -> None:
    assert "name" not in BOOLEANS
    assert remarks('<A name="True"/>') == []


def test_a_parameter_s_value_counts_if_its_type_is_boolean() -> None:
    content = '<ParameterDeclaration name="x" parameterType="{}" value="True"/>'
    assert len(remarks(content.format("boolean"))) == 1
    assert remarks(content.format("string")) == []


def test_comments_are_no_elements() -> None:
    assert remarks('<!-- closed="True" --><A closed="true"/>') == []
