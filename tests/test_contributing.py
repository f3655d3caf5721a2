"""The contributor's loop is there: recipes, plain commands and CI name what exists."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tests.test_layout import ALLOWED

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

TOP = Path(__file__).resolve().parent.parent
PACKAGES = tuple(ALLOWED)
JUSTFILE = (TOP / "justfile").read_text(encoding="utf-8")
CONTRIBUTING = (TOP / "CONTRIBUTING.md").read_text(encoding="utf-8")
WORKFLOW = TOP / ".github" / "workflows" / "ci.yml"
SETTINGS = tomllib.loads((TOP / "pyproject.toml").read_text(encoding="utf-8"))
RECIPE = re.compile(
    r"^# (?P<said>.+)\n(?P<name>\w+)(?: \*options)?:\n(?P<lines>(?:    .+\n)+)", re.M
)
JUST = shutil.which("just") or shutil.which("just", path=str(Path(sys.executable).parent))


def recipes():
    """Of each public recipe its commands, plain."""
    return {
        found["name"]: [
            line.strip().replace("{{python}}", "python").replace(" {{options}}", "")
            for line in found["lines"].splitlines()
        ]
        for found in RECIPE.finditer(JUSTFILE)
    }


def told_commands():
    """Of each recipe the command that CONTRIBUTING gives beside it."""
    return dict(re.findall(r"^\| `just (\w+)` \| `([^`]+)` \|", CONTRIBUTING, re.MULTILINE))


def check_command(command):
    """Asserts that a command's module, files and marks exist."""
    words = shlex.split(command)
    assert words[0] == "python", command
    names = words[1:]
    if names[0] == "-m":
        ours = TOP / f"{names[1].replace('.', '/')}.py"
        assert names[1] in ("pytest", "ruff", "mypy", "mkdocs") or ours.is_file(), command
        names = names[2:]
    if "-m" in names:
        mark = names[names.index("-m") + 1]
        marks = {
            said.partition(":")[0] for said in SETTINGS["tool"]["pytest"]["ini_options"]["markers"]
        }
        assert mark in {"", *marks}, command
    for name in names:
        if "/" in name:
            assert (TOP / name).exists(), command


def test_every_recipe_has_a_comment_and_commands_that_exist():
    named = set(re.findall(r"^(\w+)(?: \*options)?:$", JUSTFILE, re.MULTILINE)) - {"default"}
    assert named == set(recipes())
    for commands in recipes().values():
        for command in commands:
            check_command(command)


def test_there_is_a_recipe_for_each_class_of_tests_and_each_package():
    assert {"fast", "test", "full", "lint", "docs", *PACKAGES} <= set(recipes())
    for package in PACKAGES:
        assert recipes()[package] == [f"python -m pytest tests/{package}"]


def test_contributing_gives_the_plain_command_of_each_recipe():
    told = told_commands()
    rest = set(recipes()) - set(told)
    assert rest == set(PACKAGES) - {"di_envs"}  # one stands for the four
    assert set(re.findall(r"`just (\w+)", CONTRIBUTING)) == set(recipes())
    for name, command in told.items():
        assert command.split(" && ") == recipes()[name], name


def test_contributing_says_how_to_add_each_thing_in_a_few_lines():
    for title in ("An agent", "An edit of what an agent sees", "A rule set", "A sensor", "A town"):
        told = CONTRIBUTING.partition(f"\n## {title}\n")[2].partition("\n## ")[0]
        assert "Copy " in told or "copy " in told, title
        assert len(told.strip().splitlines()) <= 20, title


def test_contributing_sets_up_as_the_readme_does():
    readme = (TOP / "README.md").read_text(encoding="utf-8")
    line = next(line for line in CONTRIBUTING.splitlines() if line.startswith("python3 -m venv"))
    assert f"{line} && .venv/bin/python -m pytest" in readme


@pytest.mark.skipif(JUST is None, reason="needs just, which the extra test brings along")
def test_just_lists_the_recipes_with_what_they_do():
    listed = subprocess.run([JUST, "--list"], capture_output=True, text=True, check=True, cwd=TOP)
    for found in RECIPE.finditer(JUSTFILE):
        assert re.search(
            rf"^ +{found['name']} .*# {re.escape(found['said'])}$", listed.stdout, re.M
        )


def test_the_workflow_runs_what_is_there_on_a_python_that_is_claimed():
    job = yaml.safe_load(WORKFLOW.read_text(encoding="utf-8"))["jobs"]["ci"]
    commands = [step["run"] for step in job["steps"] if "run" in step]
    assert commands == [".ci/run"]
    assert os.access(TOP / commands[0], os.X_OK)
    (python,) = (step["with"]["python-version"] for step in job["steps"] if "with" in step)
    assert SETTINGS["project"]["requires-python"] == ">=3.10,<3.14"
    assert python == "3.11"
    claimed = re.findall(r"Python :: (3\.\d+)", str(SETTINGS["project"]["classifiers"]))
    assert claimed == ["3.10", "3.11", "3.12", "3.13"]


def test_the_citation_names_the_paper_and_this_version():
    cited = yaml.safe_load((TOP / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["version"] == SETTINGS["project"]["version"]
    assert cited["license"] == SETTINGS["project"]["license"]
    paper = cited["preferred-citation"]
    assert (paper["authors"][0]["family-names"], len(paper["authors"])) == ("Li", 9)
    assert paper["title"] == "Exploring the Causality of End-to-End Autonomous Driving"
