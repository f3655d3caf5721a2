"""The notebooks run from their first cell to the last, at the size that they are committed with."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parent.parent
NOTEBOOKS = sorted((TOP / "docs" / "notebooks").glob("*.ipynb"))
LONG_S = 1800  # a cell may compile, on a busy machine


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of Jupyter's own packages
@pytest.mark.parametrize("path", NOTEBOOKS, ids=[path.stem for path in NOTEBOOKS])
def test_a_notebook_runs_as_it_is(path, tmp_path, monkeypatch):
    nbclient = pytest.importorskip("nbclient", reason="needs the extra notebooks")
    nbformat = pytest.importorskip("nbformat", reason="needs the extra notebooks")
    pytest.importorskip("ipykernel", reason="needs the extra notebooks")
    if path.stem == "train_a_policy":
        pytest.importorskip("torch", reason="needs the extra policy")
    place = os.pathsep.join(filter(None, (str(TOP), os.environ.get("PYTHONPATH"))))
    monkeypatch.setenv("PYTHONPATH", place)
    notebook = nbformat.read(path, as_version=4)
    client = nbclient.NotebookClient(
        notebook,
        timeout=LONG_S,
        kernel_name="python3",
        resources={"metadata": {"path": str(tmp_path)}},
    )
    client.execute()
    shown = json.dumps([cell.get("outputs", []) for cell in notebook.cells])
    assert "<table>" in shown
    assert "Warning" not in shown


def test_there_are_four_without_outputs():
    assert len(NOTEBOOKS) == 4
    for path in NOTEBOOKS:
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        assert not any(cell.get("outputs") for cell in cells), path.name
