"""The layout rules: who may import whom, and what no module does."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parent.parent
ALLOWED = {
    "di_envs": {"di_envs"},
    "agents": {"di_envs", "agents"},
    "wrappers": {"di_envs", "wrappers"},
    "leaderboard": {"di_envs", "agents", "wrappers", "leaderboard"},
}
MODULES = sorted(path for package in ALLOWED for path in (TOP / package).rglob("*.py"))
NAMES = [str(path.relative_to(TOP)) for path in MODULES]
ABSOLUTE = re.compile(r"^(/(home|work|tmp|usr|etc|root|var|mnt|opt|data)\b|[A-Za-z]:[\\/])")


def each_module():
    return pytest.mark.parametrize("path", MODULES, ids=NAMES)


def parsed(path):
    return ast.parse(path.read_text(encoding="utf-8"))


def imported_names(tree):
    """Dotted names of all modules that a module imports, anywhere in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"line {node.lineno}: say the whole name, not a relative one"
            yield str(node.module)


def dotted(node):
    """`np.random.seed` of an attribute chain; empty for others."""
    parts = []
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    return ".".join([node.id, *reversed(parts)]) if isinstance(node, ast.Name) else ""


def test_there_are_modules_to_look_at():
    assert {name.split("/")[0] for name in NAMES} == set(ALLOWED)


@each_module()
def test_imports_go_one_way(path):
    package = path.relative_to(TOP).parts[0]
    ours = {name.split(".")[0] for name in imported_names(parsed(path))} & ALLOWED.keys()
    assert ours <= ALLOWED[package]


@each_module()
def test_a_module_says_first_what_it_is_for(path):
    text = ast.get_docstring(parsed(path))
    assert text, "no docstring"
    first = text.splitlines()[0]
    assert len(first) > 15, first
    assert first[0].isupper() or first[0] in "`0123456789", first


@each_module()
def test_no_module_uses_numpys_global_randomness(path):
    for node in ast.walk(parsed(path)):
        name = dotted(node)
        if name.startswith(("np.random.", "numpy.random.")):
            is_class = name.split(".")[2][0].isupper()  # a generator of one's own is a value
            assert is_class, f"line {node.lineno}: {name} is a function of the module"
        # Python's own module hides a generator too
        assert not name.startswith("random.") or name.startswith("random.Random"), name
    assert "numpy.random" not in imported_names(parsed(path))


@each_module()
def test_no_module_knows_an_absolute_path(path):
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            assert not ABSOLUTE.match(node.value), f"line {node.lineno}: {node.value}"


@each_module()
def test_no_module_asks_environment_variables(path):
    if path == TOP / "di_envs" / "kernels.py":
        pytest.skip("Numba is told by one, before it loads, to keep bits equal everywhere")
    if path == TOP / "leaderboard" / "ray_engine.py":
        pytest.skip("Ray is told by one, before it loads, to report nobody's usage")
    if path == TOP / "agents" / "training" / "distributed.py":
        pytest.skip("torchrun tells its processes by them which of how many they are")
    for node in ast.walk(parsed(path)):
        name = dotted(node)
        if name in ("os.environ", "os.getenv", "os.environ.get"):
            pytest.fail(f"line {node.lineno}: {name}; pass it as an option")


def test_every_folder_of_code_is_a_package():
    folders = {path.parent for path in MODULES}
    assert {folder for folder in folders if not (folder / "__init__.py").is_file()} == set()
