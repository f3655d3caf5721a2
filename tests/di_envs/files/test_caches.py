"""Caches go to the first place that can be written, and are read wherever they lie."""

from __future__ import annotations

import errno
import os
import warnings
from pathlib import Path

import pytest

from di_envs.files import caches
from di_envs.files.caches import ASKED, CacheWarning, cache_folders, writable_cache


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A user with a home, a folder for temporary files, and no wishes."""
    monkeypatch.delenv(ASKED, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.setattr(caches.tempfile, "gettempdir", lambda: str(tmp_path / "tmp"))
    (tmp_path / "tmp").mkdir()
    caches._warn.cache_clear()
    return tmp_path


def blocked(path: Path) -> Path:
    """A place where no folder can be made, not even by root."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("in the way")
    return path


def test_caches_go_to_the_users_cache_folder(home):
    assert writable_cache("towns") == home / "home/driveinsight/towns"
    assert cache_folders("towns") == (home / "home/driveinsight/towns",)


def test_the_folder_that_is_asked_for_comes_first(home, monkeypatch):
    monkeypatch.setenv(ASKED, str(home / "asked"))
    assert writable_cache("towns") == home / "asked/towns"
    assert cache_folders("towns") == (home / "asked/towns", home / "home/driveinsight/towns")


def test_a_cache_that_is_there_but_cannot_be_written_is_read_and_what_is_new_goes_on(
    home, monkeypatch
):
    monkeypatch.setenv(ASKED, str(blocked(home / "asked")))
    assert writable_cache("towns") == home / "home/driveinsight/towns"
    assert cache_folders("towns")[0] == home / "asked/towns"


def test_without_a_home_caches_are_temporary_with_one_warning(home):
    blocked(home / "home")
    with pytest.warns(CacheWarning, match=rf"kept in {home}/tmp/driveinsight-\d+; name .*{ASKED}"):
        place = writable_cache("towns")
    assert place == home / "tmp" / f"driveinsight-{os.getuid()}" / "towns"
    assert place.parent.stat().st_mode & 0o777 == 0o700
    assert writable_cache("towns") == place  # and no second warning: it would be an error here
    assert cache_folders("towns")[-1] == place


def test_a_home_that_nobody_knows_is_no_folder_named_tilde(home, monkeypatch):
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(caches, "user_cache_path", lambda name: Path("~/.cache") / name)
    monkeypatch.chdir(home)
    with pytest.warns(CacheWarning, match="no cache that lasts can be written \\(no home folder"):
        assert writable_cache("towns").is_relative_to(home / "tmp")
    assert not (home / "~").exists()


def test_a_temporary_folder_that_others_can_write_into_is_not_used(home):
    blocked(home / "home")
    folder = home / "tmp" / f"driveinsight-{os.getuid()}"
    folder.mkdir()
    folder.chmod(0o777)
    with pytest.warns(CacheWarning, match="compiled and maps are read anew each time"):
        assert writable_cache("towns") is None
    assert cache_folders("towns") == (home / "home/driveinsight/towns",)


def test_a_temporary_folder_that_is_a_link_is_not_used(home):
    blocked(home / "home")
    (home / "theirs").mkdir(mode=0o700)
    (home / "tmp" / f"driveinsight-{os.getuid()}").symlink_to(home / "theirs")
    with pytest.warns(CacheWarning, match="no cache can be written"):
        assert writable_cache("towns") is None


def test_a_relative_folder_is_refused_as_it_would_move_with_the_working_folder(home, monkeypatch):
    monkeypatch.setenv(ASKED, "here")
    with pytest.warns(CacheWarning, match=f"{ASKED} must be an absolute path, not 'here'"):
        assert writable_cache("towns") == home / "home/driveinsight/towns"


def test_a_full_disk_is_told_once(home):
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    with pytest.warns(CacheWarning, match="No space left on device.*made anew each time"):
        caches.warn_not_kept(home / "kernels/a", full)
    caches.warn_not_kept(home / "kernels/b", full)


def test_children_leave_the_warning_to_their_parent():
    from agents.processes import leave_warnings_to_parent

    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        leave_warnings_to_parent()
        warnings.warn("cannot write", CacheWarning, stacklevel=1)
    assert told == []
