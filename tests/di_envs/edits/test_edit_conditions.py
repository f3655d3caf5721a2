"""When an edit holds: conditions read, written, and asked of a moment."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from di_envs.edits.conditions import UNITS, Condition, Term
from di_envs.edits.text import EditError

TERMS = st.builds(
    Term,
    name=st.sampled_from(sorted(UNITS)),
    sign=st.sampled_from(("<", ">", "<=", ">=")),
    number=st.floats(-1e6, 1e6).map(lambda number: number + 0.0),
)
CONDITIONS = st.builds(Condition, terms=st.lists(TERMS, max_size=3).map(tuple))


@given(condition=CONDITIONS)
def test_what_is_written_is_read_back_as_the_same_condition(condition):
    assert Condition.of(str(condition)) == condition


@pytest.mark.parametrize("text", ["t>5", "t>5&t<9", "junction<20m", "route>=50%", "t<=0.25"])
def test_the_usual_texts_stay_as_they_are(text):
    assert str(Condition.of(text)) == text


def test_a_window_holds_between_its_ends():
    window = Condition.of("t>5&t<9")
    assert [bool(window.holds({"t": t})) for t in (5.0, 5.1, 8.9, 9.0)] == [
        False, True, True, False,
    ]  # fmt: skip
    assert Condition().holds({}) is True


def test_many_worlds_are_asked_at_once():
    near = Condition.of("junction<20m&t>1s")
    values = {"junction": np.array([0.0, 19.9, 20.0, np.inf]), "t": np.array([2.0, 0.5, 2.0, 2.0])}
    assert near.holds(values).tolist() == [True, False, False, False]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("tt>5", "did you mean 't'"),
        ("t=5", "such as @t>5"),
        ("t>five", "such as @t>5"),
        ("t>5m", "compared with a number of s"),
        ("junction<20%", "compared with a number of m"),
        ("t>inf", "compared with a number of s"),
    ],
)
def test_what_is_no_condition_is_refused_with_an_example(text, message):
    with pytest.raises(EditError, match=message):
        Condition.of(text)


def test_what_nobody_knows_there_is_refused():
    with pytest.raises(EditError, match=r"asks for junction; inside a policy only t is known"):
        Condition.of("t>5&junction<9").refuse_names_but(("t",), "inside a policy")
