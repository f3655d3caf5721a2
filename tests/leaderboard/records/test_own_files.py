"""Nothing that somebody else put into a folder is ever removed, whatever it is called."""

from __future__ import annotations

import errno
import os

import pytest

from leaderboard.commands.cli import EXIT_USAGE, main
from leaderboard.records import folder_lock as locks
from leaderboard.records.folder_lock import folder_lock
from leaderboard.records.own_files import prepare_folder, take_away
from leaderboard.records.results import CARLA_FILE, RECORD_FILE, ResultsError, write_run
from leaderboard.studies.driving import _check_folder
from leaderboard.studies.more_seeds import recover_run, replace_run
from tests.leaderboard.made_records import route, run_of

RED = route()
# What looks like ours, and is not
USERS = (
    *(".settings.json.bak", ".results.json.original", ".driveinsight.json.swp", "notes.json"),
    *("routes/plan.json", "routes/.0000.json.bak", "routes/01.json", "routes/0000.json.txt"),
)
OURS = (".driveinsight.json.a1b2c3_d.unfinished", "routes/.0003.json.abcdefgh.unfinished")


def put(folder, names, text="mine"):
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def names_in(folder):
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if not path.is_dir()}


def test_a_run_that_is_overwritten_takes_no_file_of_the_users_with_it(tmp_path):
    write_run(tmp_path, run_of(RED, route(route_id="8", index=1)))
    put(tmp_path, [*USERS, *OURS])
    prepare_folder(tmp_path, overwrite=True)
    take_away(tmp_path)
    assert names_in(tmp_path) == {RECORD_FILE, *USERS}


@pytest.mark.parametrize("name", [*USERS, CARLA_FILE, "keep/me.txt"])
@pytest.mark.parametrize("asked", [{}, {"overwrite": True}, {"resume": True}], ids=str)
def test_a_folder_that_holds_other_things_and_no_run_is_refused(tmp_path, name, asked):
    put(tmp_path, [name])
    with pytest.raises(ResultsError, match=r"holds other things \(.*choose another --output"):
        prepare_folder(tmp_path, **asked)
    assert names_in(tmp_path) == {name}


@pytest.mark.parametrize("name", [RECORD_FILE, "routes/0000.json"])
def test_files_of_our_names_that_do_not_begin_like_ours_are_left_alone(tmp_path, name):
    write_run(tmp_path, run_of(RED))
    put(tmp_path, [name], '{"format": "of my own"}')
    with pytest.raises(ResultsError, match=r"is no file of ours \(its format is not"):
        prepare_folder(tmp_path, overwrite=True)
    assert (tmp_path / name).read_text() == '{"format": "of my own"}'


def test_a_link_in_the_place_of_the_routes_folder_is_not_followed(tmp_path):
    mine = tmp_path / "elsewhere"
    write_run(mine, run_of(RED))
    write_run(tmp_path / "run", run_of(RED))
    (tmp_path / "run/routes/0000.json").unlink()
    (tmp_path / "run/routes").rmdir()
    (tmp_path / "run/routes").symlink_to(mine / "routes")
    for do in (
        lambda: prepare_folder(tmp_path / "run", overwrite=True),
        lambda: take_away(tmp_path / "run"),
    ):
        with pytest.raises(ResultsError, match="routes is no folder of ours"):
            do()
    assert (mine / "routes/0000.json").exists()


@pytest.mark.parametrize("name", [RECORD_FILE, CARLA_FILE, "routes/0000.json"])
def test_a_link_or_a_pipe_in_the_place_of_a_file_of_ours_is_refused(tmp_path, name):
    write_run(tmp_path / "run", run_of(RED))
    path = tmp_path / "run" / name
    path.rename(tmp_path / "mine")
    path.symlink_to(tmp_path / "mine")
    with pytest.raises(ResultsError, match="is no file of ours: remove it"):
        prepare_folder(tmp_path / "run", resume=True)
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(ResultsError, match="is no file of ours: remove it"):
        prepare_folder(tmp_path / "run", resume=True)


def test_what_a_killed_start_left_is_no_reason_to_refuse(tmp_path):
    put(tmp_path, [*OURS, locks.LOCK_FILE], "")
    prepare_folder(tmp_path)
    assert names_in(tmp_path) == {locks.LOCK_FILE}


def test_an_empty_output_is_refused_and_not_the_current_folder(tmp_path, monkeypatch, capsys):
    put(tmp_path, [".settings.json.bak"])
    monkeypatch.chdir(tmp_path)
    for empty in (["--output", ""], ["--output="]):
        assert main(["evaluate", "--agent", "constant", "--suite", "toy", *empty]) == EXIT_USAGE
        assert "an argument after --output is empty" in capsys.readouterr().err
    assert names_in(tmp_path) == {".settings.json.bak"}


def test_a_folder_made_by_the_user_outlives_a_run_that_could_not_begin(tmp_path, capsys):
    arguments = ["evaluate", "--agent", "nobody", "--suite", "toy", "--output"]
    for folder, stays in ((tmp_path, True), (tmp_path / "new", False)):
        assert main([*arguments, str(folder)]) == EXIT_USAGE
        assert folder.is_dir() is stays
    assert "nobody" in capsys.readouterr().err


def test_an_overwrite_that_cannot_begin_loses_nothing(tmp_path, capsys):
    write_run(tmp_path, run_of(RED))
    before = {name: (tmp_path / name).read_bytes() for name in names_in(tmp_path)}
    arguments = ["--agent", "nobody", "--suite", "toy", "--overwrite", "--output", str(tmp_path)]
    assert main(["evaluate", *arguments]) == EXIT_USAGE
    assert {name: (tmp_path / name).read_bytes() for name in names_in(tmp_path)} == before
    assert "nobody" in capsys.readouterr().err


def test_a_run_that_gets_more_seeds_keeps_what_else_is_in_its_folder(tmp_path):
    folder, run = tmp_path / "baseline", run_of(RED)
    write_run(folder, run)
    put(folder, ["report/index.html", "notes.txt"])
    replace_run(folder, run)
    assert {"report/index.html", "notes.txt", "routes/0000.json"} < names_in(folder)
    assert os.listdir(tmp_path) == ["baseline"]


def test_a_killed_change_of_seeds_leaves_what_else_was_there(tmp_path):
    folder, old = tmp_path / "baseline", tmp_path / ".baseline.old"
    for each in (folder, old):
        write_run(each, run_of(RED))
    put(old, ["notes.txt"])
    recover_run(folder)
    assert "notes.txt" in names_in(folder)
    assert os.listdir(tmp_path) == ["baseline"]


def test_a_study_is_not_begun_among_other_things(tmp_path):
    put(tmp_path, ["study.md"])
    with pytest.raises(ResultsError, match=r"holds other things \(study.md\) and no results"):
        _check_folder(tmp_path)
    write_run(tmp_path / "rows" / "baseline", run_of(RED))
    _check_folder(tmp_path)


def failing(*errnos):
    """A lock that fails so, call by call, and then works."""
    left = list(errnos)

    def call(descriptor, how):
        if left:
            raise OSError(left.pop(0), "said the file system")

    return call


def test_where_flock_is_not_there_another_lock_is_taken(tmp_path, monkeypatch):
    monkeypatch.setattr(locks.fcntl, "flock", failing(errno.ENOSYS))
    with folder_lock(tmp_path):
        pass  # no warning: the tests would make an error of it


def test_where_there_are_no_locks_at_all_a_run_goes_on_with_a_warning(tmp_path, monkeypatch):
    monkeypatch.setattr(locks.fcntl, "flock", failing(errno.ENOLCK))
    monkeypatch.setattr(locks.fcntl, "lockf", failing(errno.EOPNOTSUPP))
    with pytest.warns(UserWarning, match="there are no file locks where"), folder_lock(tmp_path):
        pass
    monkeypatch.setattr(locks, "fcntl", None)  # as on Windows
    with pytest.warns(UserWarning, match="there are no file locks where"), folder_lock(tmp_path):
        pass


def test_a_link_in_the_place_of_the_lock_is_not_followed(tmp_path):
    (tmp_path / locks.LOCK_FILE).symlink_to(tmp_path / "mine")
    with pytest.raises(ResultsError, match="cannot write results"), folder_lock(tmp_path):
        pass
    assert not (tmp_path / "mine").exists()
