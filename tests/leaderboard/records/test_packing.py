"""Packed numbers come back to the bit, and damage is found."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra.numpy import arrays
from hypothesis.strategies import integers

from leaderboard.records.packing import pack, unpack


@given(arrays(np.float32, integers(0, 40).map(lambda n: (n, 3))))
def test_controls_come_back_to_the_bit(controls):
    again = unpack(pack(controls, "<f4"), "<f4", 3)
    assert again.shape == controls.shape
    assert again.tobytes() == controls.tobytes()


def test_a_held_control_takes_next_to_no_room():
    held = np.tile(np.array([0.5, 0.0, 0.0], np.float32), (1000, 1))
    assert len(pack(held, "<f4")) < 100 < held.nbytes


def test_numbers_that_would_be_rounded_are_refused():
    with pytest.raises(ValueError, match="without loss"):
        pack(np.array([[0.1, 0.2, 0.3]]), "<f4")


@pytest.mark.parametrize("text", ["?", "AAAA", pack(np.zeros((1, 2), np.float32), "<f4")])
def test_damaged_text_is_refused(text):
    with pytest.raises(ValueError, match="damaged"):
        unpack(text, "<f4", 3)


def test_text_cut_in_half_is_refused():
    text = pack(np.arange(300, dtype=np.float32).reshape(-1, 3), "<f4")
    with pytest.raises(ValueError, match="damaged"):
        unpack(text[: len(text) // 2 // 4 * 4], "<f4", 3)
