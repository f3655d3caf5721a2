"""Two hundred hostile files over all formats, each read as its reader is meant to read it.

None brings a traceback that is not the reader's own refusal in one line, none makes a file outside
its folder, runs code, or takes five seconds.
"""

from __future__ import annotations

import json
import os
import random
import signal
import warnings
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.hostile.damage import TEXTS, VALUES, json_with, with_bytes
from tests.hostile.formats import FORMATS, Format, packed_code

PATIENCE_S = 5
ARRAYS = [name for name, form in FORMATS.items() if form.file.endswith((".npz", ".pt"))]
FILES = [name for name, form in FORMATS.items() if form.file != "edits.txt"]


class LateError(BaseException):
    """Nothing that a reader might catch."""


@contextmanager
def in_time() -> Iterator[None]:
    """Raises LateError where a block takes too long."""

    def late(*_: object) -> None:
        raise LateError(f"not done in {PATIENCE_S} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(PATIENCE_S)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def attack(form: Format, folder: Path) -> str:
    """Reads what lies in a folder; what it was refused with, empty where it was taken."""
    with warnings.catch_warnings(), in_time():
        warnings.simplefilter("ignore", UserWarning)
        try:
            form.read(folder)
        except form.refusals as error:
            said = str(error)
            assert "\n" not in said
            assert said
            assert len(said) < 2000
            return said
    return ""


@pytest.fixture
def arena(tmp_path):
    """Makes the folder of a format with a whole file in it; afterwards nothing lies outside."""
    made = []

    def make(name: str) -> tuple[Format, Path, Path]:
        folder = tmp_path / "in"
        folder.mkdir()
        FORMATS[name].make(folder)
        made.append(folder)
        return FORMATS[name], folder, folder / FORMATS[name].file

    yield make
    assert os.listdir(tmp_path) == ["in"]
    assert not list(tmp_path.rglob("*PWN*"))


@pytest.mark.parametrize("name", FORMATS)
def test_a_whole_file_is_taken(arena, name):
    form, folder, _ = arena(name)
    assert attack(form, folder) == ""


@pytest.mark.parametrize("number", range(6))
@pytest.mark.parametrize("name", [n for n in FILES if FORMATS[n].file.endswith(".json")])
def test_values_that_no_field_expects_are_refused(arena, name, number):
    form, folder, path = arena(name)
    draws = random.Random(f"{name} {number}")
    text = path.read_text()
    for _ in range(8):
        value = draws.choice(VALUES)
        path.write_text(json_with(text, draws.randrange(10**6), value))
        attack(form, folder)


@pytest.mark.parametrize("name", [n for n in FILES if FORMATS[n].file.endswith(".json")])
def test_a_version_of_two_lines_is_told_in_one(arena, name):
    form, folder, path = arena(name)
    content = json.loads(path.read_text())
    if "format_version" in content:
        path.write_text(json.dumps({**content, "format_version": "a\nb"}))
        assert r"'a\nb'" in attack(form, folder)


@pytest.mark.parametrize("text", TEXTS)
@pytest.mark.parametrize("name", FILES)
def test_what_is_of_another_kind_is_refused_and_the_file_is_named(arena, name, text):
    form, folder, path = arena(name)
    path.write_bytes(TEXTS[text])
    said = attack(form, folder)
    if form.refusals and (said or name != "log of a training"):
        assert path.name in said


@pytest.mark.parametrize("text", ["quotes", "edits", "more edits", "brackets", "not UTF-8"])
@pytest.mark.parametrize("name", ["interventions", "world edits"])
def test_edits_that_are_none_are_refused(arena, name, text):
    form, folder, path = arena(name)
    path.write_bytes(TEXTS[text])
    assert attack(form, folder)


@pytest.mark.parametrize("number", range(4))
@pytest.mark.parametrize("name", FORMATS)
def test_bytes_flipped_cut_or_repeated_bring_no_other_error(arena, name, number):
    form, folder, path = arena(name)
    draws, content = random.Random(f"{name} {number}"), path.read_bytes()
    for _ in range(6):
        put = draws.randbytes(draws.randrange(6))
        path.write_bytes(with_bytes(content, draws.random(), draws.random(), put))
        attack(form, folder)


@pytest.mark.parametrize("name", FILES)
def test_a_pipe_a_folder_or_a_device_is_not_waited_for(arena, name):
    form, folder, path = arena(name)
    for put in (lambda: os.mkfifo(path), lambda: path.symlink_to("/dev/zero")):
        path.unlink()
        put()
        assert attack(form, folder) or not form.refusals
    path.unlink()
    path.symlink_to(path.name)  # round and round
    attack(form, folder)
    path.unlink()
    path.mkdir()
    assert attack(form, folder) or not form.refusals


@pytest.mark.parametrize("name", FILES)
def test_a_file_of_four_gigabytes_is_not_read(arena, name):
    form, folder, path = arena(name)
    os.truncate(path, 1 << 32)  # of holes: nothing is written
    assert attack(form, folder) or not form.refusals


@pytest.mark.parametrize("name", [n for n in ARRAYS if n != "checkpoint"])
def test_a_few_kilobytes_that_unpack_to_gigabytes_are_not_unpacked(arena, name):
    form, folder, path = arena(name)
    with zipfile.ZipFile(path, "a") as archive:
        archive.infolist()[-1].file_size = 3 << 30  # so much is read of it at most
        archive.comment = b"changed, so that this is written"
    assert "unpacks to" in attack(form, folder) or not form.refusals


@pytest.mark.parametrize("name", ARRAYS)
def test_a_pickle_among_arrays_or_weights_runs_no_code(arena, name, tmp_path):
    form, folder, path = arena(name)
    packed_code(name, path, folder / "PWN")
    assert attack(form, folder) or not form.refusals


@pytest.mark.parametrize("size", ["layers", "width", "heads", "waypoints"])
@pytest.mark.parametrize("value", [10**9, 1e9, 0, -3])
def test_a_policy_of_absurd_size_is_refused_before_it_is_built(arena, size, value):
    form, folder, path = arena("policy")
    text = path.read_text()
    head, _, tail = text.partition(f'"{size}": ')
    path.write_text(f'{head}"{size}": {value}{tail[len(tail.split(",")[0].split(chr(10))[0]) :]}')
    assert f"planner{'.' if isinstance(value, float) else ':'}" in attack(form, folder)
