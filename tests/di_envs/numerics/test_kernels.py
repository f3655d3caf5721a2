"""Kernels are cached by what they are made of: their source and all that it builds on."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from di_envs.numerics import kernels
from di_envs.numerics.kernels import cpu_capability, kernel_sources, sources_digest

ROOT = Path(kernels.__file__).parents[2]

# A package like ours: `top` imports `middle`, which imports `bottom`; `other` imports none of them
MODULES = {
    "di_envs.top": "from di_envs.middle import two\n",
    "di_envs.middle": "from di_envs.bottom import one\n",
    "di_envs.bottom": "one = 1\n",
    "di_envs.other": "import numpy\n",
}


@pytest.fixture
def digest_of(monkeypatch):
    """Digests of the modules above, some with other text."""

    def digest(module: str, **changed: str) -> str:
        texts = {**MODULES, **{f"di_envs.{name}": text for name, text in changed.items()}}

        def source(name: str) -> tuple[bytes, tuple[str, ...]]:
            text = texts[name].encode()
            found = {match.decode() for match in kernels._IMPORT.findall(text)}
            return text, tuple(sorted(found))

        monkeypatch.setattr(kernels, "_source", source)
        return sources_digest.__wrapped__(f"di_envs.{module}")

    return digest


def test_the_digest_changes_with_the_module_and_with_what_it_builds_on(digest_of):
    before = digest_of("top")
    assert digest_of("top") == before
    assert digest_of("top", top=MODULES["di_envs.top"] + "# changed\n") != before
    assert digest_of("top", middle=MODULES["di_envs.middle"] + "three = 3\n") != before
    assert digest_of("top", bottom="one = 2\n") != before


def test_the_digest_stays_when_a_module_changes_that_it_does_not_build_on(digest_of):
    before = digest_of("top")
    assert digest_of("top", other="import math\n") == before
    assert digest_of("bottom", top="", middle="") == digest_of("bottom")


def test_modules_that_import_each_other_have_a_digest_too(digest_of):
    bottom = "from di_envs.top import zero\n"
    assert digest_of("top", bottom=bottom) != digest_of("top")


def test_numba_and_the_cpu_are_part_of_the_digest(digest_of, monkeypatch):
    before = digest_of("top")
    with monkeypatch.context() as patch:
        patch.setattr(kernels, "cpu_capability", lambda: "another")
        assert digest_of("top") != before
    monkeypatch.setattr(kernels.numba, "__version__", "0.0")
    assert digest_of("top") != before


def test_the_digest_of_a_tick_covers_every_module_that_a_tick_runs():
    """Found by reading the imports, compared with what Python loaded for it."""
    script = (
        "import sys; before = set(sys.modules); import di_envs.world.step\n"
        "print(*(n for n in set(sys.modules) - before if n.startswith('di_envs.')))"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd=ROOT
    )
    seen, todo = set(), ["di_envs.world.step"]
    while todo:
        name = todo.pop()
        if name not in seen:
            seen.add(name)
            todo += kernels._source(name)[1]
    names = {".".join(p.relative_to(ROOT).with_suffix("").parts) for p in kernel_sources()}
    assert set(loaded.stdout.split()) & names <= seen


def test_every_kernel_of_ours_can_be_found():
    names = {path.relative_to(ROOT).as_posix() for path in kernel_sources()}
    folders = (
        "numerics",
        "sensors/camera",
        "sensors/lidar",
        "town",
        "world/traffic",
        "world/walkers",
    )
    for folder in (*(f"di_envs/{name}" for name in folders), "agents/expert"):
        assert any(name.startswith(f"{folder}/") for name in names), folder
    assert {"di_envs/world/step.py", "di_envs/prompt_filling.py"} <= names
    assert "di_envs/town/town.py" not in names


def test_the_capability_names_the_cpu_and_hides_nothing():
    assert cpu_capability() == cpu_capability()
    name, digest = cpu_capability().rsplit("-", 1)
    assert name
    assert len(digest) == 8


def test_intels_vector_library_is_off_before_numba_loads():
    script = "import di_envs.numerics.kernels, numba; print(numba.config.DISABLE_INTEL_SVML)"
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_DISABLE_INTEL_SVML"}
    out = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
        env=environment,
    )
    assert out.stdout.strip() in ("1", "True")
