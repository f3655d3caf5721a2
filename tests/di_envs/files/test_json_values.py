"""Typed JSON: what is read is what was written, and what is wrong is said in one line."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from di_envs.files.json_text import (
    DEEPEST,
    ForeignError,
    JsonError,
    by_lines,
    compact,
    indented,
    one_line,
    parsed,
    read_document,
    read_json,
)
from di_envs.files.json_values import from_json, to_json


class Kind(IntEnum):
    RED_LIGHT = 0
    STOP_SIGN = 1


class Colour(Enum):
    RED = "#f00"


@dataclass(frozen=True, kw_only=True)
class Part:
    share: float
    kind: Kind = Kind.RED_LIGHT

    def __post_init__(self) -> None:
        if self.share > 1.0:
            raise ValueError(f"a share is at most 1, not {self.share}")


@dataclass(frozen=True, kw_only=True)
class Whole:
    name: str
    count: int = 0
    ready: bool = False
    end_s: float | None = None
    parts: tuple[Part, ...] = ()
    rows: tuple[tuple[float, str], ...] = ()
    by_name: Mapping[str, Part] = field(default_factory=dict)
    word: Literal["all", "stem"] | tuple[int, ...] = "all"
    colour: Colour | None = None
    options: Mapping[str, Any] = field(default_factory=dict)


numbers = st.floats(allow_nan=False, allow_infinity=False, max_value=1.0)
parts = st.builds(Part, share=numbers, kind=st.sampled_from(Kind))
names = st.text(st.characters(codec="utf-8"))
plain = st.none() | st.booleans() | st.integers(-9, 9) | numbers | names
wholes = st.builds(
    Whole,
    name=names,
    count=st.integers(-(2**64) + 1, 2**64 - 1),
    ready=st.booleans(),
    end_s=st.none() | numbers,
    parts=st.lists(parts).map(tuple),
    rows=st.lists(st.tuples(numbers, names)).map(tuple),
    by_name=st.dictionaries(names, parts),
    word=st.sampled_from(["all", "stem"]) | st.lists(st.integers(0, 9)).map(tuple),
    colour=st.none() | st.just(Colour.RED),
    options=st.dictionaries(names, plain | st.lists(plain)),
)


@given(wholes)
def test_what_is_written_is_read_as_it_was_and_written_again_byte_for_byte(whole):
    for write in (indented, compact, one_line):
        text = write(to_json(whole))
        again = from_json(Whole, parsed(text, "file"), "file", complete=True)
        assert again == whole
        assert write(to_json(again)) == text


def test_a_number_stays_as_it_is_spelled():
    text = '{"name":"a","end_s":7,"parts":[{"share":1e-07,"kind":"stop_sign"}]}'
    whole = from_json(Whole, parsed(text, "file"), "file")
    assert (type(whole.end_s), whole.parts[0].kind) == (int, Kind.STOP_SIGN)
    again = to_json(whole)
    assert compact({name: again[name] for name in ("name", "end_s", "parts")}) == text


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"name": 3}, "f.json: name: expected a text, got 3"),
        ({"name": None}, "f.json: name: expected a text, got null"),
        ({"name": "a", "count": True}, "f.json: count: expected a whole number, got true"),
        ({"name": "a", "count": 1.0}, "f.json: count: expected a whole number, got 1.0"),
        ({"name": "a", "ready": 1}, "f.json: ready: expected true or false, got 1"),
        ({"name": "a", "end_s": "1"}, "f.json: end_s: expected a number or null, got '1'"),
        ({"name": "a", "end_s": float("nan")}, "f.json: end_s: expected a number or null, got nan"),
        (
            {"name": "a", "parts": [{"share": 1}, {"share": "b"}]},
            "f.json: parts[1].share: expected a number, got 'b'",
        ),
        (
            {"name": "a", "parts": [{"share": 1, "kind": "redlight"}]},
            "f.json: parts[0].kind: unknown 'redlight'; did you mean 'red_light'? "
            "known: red_light, stop_sign",
        ),
        ({"name": "a", "parts": [{"share": 2}]}, "f.json: parts[0]: a share is at most 1, not 2"),
        ({"name": "a", "parts": "ab"}, "f.json: parts: expected a list, got 'ab'"),
        (
            {"name": "a", "parts": {}},
            "f.json: parts: expected a list, got an object with nothing in it",
        ),
        ({"name": "a", "rows": [[1.0]]}, "f.json: rows[0]: expected a list of 2, got a list of 1"),
        ({"name": "a", "rows": [[1.0, 2]]}, "f.json: rows[0][1]: expected a text, got 2"),
        ({"name": "a", "by_name": []}, "f.json: by_name: expected an object, got an empty list"),
        (
            {"name": "a", "by_name": {"x": {"share": None}}},
            "f.json: by_name.x.share: expected a number, got null",
        ),
        (
            {"name": "a", "word": "stm"},
            "f.json: word: unknown 'stm'; did you mean 'stem'? known: all, stem",
        ),
        (
            {"name": "a", "word": 7},
            "f.json: word: expected 'all' or 'stem' or a list, got 7",
        ),
        ({"count": 1}, "f.json: name: is missing; there is 'count'"),
        (
            {"name": "a", "parts": [{}]},
            "f.json: parts[0].share: is missing; there is nothing in it",
        ),
        (
            {"name": "a", "parts": [{"share": 1, "knid": 0}]},
            "f.json: parts[0]: unknown field 'knid'; did you mean 'kind'? known: share, kind",
        ),
        ([1, 2], "f.json: expected an object, got a list of 2"),
        ({"name": ["x" * 1000]}, "f.json: name: expected a text, got a list of 1"),
    ],
)
def test_an_error_names_file_and_field_and_what_was_expected_and_came(values, said):
    with pytest.raises(JsonError) as caught:
        from_json(Whole, values, "f.json")
    assert str(caught.value) == said


def test_what_came_is_cut_short():
    with pytest.raises(JsonError) as caught:
        from_json(Whole, {"name": "a", "count": "x\n" * 10_000}, "f.json")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 150


def test_a_complete_file_lacks_no_field_and_a_foreign_one_may_have_more():
    with pytest.raises(JsonError, match=r"f: kind: is missing; there is 'share'"):
        from_json(Part, {"share": 1}, "f", complete=True)
    assert from_json(Part, {"share": 1, "colour": 3}, "f", foreign=True) == Part(share=1)
    with pytest.raises(JsonError, match=r"f: parts\[0\]\.share: is missing"):
        from_json(Whole, {"name": "", "parts": [{"colour": 3}]}, "f", foreign=True)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "f: is not whole JSON: "),
        ('{"a": 1', "f: is not whole JSON: "),
        ("NaN", "f: is not whole JSON: NaN is no number of JSON"),
        ('{"a": [-Infinity]}', "f: is not whole JSON: -Infinity is no number of JSON"),
        ("1e999", "f: is not whole JSON: 1e999 is too large a number"),
        ("-1e999", "f: is not whole JSON: -1e999 is too large a number"),
        ("18446744073709551616", "f: is not whole JSON: 18446744073709551616 is too large"),
        ("9" * 100_000, "f: is not whole JSON: 999999999"),
        ("[" * 100_000, "f: is nested deeper than 64"),
        ('{"a":' * 100_000, "f: is nested deeper than 64"),
        ("[" * 65 + "]" * 65, "f: is nested deeper than 64"),
        (r'["\ud800"]', "f: is not whole JSON: half of a surrogate pair"),
    ],
    ids=lambda text: text[:20],
)
def test_text_that_is_no_json_is_refused_in_one_short_line(text, said):
    with pytest.raises(JsonError) as caught:
        parsed(text, "f")
    assert str(caught.value).startswith(said)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 150


def test_what_json_may_hold_is_read():
    deep = "[" * DEEPEST + "]" * DEEPEST
    assert json.dumps(parsed(deep, "f")) == deep
    assert parsed('[18446744073709551615, -1.5e3, "\\ud83d\\ude00"]', "f") == [
        18446744073709551615,
        -1500.0,
        "\N{GRINNING FACE}",
    ]


def test_a_file_that_is_not_there_or_no_text_is_refused_by_its_path(tmp_path):
    with pytest.raises(JsonError, match=r"none\.json: cannot be read \(No such file"):
        read_json(tmp_path / "none.json")
    (tmp_path / "bytes.json").write_bytes(b"\xff\xfe")
    with pytest.raises(JsonError, match=r"bytes\.json: is not whole JSON: 'utf-8'"):
        read_json(tmp_path / "bytes.json")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("[]", "its format is not 'ours'"),
        ('{"format": "theirs"}', "its format is not 'ours'"),
        ('{"format": "ours"}', "has format version null, this program reads 2"),
        ('{"format": "ours", "format_version": 3}', "has format version 3, this program reads 2"),
    ],
)
def test_a_document_of_another_format_or_version_is_foreign(tmp_path, content, said):
    path = tmp_path / "a.json"
    path.write_text(content)
    with pytest.raises(ForeignError, match=said):
        read_document(path, "ours", 2)


def test_a_document_is_what_stands_beside_its_format(tmp_path):
    path = tmp_path / "a.json"
    path.write_text(by_lines({"format": '"ours"', "format_version": "2", "a": compact([1, 2])}))
    assert path.read_text() == '{\n "format": "ours",\n "format_version": 2,\n "a": [1,2]\n}\n'
    assert read_document(path, "ours", 2) == {"a": [1, 2]}


@pytest.mark.parametrize("write", [compact, indented, one_line])
def test_a_number_that_is_not_finite_is_never_written(write):
    with pytest.raises(ValueError, match="not JSON compliant"):
        write({"a": float("nan")})
