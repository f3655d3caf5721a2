"""What follows from a large town is kept for the next run: the same bits, and never another's."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from di_envs.files.caches import CacheWarning
from di_envs.planned_routes import plan_routes
from di_envs.suites import load_suite
from di_envs.town import kept as module
from di_envs.town.kept import LARGE, kept
from di_envs.town.loading import load_town
from di_envs.town.map_chunks import map_chunks_of
from di_envs.world.building import town_tables


class Wide(NamedTuple):
    """What the tests work out."""

    lanes: NDArray[np.int64]
    over_m: float


CALLS = []


@kept
def wide(town, over_m: float = 3.0) -> Wide:
    """The lanes wider than so much."""
    CALLS.append(town)
    return Wide(np.flatnonzero(town.lanes.width_m > over_m), over_m)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty cache."""
    monkeypatch.setattr(module, "cache_folders", lambda part: (tmp_path,))
    monkeypatch.setattr(module, "writable_cache", lambda part: tmp_path)
    CALLS.clear()
    return tmp_path


def leaves(value, at="value"):
    """Each array and number of a value, by where it is."""
    if hasattr(value, "_fields"):
        parts = zip(value._fields, value, strict=True)
    elif hasattr(value, "__dataclass_fields__"):
        parts = ((name, getattr(value, name)) for name in value.__dataclass_fields__)
    elif isinstance(value, tuple):
        parts = enumerate(value)
    elif isinstance(value, dict):
        parts = value.items()
    else:
        yield at, value
        return
    yield at, type(value)
    for name, part in parts:
        yield from leaves(part, f"{at}.{name}")


def assert_same(found, expected):
    """The same kinds, the same bits, and to kernels the same types."""
    pairs = zip(leaves(found), leaves(expected), strict=True)
    for (at, one), (there, other) in pairs:
        assert at == there
        if not isinstance(other, np.ndarray):
            assert one == other, at
            continue
        assert (one.dtype, one.shape) == (other.dtype, other.shape), at
        assert one.tobytes() == other.tobytes(), at
        assert numba.typeof(one) == numba.typeof(other), at


SHORT = load_suite("town05_short")
PLANNED = {
    "file": "routes.xml",
    "max_snap_m": SHORT.max_snap_m,
    "placed": SHORT.placed_scenarios({"Town05"}),
}


@pytest.mark.parametrize(
    ("work_out", "args", "kwargs"),
    [
        (map_chunks_of.__wrapped__.__wrapped__, (), {}),  # neither once a town nor kept
        (town_tables.__wrapped__.__wrapped__, (), {}),
        (plan_routes.__wrapped__, (SHORT.specs("Town05"),), PLANNED),
    ],
    ids=["map", "tables", "routes"],
)
def test_what_is_read_is_what_was_worked_out(folder, work_out, args, kwargs, monkeypatch):
    town = load_town("town05")
    expected = work_out(town, *args, **kwargs)
    assert_same(kept(work_out)(town, *args, **kwargs), expected)
    monkeypatch.setattr(module, "_write", None)  # it is read now
    assert_same(kept(work_out)(town, *args, **kwargs), expected)
    assert len(list(folder.iterdir())) == 1


def test_it_is_worked_out_once_for_each_of_what_is_given(folder):
    town = load_town("town05")
    assert wide(town).lanes.tolist() == wide(town).lanes.tolist()
    assert len(CALLS) == 1
    assert wide(town, 3.6).lanes.size < wide(town).lanes.size
    assert wide(town, over_m=3.6).over_m == 3.6
    assert len(CALLS) == 3  # by name is not told from by place: it costs a file, no more


def test_a_town_that_was_changed_under_the_same_hash_is_another(folder):
    town = load_town("town05")
    wider = replace(town, lanes=town.lanes._replace(width_m=town.lanes.width_m + 9.0))
    assert wide(town).lanes.size < wide(wider).lanes.size == town.lanes.width_m.size


@pytest.mark.parametrize("damage", ["cut", "garbled", "empty", "another", "of another kind"])
def test_a_file_that_is_not_whole_is_made_again(folder, damage):
    town = load_town("town05")
    expected = wide(town).lanes.tolist()
    [path] = folder.iterdir()
    content = path.read_bytes()
    if damage == "another":
        wide(town, 3.6)
        [other] = set(folder.iterdir()) - {path}
        other.replace(path)
    elif damage == "of another kind":
        with np.load(path) as stored:
            about = str(stored["about"]).replace('"value": [[', '"value": [7, [')
        np.savez(path, about=np.array(about))
    else:
        middle = len(content) // 2
        spoilt = content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]
        path.write_bytes({"cut": content[:middle], "garbled": spoilt, "empty": b""}[damage])
    CALLS.clear()
    assert wide(town).lanes.tolist() == expected
    assert wide(town).lanes.tolist() == expected
    assert len(CALLS) == 1
    assert path.read_bytes() == content


def test_of_a_small_town_nothing_is_kept(folder):
    town = load_town("toy")
    assert town.lanes.kind.size < LARGE
    wide(town)
    wide(town)
    assert len(CALLS) == 2
    assert not list(folder.iterdir())


def test_where_nothing_can_be_written_it_is_worked_out(folder, monkeypatch):
    town = load_town("town05")
    monkeypatch.setattr(module, "writable_cache", lambda part: None)
    assert wide(town).lanes.size > 0
    monkeypatch.setattr(module, "writable_cache", lambda part: folder / "a file" / "part")
    (folder / "a file").touch()
    with pytest.warns(CacheWarning, match="cannot write to the cache"):
        assert wide(town).lanes.size > 0
    assert len(CALLS) == 2


def test_a_route_that_cannot_be_planned_is_refused_each_time(folder):
    suite, town = load_suite("town05_short"), load_town("town05")
    [spec] = suite.specs("Town05", ["0"])
    [first, *rest] = spec.keypoints
    far = replace(spec, keypoints=(first._replace(x=9e5), *rest))
    for _ in range(2):
        with pytest.raises(ValueError, match="9"):
            plan_routes(town, [far], file="far.xml", max_snap_m=suite.max_snap_m)


def test_what_nobody_thought_of_is_not_kept_in_silence(folder):
    with pytest.raises(TypeError, match="cannot keep a set"):
        wide(load_town("town05"), {3.0})
