"""The layout rules: who may import whom, between packages and inside them; what no module does."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parent.parent
ALLOWED = {
    "di_envs": {"di_envs"},
    "agents": {"di_envs", "agents"},
    "wrappers": {"di_envs", "wrappers"},
    "leaderboard": {"di_envs", "agents", "wrappers", "leaderboard"},
}
# The floors inside a package, lowest first: a module imports from its own floor and those below.
# "" stands for the modules right in the package.
FLOORS = {
    "di_envs": (
        {"numerics", "files"},
        {"town"},
        {"world"},
        {"rules", "sensors", "actions", "highway"},
        {"", "drawing", "edits", "bulk"},
    ),
    "agents": (
        {""},
        {"expert", "carla", "navigation", "sb3", "explain", "networks", "human", "llm"},
        {"driveinsight"},
        {"training", "zoo"},
    ),
    "wrappers": ({"interventions"}, {""}),
    "leaderboard": (
        {"scoring", "statistics", "autoagents", "envs", "utils", "exporting"},
        {"records"},
        {"running"},
        {"replaying"},
        {"explaining", "responding", "studies"},
        {"tables"},
        {"pages"},
        {"commands"},
        {"", "api"},
    ),
}
MODULES = sorted(path for package in ALLOWED for path in (TOP / package).rglob("*.py"))
ABSOLUTE = re.compile(r"^(/(home|work|tmp|usr|etc|root|var|mnt|opt|data)\b|[A-Za-z]:[\\/])")
# Modules that ask the environment, and why they may
ASKING = {
    "agents/carla/importing.py": "agents for CARLA read what its scripts say by them",
    "leaderboard/exporting/carla_file.py": "it starts a Python, with its own packages, in CARLA's",
    "agents/processes.py": "Python is told by one to look for no module in the working folder",
    "di_envs/drawing/window.py": "a desktop says by one that there is a display",
    "di_envs/files/caches.py": "who runs a container says by one where caches may be written",
    "di_envs/numerics/kernels.py": "Numba is told by one, before it loads, to keep bits equal",
    "leaderboard/running/workers/ray_engine.py": "Ray is told by one to report nobody's usage",
    "agents/training/distributed.py": "torchrun tells its processes which of how many they are",
}


def relative(path):
    return path.relative_to(TOP).as_posix()


def module_name(path):
    parts = path.relative_to(TOP).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def parsed(path):
    return ast.parse(path.read_text(encoding="utf-8"))


NAMES = {module_name(path) for path in MODULES}


def imported(tree) -> Iterator[str]:
    """Dotted names of all modules that a module imports, anywhere in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"line {node.lineno}: say the whole name, not a relative one"
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in NAMES else str(node.module)


@cache
def our_imports() -> Mapping[str, tuple[str, ...]]:
    """Of each module, the modules of ours that it imports."""
    return {
        module_name(path): tuple(sorted({n for n in imported(parsed(path)) if n in NAMES}))
        for path in MODULES
    }


def dotted(node):
    """`np.random.seed` of an attribute chain; empty for others."""
    parts = []
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    return ".".join([node.id, *reversed(parts)]) if isinstance(node, ast.Name) else ""


@cache
def floor_of(module):
    """On which floor of its package a module stands."""
    package, _, rest = module.partition(".")
    room = rest.partition(".")[0]
    if (TOP / package / f"{room}.py").is_file():
        room = ""  # a module right in the package, not a folder
    floors = FLOORS[package]
    found = [number for number, rooms in enumerate(floors) if room in rooms]
    assert found, f"{module}: say in FLOORS on which floor '{room}' stands"
    return found[0]


def upward(imports: Mapping[str, tuple[str, ...]]) -> list[str]:
    """Every import of a higher floor of the same package, and of a package that may not be."""
    wrong = []
    for module, names in imports.items():
        package = module.partition(".")[0]
        for name in names:
            other = name.partition(".")[0]
            up = other == package and name != package and floor_of(name) > floor_of(module)
            if up or other not in ALLOWED[package]:
                wrong.append(f"{module} imports {name}")
    return wrong


def circles(imports: Mapping[str, tuple[str, ...]]) -> list[str]:
    """Modules that import themselves by way of others, each with the way."""
    found, done = [], set()

    def visit(module, way):
        if module in way:
            found.append(" -> ".join([*way[way.index(module) :], module]))
        elif module not in done:
            for name in imports.get(module, ()):
                visit(name, [*way, module])
            done.add(module)

    for module in imports:
        visit(module, [])
    return found


def every(wrong) -> str:
    return "\n".join(wrong)


def test_imports_go_one_way_and_never_upwards():
    wrong = upward(our_imports())
    assert not wrong, every(wrong)


def test_no_module_imports_itself_by_way_of_others():
    wrong = circles(our_imports())
    assert not wrong, every(wrong)


def test_a_module_says_first_what_it_is_for():
    wrong = []
    for path in MODULES:
        first = (ast.get_docstring(parsed(path)) or "").partition("\n")[0]
        if len(first) <= 15 or not (first[0].isupper() or first[0] in "`0123456789"):
            wrong.append(f"{relative(path)}: '{first}'")
    assert not wrong, every(wrong)


def test_no_module_uses_global_randomness():
    wrong = []
    for path in MODULES:
        for node in ast.walk(parsed(path)):
            name = dotted(node)
            ours = name.startswith(("np.random.", "numpy.random.")) and (
                not name.split(".")[2][0].isupper()  # a generator of one's own is a value
            )
            # Python's own module hides a generator too
            if ours or (name.startswith("random.") and not name.startswith("random.Random")):
                wrong.append(f"{relative(path)}:{node.lineno}: {name}")
        if "numpy.random" in imported(parsed(path)):
            wrong.append(f"{relative(path)} imports numpy.random")
    assert not wrong, every(wrong)


def test_no_module_knows_an_absolute_path():
    wrong = [
        f"{relative(path)}:{node.lineno}: {node.value}"
        for path in MODULES
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and ABSOLUTE.match(node.value)
    ]
    assert not wrong, every(wrong)


def test_no_module_asks_environment_variables():
    wrong = [
        f"{relative(path)}:{node.lineno}: {dotted(node)}; pass it as an option"
        for path in MODULES
        if relative(path) not in ASKING
        for node in ast.walk(parsed(path))
        if dotted(node) in ("os.environ", "os.getenv", "os.environ.get")
    ]
    assert not wrong, every(wrong)


def test_every_folder_of_code_is_a_package():
    folders = {path.parent for path in MODULES}
    assert {name.partition(".")[0] for name in NAMES} == set(ALLOWED)
    assert {folder for folder in folders if not (folder / "__init__.py").is_file()} == set()


# The rules themselves, put to the test


@pytest.mark.parametrize(
    ("module", "name"),
    [
        ("leaderboard.scoring.score", "leaderboard.pages.markup"),
        ("leaderboard.records.record", "leaderboard.running.jobs"),
        ("di_envs.world.step", "di_envs.route_env"),
        ("di_envs.town.lanes", "di_envs.world.state"),
        ("di_envs.config", "agents.base"),
        ("agents.base", "agents.training.collect"),
        ("wrappers.interventions.edit", "wrappers.actions"),
    ],
)
def test_an_import_of_a_higher_floor_is_found(module, name):
    assert {module, name} <= NAMES
    before = our_imports()
    after = {**before, module: (*before[module], name)}
    assert upward(after) == [f"{module} imports {name}"]


def test_a_circle_is_found_with_its_way():
    ways = {"a": ("b",), "b": ("c",), "c": ("b", "d"), "d": ()}
    assert circles(ways) == ["b -> c -> b"]
