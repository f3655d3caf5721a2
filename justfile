# What contributors run; CONTRIBUTING.md gives the same as plain commands. Whatever is said after a
# recipe of tests goes to pytest: `just leaderboard -m fast -x`.

python := "python"

[private]
default:
    @just --list --unsorted

# Tests of half a second or less, of every package: under two minutes
fast *options:
    {{python}} -m pytest -m fast {{options}}

# Every test but those marked full, as CI does
test *options:
    {{python}} -m pytest {{options}}

# Every test there is
full *options:
    {{python}} -m pytest -m "" {{options}}

# Linter, formatter and type checker, as CI does
lint:
    {{python}} -m ruff check .
    {{python}} -m ruff format --check .
    {{python}} -m mypy

# Whether pages, examples and recipes say what is so
docs *options:
    {{python}} -m pytest tests/test_docs.py tests/test_contributing.py tests/test_examples.py {{options}}

# The documentation as a site, in build/site, without warnings (extra docs)
site *options:
    {{python}} -m mkdocs build --strict {{options}}

# Draws the pictures of docs/ that need no recorded run
pictures:
    {{python}} docs/scripts/floors.py
    {{python}} -m docs.scripts.pictures
    {{python}} docs/scripts/sensor_pictures.py
    {{python}} docs/scripts/training_pictures.py
    {{python}} -m docs.scripts.page_pictures

# Tests of towns, world, sensors and environments
di_envs *options:
    {{python}} -m pytest tests/di_envs {{options}}

# Tests of the agents, their training and what explains them
agents *options:
    {{python}} -m pytest tests/agents {{options}}

# Tests of edits and of other wrappers
wrappers *options:
    {{python}} -m pytest tests/wrappers {{options}}

# Tests of scores, runs, replays, studies, pages and commands
leaderboard *options:
    {{python}} -m pytest tests/leaderboard {{options}}
