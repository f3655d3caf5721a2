"""What is wrong with a run's files beside the drives: its table, how numbers are spelled."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from di_envs.files.json_text import JsonError, read_json
from leaderboard.records.carla.results import carla_results
from leaderboard.records.record import RunRecord
from leaderboard.records.results import CARLA_FILE, RECORD_FILE, route_files, run_folder


def table_problems(run: RunRecord, folder: Path) -> Iterator[str]:
    """How CARLA's file differs from the one that these routes make."""
    path = run_folder(folder) / CARLA_FILE
    try:
        given = read_json(path)
    except JsonError as error:
        yield str(error)
        return
    made = json.loads(json.dumps(carla_results(run)))
    difference = _first_difference("", given, made)
    if difference:
        yield f"{path.name} does not match the routes: {difference}"


def spelling_problems(folder: Path) -> Iterator[str]:
    """Numbers that are not spelled as they were written: a last digit can change no bit."""
    top = run_folder(folder)
    for path in (top / RECORD_FILE, top / CARLA_FILE, *route_files(top)):
        odd: list[str] = []

        def number(text: str, odd: list[str] = odd) -> float:
            if repr(float(text)) != text:
                odd.append(text)
            return float(text)

        try:
            json.loads(path.read_text(encoding="utf-8"), parse_float=number)
        except (OSError, ValueError, RecursionError):
            continue  # said where it is read
        if odd:
            yield f"{path.name} has {odd[0]}, a number that is written {float(odd[0])!r}"


def _first_difference(where: str, given: Any, made: Any) -> str:
    """Where two JSON values first differ, and how; empty if they do not."""
    if isinstance(given, dict) and isinstance(made, dict):
        for key in sorted(given.keys() | made.keys()):
            place = f"{where}.{key}".lstrip(".")
            if key not in given or key not in made:
                return f"{place} is {'missing' if key not in given else 'not ours'}"
            if difference := _first_difference(place, given[key], made[key]):
                return difference
        return ""
    if isinstance(given, list) and isinstance(made, list) and len(given) == len(made):
        pairs = enumerate(zip(given, made, strict=True))
        found = (_first_difference(f"{where}[{i}]", one, other) for i, (one, other) in pairs)
        return next(filter(None, found), "")
    return "" if given == made else f"{where} is {given!r}, the routes give {made!r}"
