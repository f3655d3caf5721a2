"""Whole files and folders: there entirely or not at all, and nothing left behind."""

from __future__ import annotations

import multiprocessing
import stat

import pytest

from di_envs.files.whole import whole_folder, write_whole


@pytest.mark.parametrize(
    "content",
    ["grün\n", "grün\n".encode(), lambda file: file.write("grün\n".encode())],
    ids=["text", "bytes", "callback"],
)
def test_text_bytes_and_what_a_callback_writes_make_the_same_file(tmp_path, content):
    path = tmp_path / "in" / "folders" / "a.txt"
    write_whole(path, content)
    assert path.read_bytes() == "grün\n".encode()
    assert [file.name for file in path.parent.iterdir()] == ["a.txt"]


def test_everybody_may_read_what_is_written(tmp_path):
    write_whole(tmp_path / "a.txt", "a")
    assert stat.S_IMODE((tmp_path / "a.txt").stat().st_mode) == 0o644


def _fail(file):
    file.write(b"half")
    raise KeyboardInterrupt


def test_a_failure_leaves_the_old_file_and_nothing_beside_it(tmp_path):
    path = tmp_path / "a.txt"
    write_whole(path, "old")
    with pytest.raises(KeyboardInterrupt):
        write_whole(path, _fail)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_cannot_take_its_place_leaves_nothing_beside_it(tmp_path):
    (tmp_path / "folder").mkdir()
    with pytest.raises(OSError, match="folder"):
        write_whole(tmp_path / "folder", "a")
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]


def _write_often(path, letter):
    for _ in range(50):
        write_whole(path, letter * 100_000)


def test_two_processes_never_mix_their_files(tmp_path):
    path = tmp_path / "a.txt"
    write_whole(path, "a" * 100_000)
    context = multiprocessing.get_context("spawn")
    writers = [context.Process(target=_write_often, args=(path, letter)) for letter in "ab"]
    for writer in writers:
        writer.start()
    while any(writer.is_alive() for writer in writers):
        text = path.read_text()
        assert text in ("a" * 100_000, "b" * 100_000)
    for writer in writers:
        writer.join()
        assert writer.exitcode == 0
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_is_there_when_it_is_whole(tmp_path):
    folder = tmp_path / "in" / "made"
    with whole_folder(folder) as made:
        (made / "a.txt").write_text("a")
        assert not folder.exists()
    assert (folder / "a.txt").read_text() == "a"
    assert stat.S_IMODE(folder.stat().st_mode) == 0o755
    assert list(folder.parent.iterdir()) == [folder]


def _fail_in(folder):
    with whole_folder(folder) as made:
        (made / "a.txt").write_text("a")
        raise ValueError("half")


def test_a_folder_that_fails_leaves_nothing(tmp_path):
    with pytest.raises(ValueError, match="half"):
        _fail_in(tmp_path / "made")
    assert list(tmp_path.iterdir()) == []


def test_the_folder_of_who_was_faster_stays(tmp_path):
    folder = tmp_path / "made"
    with whole_folder(folder) as made:
        (made / "a.txt").write_text("slow")
        folder.mkdir()
        (folder / "a.txt").write_text("fast")
    assert (folder / "a.txt").read_text() == "fast"
    assert list(tmp_path.iterdir()) == [folder]


def test_a_file_in_the_place_of_a_folder_is_an_error(tmp_path):
    (tmp_path / "made").write_text("in the way")
    with pytest.raises(OSError, match="made"), whole_folder(tmp_path / "made"):
        pass
    assert (tmp_path / "made").read_text() == "in the way"
