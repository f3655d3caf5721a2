"""Every format fuzzed: damage of any kind brings the reader's own refusal, or a value.

The seed is fixed, so that a run of it is as good as any other; what runs with `full` looks longer.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

from tests.hostile.damage import TEXTS, VALUES, json_with, with_bytes
from tests.hostile.formats import FORMATS
from tests.hostile.test_attack import attack

FEW, MANY = 20, 600
QUIET = {
    "database": None,
    "deadline": None,
    "suppress_health_check": [HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
}

SHARE = st.floats(0.0, 1.0)
BYTES = st.one_of(st.binary(max_size=12), st.sampled_from([text[:60] for text in TEXTS.values()]))
CHANGES = st.lists(
    st.one_of(
        st.tuples(st.just("bytes"), SHARE, SHARE, BYTES),
        st.tuples(st.just("value"), st.integers(0, 10**6), st.sampled_from(VALUES)),
    ),
    min_size=1,
    max_size=3,
)


def damaged(content: bytes, changes: list[tuple]) -> bytes:
    """A file's bytes with changes one after the other; values only as long as it is JSON."""
    for kind, *change in changes:
        if kind == "bytes":
            content = with_bytes(content, *change)
        else:
            try:
                content = json_with(content.decode(), *change).encode()
            except ValueError:  # no JSON, or none any more
                continue
    return content


def fuzz(name: str, examples: int) -> None:
    """Damages a whole file of a format in so many ways."""
    form = FORMATS[name]
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "in"
        folder.mkdir()
        form.make(folder)
        path = folder / form.file
        whole = path.read_bytes()

        @seed(7)
        @settings(max_examples=examples, **QUIET)
        @given(changes=CHANGES)
        def one(changes):
            path.write_bytes(damaged(whole, changes))
            attack(form, folder)

        one()
        assert [each.name for each in Path(place).iterdir()] == ["in"]


@pytest.mark.parametrize("name", FORMATS)
def test_a_damaged_file_is_refused_in_one_line_or_taken(name):
    fuzz(name, FEW)


@pytest.mark.parametrize("name", FORMATS)
def test_a_file_damaged_in_many_ways_is_refused_in_one_line_or_taken(name):
    fuzz(name, MANY)
