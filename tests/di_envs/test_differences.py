"""The one comparison: what differs between two sets of named values, and how it is said."""

from __future__ import annotations

from di_envs.differences import differences


def said(first, second, names=None):
    return [difference.was_is for difference in differences(first, second, names)]


def test_equal_values_do_not_differ_and_a_list_is_the_tuple_that_was_written():
    assert differences({}, {}) == []
    assert differences({"seeds": (0, 1)}, {"seeds": [0, 1]}) == []
    assert differences({"a": {"b": ({"c": (1,)},)}}, {"a": {"b": [{"c": [1]}]}}) == []


def test_what_was_and_is_reads_like_a_sentence():
    assert said({"seeds": (0, 1)}, {"seeds": (0,)}) == ["seeds was 0, 1, is 0"]
    assert said({"edits": ()}, {"edits": ("drop:map",)}) == ["edits was none, is drop:map"]
    assert said({"a": 1}, {}) == ["a was 1, is not given"]
    assert said({}, {"a": 1}) == ["a was not given, is 1"]


def test_two_that_are_here_are_told_apart():
    (numpy,) = differences({"numpy": "2.4.6"}, {"numpy": "2.3.1"})
    assert numpy.is_not == "numpy 2.4.6, not 2.3.1"
    (torch,) = differences({}, {"torch": "2.13.0"})
    assert torch.is_not == "torch absent, not 2.13.0"


def test_of_values_within_values_the_innermost_is_named():
    assert said({"options": {"traffic": 2}}, {"options": {"traffic": 3}}) == [
        "options 'traffic' was 2, is 3"
    ]
    assert said({"o": {"p": {"q": 1, "r": 2}}}, {"o": {"p": {"q": 1}}}) == [
        "o 'p' 'r' was 2, is not given"
    ]


def test_a_value_can_be_called_otherwise_than_its_field():
    assert said({"cpu": "a"}, {"cpu": "b"}, {"cpu": "the CPU"}) == ["the CPU was a, is b"]
