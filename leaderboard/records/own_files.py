"""What in a folder is a run's, and may be taken away: files by their exact names, and nothing else.

A run's folder may hold more: notes, pages, films. What somebody else put there stays, whatever it
is called. A folder is a run's if its `driveinsight.json` says so; one that holds other things and
no run is refused, and so are links in the place of our files, which lead to somebody else's.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

from di_envs.files.whole import unfinished
from leaderboard.records.folder_lock import LOCK_FILE
from leaderboard.records.results import (
    CARLA_FILE,
    RECORD_FILE,
    ROUTE_FILE,
    ROUTES_FOLDER,
    ResultsError,
    route_files,
)
from leaderboard.records.run_json import FORMAT, ROUTE_FORMAT

_MARKED_WITHIN = 4096  # characters of a file of ours, the first of which say its format
_FILES = f"{re.escape(RECORD_FILE)}|{re.escape(CARLA_FILE)}"
_SHOWN = 3  # names of other things in an error


def prepare_folder(folder: Path, *, overwrite: bool = False, resume: bool = False) -> None:
    """Makes the folder, and makes sure before any work starts that results can be written there.

    Args:
        folder: Where the results are to go.
        overwrite: Those of an earlier run may be there, to be taken away; see `take_away`.
        resume: They may be there, to be continued.

    Raises:
        ResultsError: If it cannot be written to, holds results and neither is set, or holds
            something else that would be mixed with them.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _check_ours(folder)
        if (folder / RECORD_FILE).exists() and not (overwrite or resume):
            raise ResultsError(
                f"{folder} already holds {RECORD_FILE}: choose another --output, pass --resume to "
                "continue that run, or --overwrite to replace it"
            )
        with tempfile.TemporaryFile(dir=folder):
            pass
        for path in _unfinished(folder):
            path.unlink(missing_ok=True)
    except OSError as error:
        raise ResultsError(
            f"cannot write results to {folder} ({error.strerror}): choose another --output"
        ) from error


def take_away(folder: Path) -> None:
    """Takes away the routes and the table of the run that a folder holds.

    Its own file goes last, when another takes its place: until then it says whose folder this is.

    Raises:
        ResultsError: If they cannot be removed, or are not plain files.
    """
    try:
        _check_plain(folder)
        for path in (*route_files(folder), folder / CARLA_FILE):
            path.unlink(missing_ok=True)
    except OSError as error:
        raise ResultsError(f"cannot remove the results in {folder} ({error.strerror})") from error


def remove_run(folder: Path) -> None:
    """Removes a run's files from a folder, its own last, and nothing else.

    Raises:
        ResultsError: As `take_away`.
        OSError: If its own file cannot be removed.
    """
    take_away(folder)
    for path in _unfinished(folder):
        path.unlink(missing_ok=True)
    (folder / RECORD_FILE).unlink(missing_ok=True)
    routes = folder / ROUTES_FOLDER
    if routes.is_dir() and not any(routes.iterdir()):
        routes.rmdir()


def _check_ours(folder: Path) -> None:
    """Refuses a folder that is neither a run's nor empty but for what a killed run left."""
    _check_plain(folder)
    for path in route_files(folder):
        _check_marked(path, ROUTE_FORMAT)
    record = folder / RECORD_FILE
    if record.exists():
        _check_marked(record, FORMAT)
        return
    left = {folder / LOCK_FILE, *_unfinished(folder), *route_files(folder)}
    refuse_others(folder, [path for path in _within(folder) if path not in left])


def refuse_others(folder: Path, others: Iterable[Path]) -> None:
    """Refuses a folder for what it holds.

    Raises:
        ResultsError: If there are any `others`; names the first.
    """
    if found := sorted(others):
        names = ", ".join(str(path.relative_to(folder)) for path in found[:_SHOWN])
        more = f" and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
        raise ResultsError(
            f"{folder} holds other things ({names}{more}) and no results: choose another --output, "
            "a new folder or an empty one"
        )


def _check_plain(folder: Path) -> None:
    """Refuses links, and whatever else is no file, in the place of files of ours."""
    routes = folder / ROUTES_FOLDER
    if routes.is_symlink() or (routes.exists() and not routes.is_dir()):
        raise ResultsError(f"{routes} is no folder of ours: remove it, or choose another --output")
    for path in (folder / RECORD_FILE, folder / CARLA_FILE, *route_files(folder)):
        if path.is_symlink() or (path.exists() and not path.is_file()):
            raise ResultsError(f"{path} is no file of ours: remove it, or choose another --output")


def _check_marked(path: Path, form: str) -> None:
    """Refuses a file that has the name of one of ours, and does not begin like one."""
    with path.open(encoding="utf-8", errors="replace") as file:
        begins = file.read(_MARKED_WITHIN)
    if begins and form not in begins:
        raise ResultsError(
            f"{path} is no file of ours (its format is not '{form}'): remove it, or choose another "
            "--output"
        )


def _within(folder: Path) -> Iterator[Path]:
    """What a folder holds, and what its routes' folder does."""
    for path in folder.iterdir():
        if path.name == ROUTES_FOLDER:
            yield from path.iterdir()
        else:
            yield path


def _unfinished(folder: Path) -> list[Path]:
    """What a killed process was writing, and had not finished."""
    return [*unfinished(folder, _FILES), *unfinished(folder / ROUTES_FOLDER, ROUTE_FILE)]
