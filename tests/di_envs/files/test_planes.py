"""Numbers as text: planes as one can write them down, limits on what comes out."""

from __future__ import annotations

import base64
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from di_envs.files.planes import from_planes, from_text, to_planes, to_text


def test_the_first_bytes_stand_first():
    numbers = np.array([0x0102, 0x0304], "<u2")
    assert to_planes(numbers) == bytes([0x02, 0x04, 0x01, 0x03])
    assert from_planes(to_planes(numbers), "<u2").tolist() == [0x0102, 0x0304]


@given(st.lists(st.integers(0, 2**32 - 1)), st.sampled_from(["<u4", "<f4"]))
def test_every_number_comes_back_to_the_bit(values, dtype):
    numbers = np.array(values, "<u4").view(dtype)
    again = from_planes(from_text(to_text(to_planes(numbers))), dtype)
    assert again.dtype == numbers.dtype
    assert again.tobytes() == numbers.tobytes()


def test_a_short_text_that_unpacks_to_too_much_is_refused():
    bomb = to_text(bytes(1_000_000))
    assert len(bomb) < 2_000
    assert len(from_text(bomb, most=1_000_000)) == 1_000_000
    with pytest.raises(ValueError, match="more than 999999 B"):
        from_text(bomb, most=999_999)


@pytest.mark.parametrize(
    "text",
    [
        "!",
        "ä",
        "",
        to_text(b"abc")[:-4],
        base64.b64encode(b"nothing deflated").decode(),
        base64.b64encode(zlib.compress(b"abc") + b"more").decode(),
    ],
    ids=["sign", "letter", "nothing", "cut", "plain", "longer"],
)
def test_damaged_text_is_refused(text):
    with pytest.raises(ValueError, match="packed numbers are damaged"):
        from_text(text)


def test_bytes_that_are_no_whole_numbers_are_refused():
    with pytest.raises(ValueError, match="7 B are not 4 planes"):
        from_planes(bytes(7), "<u4")
