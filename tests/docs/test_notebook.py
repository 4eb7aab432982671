"""The notebook of the documentation runs from top to bottom."""

from __future__ import annotations

import ast
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient
from printed.blocks import ROOT

import kinemimic as km

NOTEBOOK = ROOT / "docs" / "run.ipynb"
BUDGET = "1_000_000"


def cells() -> list[str]:
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    return [cell.source for cell in notebook.cells if cell.cell_type == "code"]


def test_it_is_stored_without_outputs() -> None:
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(notebook)
    assert not any(cell.get("outputs") for cell in notebook.cells)


def test_it_uses_names_that_exist() -> None:
    names, methods = set(), set()
    for node in ast.walk(ast.parse("\n".join(cells()))):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            {"km": names, "walk": methods}.get(node.value.id, set()).add(node.attr)
    assert {"run", "joint_angles"} <= names <= set(km.__all__)
    assert {"train", "evaluate", "motion"} <= methods
    assert all(hasattr(km.Run, name) for name in methods)


@pytest.mark.slow
def test_it_runs(tmp_path: Path) -> None:
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    assert sum(BUDGET in cell.source for cell in notebook.cells) == 1
    for cell in notebook.cells:
        cell.source = cell.source.replace(BUDGET, "20_000")
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    assert (tmp_path / "runs/notebook/view.rrd").is_file()
