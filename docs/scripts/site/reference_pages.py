"""The reference: commands, options, what is observed, edits, rules and API, as the code has them.

Nothing of these pages is written by hand, so that none can say what is no longer so.
"""

from __future__ import annotations

import contextlib
import dataclasses
import inspect
import io
import os
import re
from collections.abc import Callable, Iterable, Sequence
from typing import Any, get_args

import gymnasium
import numpy as np
import tyro
from api_places import API
from docstring_parser import DocstringStyle, parse

from agents import AGENTS, SCHEMES
from di_envs import ENVIRONMENTS
from di_envs.config import OBSERVATION_GROUPS, OBSERVATION_PRESETS, WEATHERS, RouteEnvConfig
from di_envs.edits import conditions
from di_envs.edits.world import WORLD_EDITS
from di_envs.observation import observation_space
from di_envs.rules import RULES
from di_envs.rules.rule_set import Rules
from di_envs.sensors.camera.config import RIGS, Rig
from di_envs.sensors.lidar.config import LIDARS
from di_envs.suites import load_suite, suite_names
from di_envs.world.event_names import EVENT_KEYS
from leaderboard.commands.cli import Command
from wrappers.interventions.edit import ObservationEdit
from wrappers.interventions.table import EDITS

HELP_COLUMNS = "84"
MADE = "reference/{}.md"


def menu() -> list[Any]:
    """The reference's menu."""
    commands = [{name: MADE.format(f"commands/{name}")} for name, _ in commands_by_name()]
    return [
        {"Commands": [MADE.format("commands/index"), *commands]},
        MADE.format("environments"),
        MADE.format("observations"),
        "conventions.md",
        MADE.format("agents"),
        MADE.format("edits"),
        "rules.md",
        MADE.format("rules"),
        {"Python": [{title: MADE.format(place)} for place, (title, _) in API.items()]},
    ]


def reference_pages() -> dict[str, str]:
    """Markdown of every page of the reference, by its place on the site."""
    made: dict[str, Callable[[], str]] = {
        "commands/index": commands_page,
        "environments": environments_page,
        "observations": observations_page,
        "agents": agents_page,
        "edits": edits_page,
        "rules": rules_page,
    }
    pages = {MADE.format(name): make() for name, make in made.items()}
    pages |= {MADE.format(f"commands/{name}"): command_page(name) for name, _ in commands_by_name()}
    return pages | {MADE.format(place): api_page(*what) for place, what in API.items()}


def commands_by_name() -> list[tuple[str, str]]:
    """Every command with what its help says first."""
    found = []
    for command in get_args(Command):
        kind, described = get_args(command)
        said = described.description or inspect.getdoc(kind) or ""
        found.append((described.name, said.partition("\n")[0]))
    return found


def commands_page() -> str:
    """All commands with a line each."""
    rows = [(f"[`{name}`]({name}.md)", said) for name, said in commands_by_name()]
    return page(
        "Commands",
        "`driveinsight COMMAND --help` says the same. Exit codes: 0; 1 if a simulation or a worker "
        "died, or a claim does not stand; 2 for a wrong request; 130 if interrupted.",
        table(("command", "what it does"), rows),
        "Completion for the shell (bash, zsh or tcsh): `driveinsight --tyro-print-completion bash >"
        " ~/.local/share/bash-completion/completions/driveinsight`.",
    )


def command_page(name: str) -> str:
    """What a command's `--help` prints."""
    shown = io.StringIO()
    width = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = HELP_COLUMNS  # tyro asks how wide the terminal is
    try:
        with contextlib.redirect_stdout(shown), contextlib.suppress(SystemExit):
            tyro.cli(Command, prog="driveinsight", args=[name, "--help"])
    finally:
        os.environ.pop("COLUMNS") if width is None else os.environ.update(COLUMNS=width)
    text = re.sub(r"\x1b\[[0-9;]*m", "", shown.getvalue())
    lines = "\n".join(line.rstrip() for line in text.strip().splitlines())
    return page(f"driveinsight {name}", f"```text\n{lines}\n```")


def environments_page() -> str:
    """Ids, suites, and every option of an environment."""
    ids = [(f"`{name}`", f"`{config.suite}`") for name, config in ENVIRONMENTS.items()]
    suites = [load_suite(name) for name in suite_names()]
    options = documented(RouteEnvConfig)
    rigs = [(f"`{name}`", _rig(rig)) for name, rig in RIGS.items()]
    lidars = [
        (f"`{name}`", f"{lidar.channels} x {lidar.steps} rays, {lidar.range_m:g} m")
        for name, lidar in LIDARS.items()
    ]
    presets = [
        (f"`{name}`", ", ".join(f"`{key}={value!r}`" for key, value in preset.items()))
        for name, preset in OBSERVATION_PRESETS.items()
    ]
    return page(
        "Environments and their options",
        "Ids for `gymnasium.make` and `gymnasium.make_vec`:",
        table(("id", "suite"), ids),
        "## Suites",
        table(
            ("name", "version", "town", "routes", "what it is"),
            [
                (f"`{s.name}`", s.version, f"`{s.town}`", len(s.specs()), s.description)
                for s in suites
            ],
        ),
        "## Options",
        "Keyword arguments of `make`, of `di_envs.RouteEnv` and of `driveinsight.evaluate`; the "
        "commands have them as `--name`. `None` stands for what the suite says.",
        table(("option", "type", "default", "what it says"), options),
        "## Rigs (`cameras=`)",
        table(("name", "cameras"), rigs),
        "## LiDARs (`lidar=`)",
        table(("name", "what it is"), lidars),
        "## Presets of observations",
        table(("name", "stands for"), presets),
        "## Weathers (`weather=`)",
        ", ".join(f"`{name}`" for name in WEATHERS) + ", or `route`: what the route file says.",
    )


def _rig(rig: Rig) -> str:
    return ", ".join(f"`{c.name}` {c.width} x {c.height}, {c.fov_deg:g}°" for c in rig.cameras)


def observations_page() -> str:
    """Every key of every group, as its space has it."""
    parts = []
    for group in OBSERVATION_GROUPS:
        space = observation_space((group,))
        rows = [(f"`{name}`", *_space_cells(each)) for name, each in space.items()]
        parts += [f"## Group `{group}`", table(("key", "shape", "type", "from", "to"), rows)]
    return page(
        "Observation keys",
        "Of each group, with the default rig, LiDAR and radar; `observations=(…)` chooses groups. "
        "What columns mean, frames and units: [conventions](../conventions.md#observations).",
        *parts,
    )


def _space_cells(space: gymnasium.Space[Any]) -> tuple[str, ...]:
    if isinstance(space, gymnasium.spaces.Box):
        low, high = _limits(space.low), _limits(space.high)
    elif isinstance(space, gymnasium.spaces.Discrete):
        low, high = str(space.start), str(space.start + space.n - 1)
    else:
        low, high = "0", "1"  # MultiBinary
    return str(space.shape), f"`{np.dtype(space.dtype)}`", low, high


def _limits(bounds: np.ndarray[Any, Any]) -> str:
    """A bound of all numbers, or those of the columns along the last axis."""
    if np.all(bounds == bounds.flat[0]):
        return f"{bounds.flat[0]:.5g}"
    columns = bounds.reshape(-1, bounds.shape[-1])[0]
    return ", ".join(f"{value:.5g}" for value in columns)


def agents_page() -> str:
    """Agents by name and by scheme, with the options that each takes."""
    named = [(f"`{name}`", entry.summary, entry.version) for name, entry in AGENTS.items()]
    schemes = [
        (f"`{spec}`", said, entry.version)
        for entry in SCHEMES.values()
        for spec, _, said in [entry.summary.partition(": ")]
    ]
    return page(
        "Agents",
        "What `--agent` and `driveinsight.evaluate` take; `driveinsight agents` prints them too. A "
        "class of yours is `path/to/file.py:Class` or `module:Class`. How: [agents](../agents.md).",
        "## By name",
        table(("name", "what it does", "version"), named),
        "## From elsewhere",
        table(("`--agent`", "what it is", "version"), schemes),
    )


def edits_page() -> str:
    """Edits of what is seen, edits of the world, and conditions."""
    seen = [(f"`{verb}:TARGET`", said_of(edit), _settings(edit)) for verb, edit in EDITS.items()]
    world = [(f"`{name}`", said_of(edit.__self__)) for name, edit in WORLD_EDITS.items()]
    return page(
        "Edits",
        "## Of what an agent sees",
        "`--intervene` and `--what-if`, joined by `;`: `drop:obstacles; set:speed=0@t>5`. With "
        " examples: [interventions](../interventions.md).",
        table(("edit", "what it does", "settings"), seen),
        "## Of the world",
        "`driveinsight branch --world` and `--what-if`; see [there](../branching.md#world-edits).",
        table(("edit", "what it does"), world),
        "## When they hold",
        f"```text\n{inspect.getdoc(conditions)}\n```",
    )


def _settings(edit: type[ObservationEdit]) -> str:
    """How an edit's settings are written: `=X` behind the target, `,name=X` behind that."""
    told = [f.metadata["setting"] for f in dataclasses.fields(edit) if "setting" in f.metadata]
    return ", ".join("`=X`" if each.value else f"`{each.name}=X`" for each in told)


def rules_page() -> str:
    """What each event costs under each rule set."""
    kinds = sorted({kind for rules in RULES.values() for kind in rules.scored})
    costs = [(f"`{EVENT_KEYS[kind]}`", *(_cost(r, kind) for r in RULES.values())) for kind in kinds]
    facts = [
        ("how costs combine", *(rules.penalties.form.value for rules in RULES.values())),
        ("layout of `results.json`", *(rules.layout.value for rules in RULES.values())),
        (
            "route completion rounded to",
            *(
                "" if r.completion_decimals is None else r.completion_decimals
                for r in RULES.values()
            ),
        ),
        ("counts in records of world version", *(f"{r.since_world}+" for r in RULES.values())),
    ]
    endings = [
        (f"`{EVENT_KEYS[kind]}`", status)
        for kind, status in next(iter(RULES.values())).endings.items()
    ]
    names = tuple(f"`{name}`" for name in RULES)
    return page(
        "Rule sets",
        "A factor of a product, or what is added to a sum, by event. What is behind them, and "
        "CARLA's quirks: [rules](../rules.md).",
        table(("event", *names), costs),
        table(("", *names), facts),
        "## What ends a route",
        table(("event", "status"), endings),
    )


def _cost(rules: Rules, kind: Any) -> str:
    penalties = rules.penalties
    if kind in penalties.costs:
        sign = "x " if penalties.form.value == "product" else "+ "
        return f"{sign}{penalties.costs[kind]:.2f}"
    if kind not in rules.scored:
        return ""
    if EVENT_KEYS[kind] == "min_speed":
        return f"up to {penalties.min_speed:.2f}"
    return "the share of the way"


def api_page(title: str, places: Sequence[str]) -> str:
    """Docstrings of modules or of what is in them; mkdocstrings puts them in."""
    return page(title, *(f"::: {place}" for place in places))


def documented(kind: type) -> list[tuple[str, str, str, str]]:
    """Name, type, default and meaning of each field of a dataclass, by its docstring."""
    doc = parse(inspect.getdoc(kind) or "", DocstringStyle.GOOGLE)
    told = {each.arg_name: each.description or "" for each in doc.params}
    return [
        (f"`{f.name}`", f"`{f.type}`", f"`{f.default!r}`", " ".join(told[f.name].split()))
        for f in dataclasses.fields(kind)
    ]


def said_of(kind: type) -> str:
    """The first paragraph of a docstring, on one line."""
    return " ".join((inspect.getdoc(kind) or "").partition("\n\n")[0].split())


def page(title: str, *parts: str) -> str:
    """A page of parts, a blank line between two."""
    return "\n\n".join([f"# {title}", *parts]) + "\n"


def table(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(map(_cell, line))} |" for line in lines)


def _cell(value: Any) -> str:
    return str(value).replace("|", "\\|")
