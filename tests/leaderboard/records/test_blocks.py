"""Packed columns come out as they went in, to half a step."""

from __future__ import annotations

import base64
import json
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from leaderboard.records.blocks import BlockError, Column, read_block, write_block


@given(
    values=st.lists(st.floats(-5e6, 5e6), max_size=40),
    step=st.sampled_from([1.0, 0.01, 0.05, 0.001 * 10]),
)
def test_no_more_than_half_a_step_is_lost(values, step):
    _, columns = read_block(write_block({}, {"x": Column(values=values, step=step)}))
    assert columns["x"].shape == (len(values),)
    assert np.abs(columns["x"] - values).max(initial=0.0) <= step / 2 * (1 + 1e-6) + 1e-9


def test_columns_of_different_lengths_keep_their_names_and_what_is_to_be_known():
    columns = {
        "a": Column(values=[1, -2, 3]),
        "none": Column(values=[]),
        "b": Column(values=[0.5, 0.25], step=0.25),
    }
    meta, read = read_block(write_block({"route": "7"}, columns))
    assert meta == {"route": "7"}
    assert {name: values.tolist() for name, values in read.items()} == {
        "a": [1, -2, 3],
        "none": [],
        "b": [0.5, 0.25],
    }


def test_even_motion_costs_next_to_nothing():
    still = len(write_block({}, {"x": Column(values=np.zeros(10_000), step=0.01)}))
    moving = len(write_block({}, {"x": Column(values=np.arange(10_000) * 0.7, step=0.01)}))
    assert moving < still + 60


@pytest.mark.parametrize("bad", [np.nan, np.inf, 2.0**29])
def test_a_number_that_no_block_can_hold_is_refused_by_its_columns_name(bad):
    with pytest.raises(BlockError, match="'speed'"):
        write_block({}, {"speed": Column(values=[0.0, bad])})


def test_damage_is_found():
    text = write_block({}, {"x": Column(values=[1, 2, 3])})
    data = bytearray(base64.b64decode(text))
    data[-1] ^= 1  # of zlib's checksum
    with pytest.raises(BlockError, match="damaged"):
        read_block(base64.b64encode(data).decode())
    with pytest.raises(BlockError, match="damaged"):
        read_block(text[:-4])
    longer = base64.b64encode(zlib.compress(zlib.decompress(base64.b64decode(text)) + b"\0"))
    with pytest.raises(BlockError, match="13 B"):
        read_block(longer.decode())


def _packed(head: str, body: bytes = b"") -> str:
    return base64.b64encode(zlib.compress(head.encode() + b"\n" + body)).decode()


def _head(**column: object) -> str:
    return json.dumps({"meta": {}, "columns": [{"name": "x", "count": 0, "step": 1} | column]})


@pytest.mark.parametrize(
    ("head", "said"),
    [
        ('{"meta": {}}', "the block's head: columns: is missing"),
        ("[" * 100_000, "the block's head: is nested deeper than 64"),
        (_head(count="3"), r"columns\[0\]\.count: expected a whole number, got '3'"),
        (_head(count=-1), "impossible count"),
        (_head(differences=99_999_999), "impossible count or differences"),
    ],
    ids=["missing", "deep", "type", "negative", "differences"],
)
def test_a_head_that_is_wrong_is_refused_with_its_place(head, said):
    with pytest.raises(BlockError, match=f"the block is damaged: .*{said}"):
        read_block(_packed(head))


def test_a_block_that_unpacks_to_too_much_is_refused():
    with pytest.raises(BlockError, match="more than 268435456 B"):
        read_block(base64.b64encode(zlib.compress(bytes(2**28 + 1), 1)).decode())
