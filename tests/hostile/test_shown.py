"""Whatever can be read of a run can be shown: a stranger's values bring no traceback afterwards."""

from __future__ import annotations

import io
import json
import random
from contextlib import suppress

import pytest

from di_envs.rules import rules_named
from leaderboard.records.carla.results import carla_results
from leaderboard.records.rescoring import rescored
from leaderboard.records.results import ResultsError, read_head, read_run
from leaderboard.records.run_json import run_hash
from leaderboard.running.terminal import Terminal
from leaderboard.studies.comparing import PairingError, compare_runs
from leaderboard.tables.comparison_table import comparison_tables
from leaderboard.tables.rescoring_table import rescoring_table
from leaderboard.tables.run_tables import print_run
from tests.hostile.damage import VALUES, places, with_value
from tests.hostile.formats import FORMATS

HEAD, ROUTE = "driveinsight.json", "routes/0000.json"
DRAWS = 60


def shown(folder):
    """All that commands show of a run without driving it."""
    console = Terminal(file=io.StringIO())
    run = read_run(folder)
    print_run(run, console)
    carla_results(run)
    with suppress(PairingError, ValueError):  # as the commands do, which say it in a line
        console.print(rescoring_table(run, rescored(run, rules_named("carla-2.1"))))
        console.print(comparison_tables(compare_runs(run, run)))
    return console.file.getvalue()


@pytest.mark.parametrize("name", [HEAD, ROUTE])
def test_values_that_can_be_read_can_be_shown(name, tmp_path):
    FORMATS["run"].make(tmp_path)
    path, draws, taken = tmp_path / name, random.Random(name), 0
    assert "expert" in shown(tmp_path)
    content = json.loads(path.read_text())
    found = [at for at in places(content) if at and at[0] not in ("format", "format_version")]
    for _ in range(DRAWS):
        at, value = draws.choice(found), draws.choice(VALUES)
        path.write_text(json.dumps(with_value(content, at, value)))
        try:
            read_forged(tmp_path)
            taken += bool(shown(tmp_path))
        except ResultsError:
            continue
    assert taken > DRAWS // 20


def read_forged(folder):
    """Reads a run once its routes name what lies beside them, as a forger would have it."""
    name = run_hash(read_head(folder))
    for path in (folder / "routes").iterdir():
        content = json.loads(path.read_text())
        if isinstance(content, dict):
            path.write_text(json.dumps({**content, "run": name}))
    return read_run(folder)


@pytest.mark.parametrize(
    ("name", "at", "value", "said"),
    [
        (HEAD, ("rules",), "mine", "rules: expected one of carla-1.0"),
        (HEAD, ("seeds",), [], "seeds: expected some"),
        (HEAD, ("requires", "options"), [1], r"requires\.options: expected options by name"),
        (HEAD, ("requires", "observations"), 3, r"requires\.observations: expected a list"),
        (HEAD, ("seeds",), [5], "is of seed 0, which the run does not have"),
        (ROUTE, ("scenarios",), {"x": 1}, "scenarios: expected the numbers of types, got x"),
    ],
)
def test_what_no_type_says_is_refused_by_its_name(name, at, value, said, tmp_path):
    FORMATS["run"].make(tmp_path)
    path = tmp_path / name
    path.write_text(json.dumps(with_value(json.loads(path.read_text()), at, value)))
    with pytest.raises(ResultsError, match=said):
        read_forged(tmp_path)
