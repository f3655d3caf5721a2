"""Loading: names, errors, and a cache that several processes may write."""

from __future__ import annotations

import ast
import multiprocessing
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from di_envs.files.caches import CacheWarning
from di_envs.town import cache, loading
from di_envs.town.loading import load_town
from tests.di_envs.town.small_maps import crossing, lane, load, one_street, opendrive, road, section


def write(folder: Path, text: str) -> Path:
    path = folder / "map.xodr"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty; expected an OpenDRIVE file"),
        ("   \n", "is empty"),
        ("<OpenDRIVE><road></OpenDRIVE>", "is not well-formed XML"),
        ("town05", "is not well-formed XML"),
        ("<osm></osm>", "its root is <osm>, not <OpenDRIVE>"),
        ("<OpenDRIVE></OpenDRIVE>", r"has no driving lanes \(0 roads"),
        (opendrive(road("1", 50.0, section(0.0, lane(-1, kind="sidewalk")))), "no driving lanes"),
        (one_street().replace('length="100.0" junction', 'length="far" junction'), "road '1'.*far"),
        (one_street().replace(' hdg="0.0"', ""), "road '1'.*no attribute 'hdg'"),
        (one_street().replace("<line/>", "<helix/>"), "no geometry of a known shape"),
        (
            one_street(before='<type s="0"><speed max="3" unit="kn"/></type>'),
            "unit 'kn' is unknown",
        ),
    ],
)
def test_a_file_that_is_no_town_says_what_is_wrong_and_where(tmp_path, text, message):
    with pytest.raises(ValueError, match=message) as caught:
        load_town(write(tmp_path, text), "none", cache_folder=tmp_path / "cache")
    assert "map.xodr" in str(caught.value)


def test_a_missing_file_and_a_misspelt_name_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="did you mean 'town05'"):
        load_town("twon05", cache_folder=tmp_path)
    with pytest.raises(FileNotFoundError, match="shipped: town05, toy"):
        load_town(tmp_path / "nothing.xodr", cache_folder=tmp_path)


def test_arrays_cannot_be_written(tmp_path):
    for _ in range(2):  # parsed, then from the cache
        town = load(crossing(), tmp_path)
        for part in (town.lanes, town.signals, town.crosswalks):
            assert not any(array.flags.writeable for array in part)


def same(a, b):
    return all(
        x.dtype == y.dtype and np.array_equal(x, y)
        for part in ("lanes", "signals", "crosswalks")
        for x, y in zip(getattr(a, part), getattr(b, part), strict=True)
    )


def test_a_cached_town_is_the_parsed_one(tmp_path, monkeypatch):
    parsed = load_town("toy", cache_folder=tmp_path)
    monkeypatch.setattr(loading, "read_opendrive", None)  # nobody may parse again
    cached = load_town("toy", cache_folder=tmp_path)
    assert same(parsed, cached)
    for name in ("name", "road_names", "junction_names", "geo_origin", "content_hash", "opendrive"):
        assert getattr(parsed, name) == getattr(cached, name)


@pytest.mark.parametrize("damage", ["cut", "empty", "other", "folder"])
def test_a_damaged_cache_file_is_replaced(tmp_path, damage):
    parsed = load_town("toy", cache_folder=tmp_path)
    (path,) = tmp_path.glob("*.npz")
    content = path.read_bytes()
    if damage == "folder":
        path.unlink()
        path.mkdir()
    else:
        path.write_bytes(
            {"cut": content[: len(content) // 2], "empty": b"", "other": b"PK"}[damage]
        )
    told = pytest.warns(CacheWarning) if damage == "folder" else nullcontext()
    with told:
        assert same(parsed, load_town("toy", cache_folder=tmp_path))
    assert path.is_dir() or path.read_bytes() == content
    assert list(tmp_path.iterdir()) == [path]


def test_a_cache_that_cannot_be_written_is_no_error(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    with pytest.warns(CacheWarning, match=r"cannot write to the cache .*made anew each time"):
        assert load_town("toy", cache_folder=blocked).junction_names == ("1", "2")


def _load_toy(folder: str) -> str:
    return load_town("toy", cache_folder=Path(folder)).content_hash


def test_two_processes_may_fill_the_cache_at_once(tmp_path):
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        hashes = pool.map(_load_toy, [str(tmp_path)] * 2, chunksize=1)
    assert hashes[0] == hashes[1]
    assert [path.name for path in tmp_path.iterdir()] == [f"{cache.cache_key(hashes[0])}.npz"]


def test_an_edited_reader_reads_anew_what_is_still_the_same_town(tmp_path, monkeypatch):
    before = load_town("toy", cache_folder=tmp_path)
    monkeypatch.setattr(cache, "reader_version", lambda: "another")
    read = []
    parse = loading._parse
    monkeypatch.setattr(loading, "_parse", lambda *given: read.append(1) or parse(*given))
    assert load_town("toy", cache_folder=tmp_path).content_hash == before.content_hash
    assert read == [1]
    assert len(list(tmp_path.glob("*.npz"))) == 2


def test_the_hash_tells_maps_and_signals_apart(tmp_path):
    plain = load(crossing(), tmp_path).content_hash
    assert load(crossing(), tmp_path).content_hash == plain
    assert load(crossing(), tmp_path, signals="synthesise").content_hash != plain
    assert load(crossing().replace("3.5", "3.6"), tmp_path).content_hash != plain


def test_a_sidecars_content_counts_not_its_name(tmp_path):
    path = tmp_path / "signals.json"
    hashes = []
    for kind in ("stop", "lights"):
        path.write_text(f'{{"junctions": [{{"junction": "9", "kind": "{kind}"}}]}}')
        hashes.append(load(crossing(), tmp_path, signals=path).content_hash)
    assert hashes[0] != hashes[1]


def test_the_readers_version_covers_every_module_that_it_imports():
    folder = Path(loading.__file__).parent

    def source(name):
        return folder.joinpath(*name.split(".")).with_suffix(".py")

    seen, front = set(), ["loading"]
    while front:
        name = front.pop()
        if name in seen:
            continue
        seen.add(name)
        for node in ast.walk(ast.parse(source(name).read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("di_envs.town"):
                module = (node.module or "").removeprefix("di_envs.town").lstrip(".")
                names = [module] if module else [alias.name for alias in node.names]
                front += [n for n in names if source(n).is_file()]
    assert seen <= set(cache.READER_MODULES)
    assert all(source(name).is_file() for name in cache.READER_MODULES)
