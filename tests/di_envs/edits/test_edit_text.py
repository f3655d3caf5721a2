"""Edits have one text form, which can be read back."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from di_envs.edits.text import EditError, EditText, read_edit, read_edits

WORDS = st.from_regex(r"[a-z_][a-z0-9_]{0,8}", fullmatch=True)
VALUES = st.from_regex(r"[A-Za-z0-9_.+-]{1,8}", fullmatch=True)
EDITS = st.builds(
    EditText,
    verb=WORDS,
    target=st.lists(WORDS, min_size=1, max_size=2).map("+".join),
    value=st.none() | VALUES,
    settings=st.dictionaries(WORDS, VALUES, max_size=3),
    when=st.just("") | st.sampled_from(("t>5", "t=42.5", "junction<20m")),
)


@given(edit=EDITS)
def test_what_is_written_is_read_back(edit):
    assert read_edit(str(edit)) == edit


@given(edits=st.lists(EDITS, max_size=4))
def test_edits_are_joined_by_semicolons(edits):
    assert read_edits("; ".join(map(str, edits))) == tuple(edits)


def test_the_parts_of_an_edit_have_names():
    edit = read_edit("recolour:lights+signs=red,p=0.5@t>5")
    assert (edit.verb, edit.target, edit.value) == ("recolour", "lights+signs", "red")
    assert dict(edit.settings) == {"p": "0.5"}
    assert edit.when == "t>5"
    assert edit.number("p") == 0.5
    assert edit.number("sigma", 2.0) == 2.0


@pytest.mark.parametrize(
    "text",
    ["remove", "remove:", ":actor", "remove:actor=", "move:actor=1,ahead", "a:b=1=2", "a b:c"],
)
def test_what_has_not_the_form_is_refused_with_an_example(text):
    with pytest.raises(EditError, match=r"expected verb:target=value.*remove:actor=17"):
        read_edit(text)


def test_a_setting_given_twice_is_refused():
    with pytest.raises(EditError, match="gives ahead twice"):
        read_edit("move:actor=1,ahead=2,ahead=3")


def test_a_number_that_is_none_is_refused():
    with pytest.raises(EditError, match="ahead is a number, not 'far'"):
        read_edit("move:actor=1,ahead=far").number("ahead")
    with pytest.raises(EditError, match="ahead is a number, not 'nan'"):
        read_edit("move:actor=1,ahead=nan").number("ahead")
