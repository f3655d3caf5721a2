"""The documentation says what is so: its commands parse, its snippets run, its tables agree."""

from __future__ import annotations

import dataclasses
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import tyro

import di_envs
from agents import AGENTS, load_agent
from agents.base import Requirements
from di_envs.edits.conditions import Condition
from di_envs.edits.text import read_edits
from di_envs.edits.world import WORLD_EDITS, read_world_edits
from di_envs.observation import observation_space
from di_envs.reward import Standing, reward_terms
from di_envs.rules import CARLA_1_0
from di_envs.suites import suite_names
from di_envs.world.state import EVENT_KINDS, EventKind
from leaderboard.commands.cli import Command, Evaluate
from leaderboard.commands.train import Train
from leaderboard.running.driver import Driver
from leaderboard.running.jobs import Job, RunSpec
from wrappers.interventions import EDITS, ObservationEditing

TOP = Path(__file__).resolve().parent.parent
PAGES = sorted([*TOP.glob("*.md"), *TOP.glob("docs/*.md"), *TOP.glob("benchmarks/*.md")])
PACKAGES = ("di_envs", "agents", "wrappers", "leaderboard")
FOLDERS = (*PACKAGES, "driveinsight", "tests", "docs", "examples", "benchmarks")
BRANCHING = (TOP / "docs" / "branching.md").read_text(encoding="utf-8")
AGENTS_PAGE = (TOP / "docs" / "agents.md").read_text(encoding="utf-8")
TRAINING = (TOP / "docs" / "training.md").read_text(encoding="utf-8")
EDITS_PAGE = (TOP / "docs" / "interventions.md").read_text(encoding="utf-8")
LEARNING = (TOP / "docs" / "learning.md").read_text(encoding="utf-8")
README = (TOP / "README.md").read_text(encoding="utf-8")
CONVENTIONS = (TOP / "docs" / "conventions.md").read_text(encoding="utf-8")


def blocks(text, language):
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def shell_commands(program, page=README):
    """The command lines of a page that run a program, without their comments."""
    for block in blocks(page, "sh"):
        for line in block.replace("\\\n", " ").splitlines():
            for part in line.split("&&"):
                words = shlex.split(part, comments=True)
                if words and words[0].rpartition("/")[2] == program:
                    yield words[1:]


def rows(text, columns):
    """Rows of tables of so many columns whose first cell names something in backticks."""
    found = {}
    for line in text.splitlines():
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip("| "))]
        if len(cells) == columns and cells[0].startswith("`"):
            for name in re.findall(r"`([^`]+)`", cells[0]):
                found[name] = cells[1:]
    return found


@pytest.mark.parametrize("number", range(len(blocks(README, "python"))))
def test_the_readmes_python_runs(number):
    code = blocks(README, "python")[number]
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr


def test_the_python_of_the_page_on_branching_runs():
    (code,) = blocks(BRANCHING, "python")
    exec(code, {})  # our own text


def test_the_page_on_branching_says_who_is_hit_when():
    spec = RunSpec(agent="expert-blind", options={"suite": "town05_tiny", "route_ids": ("60",)})
    with Driver(spec) as driver:
        record = driver.drive(Job(index=0, route_id="60", seed=0))
    (hit,) = (event for event in record.events if event.kind == EventKind.COLLISION_VEHICLE)
    assert f"actor {hit.other}, {hit.time_s:g} s into the drive" in " ".join(BRANCHING.split())
    assert hit.other_type == "vehicle.bus"


def test_the_edits_of_the_page_on_branching_can_be_read():
    texts = [line.split("`")[1] for line in BRANCHING.splitlines() if line.startswith("| `")]
    named = {f"{edit.verb}:{edit.target}" for text in texts for edit in read_edits(text)}
    assert named == set(WORLD_EDITS)
    assert all(len(read_world_edits(text)) == 1 for text in texts)


@pytest.mark.parametrize("number", range(len(blocks(AGENTS_PAGE, "python"))))
def test_the_python_of_the_page_on_agents_runs(number, tmp_path):
    code = blocks(AGENTS_PAGE, "python")[number]
    if "stable_baselines3" in code:
        pytest.importorskip("stable_baselines3", reason="needs the extra rl")
    (tmp_path / "examples").symlink_to(TOP / "examples")
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(TOP), "OMP_NUM_THREADS": "1"},
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("number", range(len(blocks(EDITS_PAGE, "python"))))
def test_the_python_of_the_page_on_interventions_runs(number, tmp_path):
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", blocks(EDITS_PAGE, "python")[number]],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(TOP)},
    )
    assert done.returncode == 0, done.stderr


ALONE = [
    (page, number)
    for page in ("environments", "python")
    for number in range(len(blocks((TOP / "docs" / f"{page}.md").read_text("utf-8"), "python")))
]


@pytest.mark.parametrize(("page", "number"), ALONE)
def test_each_snippet_of_these_pages_runs_alone(page, number, tmp_path):
    code = blocks((TOP / "docs" / f"{page}.md").read_text("utf-8"), "python")[number]
    code = code.replace("num_envs=16", "num_envs=2").replace(
        "while env.agents:", "for _ in range(3):"
    )
    (tmp_path / "snippet.py").write_text(code, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-W", "error", "snippet.py"],
        capture_output=True,
        text=True,
        check=False,
        timeout=1200,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(TOP), "OMP_NUM_THREADS": "1"},
    )
    assert done.returncode == 0, done.stderr


LEARNERS = dict(
    zip(
        re.findall(r"^## (.+)\n(?:(?!^## ).*\n)*?```python", LEARNING, flags=re.MULTILINE),
        blocks(LEARNING, "python"),
        strict=True,
    )
)
IN_CI = "Stable-Baselines3: PPO"


def skip_without_packages(code):
    """Skips where what an example imports of others is not here, with what is missing."""
    lines = re.findall(r"^(?:from|import) .+", code, flags=re.MULTILINE)
    theirs = [line for line in lines if re.split(r"[ .]", line)[1] not in PACKAGES]
    done = subprocess.run(
        [sys.executable, "-c", "\n".join(theirs)],
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    if "ModuleNotFoundError" in done.stderr:
        missing = done.stderr.strip().splitlines()[-1]
        pytest.skip(f"{missing}; docs/learning.md says how to install it")


def learned(code, folder):
    """Runs an example of the page on learning, cut short; returns the agents that it wrote."""
    short = re.sub(r"\b(8_192|4_096|2_048)\b", "512", code).replace(
        "DRIVES, STEPS = 32", "DRIVES, STEPS = 2"
    )
    assert short != code, "the example does not say how long it trains"
    (folder / "learner.py").write_text(short, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "learner.py"],
        capture_output=True,
        text=True,
        check=False,
        timeout=1200,
        cwd=folder,
        env={
            **os.environ,
            **{"PYTHONPATH": str(TOP), "OMP_NUM_THREADS": "1"},
        },
    )
    assert done.returncode == 0, done.stderr
    models = [f"sb3:{path}" for path in sorted(folder.glob("*.zip"))]
    return models + [f"pickled:{path}" for path in sorted(folder.glob("policies/*.pickle"))]


def check_learner(title, folder):
    """Asserts that an example leaves agents, before and after, that can be scored."""
    specs = learned(LEARNERS[title], folder)
    assert len(specs) >= 2
    env = di_envs.RouteEnv(suite="town05_tiny", observations=("prompt",), traffic=4, walkers=0)
    observation, _ = env.reset(seed=0)
    controls = []
    for spec in specs:
        agent = load_agent(spec)
        assert agent.requires.preset == "flat"
        control, _ = agent.act(observation, agent.start(env.plan, 0))
        assert control in env.action_space
        controls.append(control.tolist())
    assert controls[0] != controls[1]  # it has learned something


def test_the_first_example_of_the_page_on_learning_trains_an_agent(tmp_path):
    pytest.importorskip("stable_baselines3", reason="needs the extra rl")
    check_learner(IN_CI, tmp_path)


@pytest.mark.parametrize("title", [title for title in LEARNERS if title != IN_CI])
def test_every_other_example_of_the_page_on_learning_trains_an_agent(title, tmp_path):
    skip_without_packages(LEARNERS[title])
    check_learner(title, tmp_path)


def test_scores_on_the_page_on_learning_are_of_its_examples_as_they_stand():
    found = re.findall(
        r"^\| (.+?)(?: \(`\w+`\))? \| ([\d,]+) \|(?: [\d.]+ \|){3}$", LEARNING, re.MULTILINE
    )
    assert dict(found).keys() == LEARNERS.keys()
    for title, told in found:
        (steps,) = re.findall(
            r"^(?:\w+, )*STEPS(?:, \w+)* = ([\d_]+)", LEARNERS[title], re.MULTILINE
        )
        assert told == steps.replace("_", ",")


def test_the_tables_of_edits_and_conditions_are_what_there_is():
    space = observation_space(("prompt", "camera", "lidar"))
    told = [name for name in rows(EDITS_PAGE, 2) if ":" in name]
    assert {name.partition(":")[0] for name in told} == set(EDITS)
    for name in told:
        ObservationEditing(name, space)
    conditions = [name for name in rows(EDITS_PAGE, 2) if name.startswith("@")]
    assert len(conditions) == 4
    for name in conditions:
        assert f"@{Condition.of(name[1:])}" == name


def test_the_readmes_agent_is_one():
    code = next(block for block in blocks(README, "python") if "class Creep" in block)
    names = {}
    exec(code, names)  # our own text, just above
    agent = names["Creep"]()
    assert isinstance(agent.requires, Requirements)
    env = di_envs.RouteEnv(suite="toy", observations=agent.requires.observations)
    observation, _ = env.reset(seed=0)
    memory = agent.start(env.plan, 0)
    for _ in range(60):
        control, memory = agent.act(observation, memory)
        observation, *_ = env.step(control)
    assert 1.0 < observation["speed"][0] < 4.0


def test_the_readmes_commands_parse_and_name_what_there_is():
    commands = [tyro.cli(Command, args=words) for words in shell_commands("driveinsight")]
    assert len(commands) >= 5
    for command in commands:
        if isinstance(command, Evaluate):
            name = command.agent.rpartition(":")[0]
            assert command.agent in AGENTS or (TOP / name).is_file(), command.agent
            assert command.suite in suite_names() or (command.town and command.routes)


def test_the_commands_of_every_page_parse():
    for page in PAGES:
        for words in shell_commands("driveinsight", page.read_text(encoding="utf-8")):
            if "..." not in words and not words[0].startswith("--"):
                tyro.cli(Command, args=words)


def test_the_commands_of_the_page_on_training_parse_and_name_configurations_there_are():
    from agents.driveinsight.config import CONFIGS

    commands = [tyro.cli(Command, args=words) for words in shell_commands("driveinsight", TRAINING)]
    trained = [command.config for command in commands if isinstance(command, Train)]
    assert len(trained) >= 3
    assert set(trained) <= set(CONFIGS)
    assert set(CONFIGS) <= set(re.findall(r"`([^`\n]+)`", TRAINING))


def test_the_page_on_training_tells_every_kind_of_stage_what_it_makes_and_what_can_be_set(tmp_path):
    pytest.importorskip("torch", reason="needs the extra policy")
    from agents.training.recipes.recipe import read_recipe
    from agents.training.recipes.table import STAGE_KINDS

    told = rows(TRAINING, 3)
    made = {name: how.makes for name, how in STAGE_KINDS.items()}
    assert {name: told[name][-1] for name in made if name in told} == made
    for kind in STAGE_KINDS.values():
        for field in dataclasses.fields(kind.settings):
            assert f"`{field.name}`" in TRAINING or f"{field.name} =" in TRAINING, field.name
    example, *_ = blocks(TRAINING, "toml")
    (tmp_path / "example.toml").write_text(example, encoding="utf-8")
    assert [stage.name for stage in read_recipe(tmp_path / "example.toml").stages][-1] == "policy-4"


def test_the_test_command_follows_its_marker_on_one_line():
    after = README.partition("<!-- test-command -->")[2]
    command = next(line for line in after.splitlines() if line.startswith("python3 "))
    assert command.split(" && ")[0] == "python3 -m venv .venv"
    assert command.endswith(".venv/bin/python -m pytest")
    assert (TOP / "constraints.txt").is_file()


def test_the_readme_names_every_environment_and_no_other():
    assert set(re.findall(r"DriveInsight-\w+-v\d+", README)) == set(di_envs.ENVIRONMENTS)


def told_now(page):
    """A page's text; of the changes, without the column that says what was before."""
    text = page.read_text(encoding="utf-8")
    return re.sub(r"^\| `[^|]*", "", text, flags=re.MULTILINE) if page.stem == "CHANGELOG" else text


def lost_paths(text):
    """Paths that a text names and that are not there; in backticks their end is enough."""
    whole = set(re.findall(rf"(?<![\w/.])(?:{'|'.join(FOLDERS)})/[\w/.-]*\w", text))
    ends = set(re.findall(r"`([\w/]+\.py)`", text)) - whole
    files = [f"/{path.relative_to(TOP).as_posix()}" for path in TOP.rglob("*.py")]
    lost = {name for name in whole if not (TOP / name).exists()}
    return sorted(lost | {end for end in ends if not any(f.endswith(f"/{end}") for f in files)})


def lost_modules(text):
    """Dotted names of ours that a text says and that lead to no module, or to nothing in it."""
    said = re.findall(rf"(?<![\w/.-])(?:{'|'.join(PACKAGES)})(?:\.\w+)+\b(?!\()", text)
    return sorted({name for name in said if not name.endswith((".md", ".py")) and is_lost(name)})


def is_lost(name):
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        place = TOP.joinpath(*parts[:count])
        for file in (place.with_suffix(".py"), place / "__init__.py"):
            if file.is_file():
                rest = parts[count:]
                return bool(rest) and not re.search(rf"\b{rest[0]}\b", file.read_text("utf-8"))
    return True


def misplaced(text):
    """What is said to stand in a file, "`name` in `folder/file.py`", and does not."""
    said = re.findall(r"`(\w+)`\s+in\s+`([\w/]+\.py)`", text)
    return sorted(
        f"{name} in {file}"
        for name, file in said
        if not re.search(
            rf"^(class |def |    def )?{name}\b", (TOP / file).read_text("utf-8"), re.M
        )
    )


@pytest.mark.parametrize("page", PAGES, ids=[str(page.relative_to(TOP)) for page in PAGES])
def test_links_files_and_modules_that_a_page_names_are_there(page):
    text = told_now(page)
    for target in re.findall(r"\]\(([^)#:]+)\)", text):
        assert (page.parent / target).exists(), target
    assert lost_paths(text) == []
    assert lost_modules(text) == []
    assert misplaced(text) == []


def test_what_a_page_names_wrongly_is_found():
    assert lost_paths("see `di_envs/route_env.py`, `traffic/motion.py`, `motion.py`") == []
    assert lost_paths("see di_envs/rout_env.py and `traffic/otion.py`") == [
        "di_envs/rout_env.py",
        "traffic/otion.py",
    ]
    assert lost_modules("`di_envs.route_env.RouteEnv`, di_envs.save(env), agents.md") == []
    assert lost_modules("`di_envs.routes`, `agents.base.Agnt`") == [
        "agents.base.Agnt",
        "di_envs.routes",
    ]
    assert misplaced("`load_agent` in `agents/loading.py`, `EDITS` in\n`agents/base.py`") == [
        "EDITS in agents/base.py"
    ]


def test_the_page_on_architecture_names_every_folder_of_code():
    text = (TOP / "docs" / "architecture.md").read_text(encoding="utf-8")
    for file in [file for name in PACKAGES for file in (TOP / name).rglob("*/__init__.py")]:
        folder = file.parent.relative_to(TOP)
        assert re.search(rf"`(\w+/)*{folder.name}/", text), f"nothing is said of {folder}"


def test_the_table_of_observations_is_the_space():
    told = rows(CONVENTIONS, 4)
    for name, space in observation_space(("prompt", "inertial")).items():
        shape, kind, text = told[name]
        assert shape == str(space.shape), name
        assert kind == str(np.dtype(space.dtype)), name
        if isinstance(space, gymnasium.spaces.Box):
            for limit in np.unique(space.high):
                shown = {np.float32(np.pi): "π", np.float32(2 * np.pi): "2π", 1e4: "10 000"}
                assert shown.get(limit, f"{limit:g}") in text, (name, limit)


def test_the_tables_of_events_and_rewards_are_the_rules():
    told = rows(CONVENTIONS, 3)
    assert {kind.name.lower() for kind in EventKind} <= told.keys()
    for kind, factor in CARLA_1_0.penalties.costs.items():
        assert told[kind.name.lower()][-1] == f"score x {factor:.2f}"
    still = Standing(0.0, 0.0, (0,) * EVENT_KINDS)
    assert reward_terms(still, still, CARLA_1_0.penalties).keys() <= rows(CONVENTIONS, 2).keys()
