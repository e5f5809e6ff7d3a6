"""The book's page of Python as a notebook: the same cells, and they run."""

import json
import os
import pathlib

import pytest

PAGE = pathlib.Path(__file__).parents[3] / "docs/src/guides/python.md"
NOTEBOOK = PAGE.with_suffix(".ipynb")


def notebook_of(page):
    """A page's Python as cells of code, and its prose as cells of text."""
    cells = []

    def add(kind, text, **more):
        lines = text.strip("\n").splitlines(keepends=True)
        if lines:
            cell = {"cell_type": kind, "id": f"cell-{len(cells)}", "metadata": {}, "source": lines}
            cells.append(cell | more)

    prose, *blocks = page.split("```python\n")
    add("markdown", prose)
    for block in blocks:
        code, prose = block.split("```\n", 1)
        add("code", code, execution_count=None, outputs=[])
        add("markdown", prose)
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    metadata = {"kernelspec": kernel, "language_info": {"name": "python"}}
    return {"cells": cells, "metadata": metadata, "nbformat": 4, "nbformat_minor": 5}


def test_the_notebook_is_the_page():
    made = json.dumps(notebook_of(PAGE.read_text(encoding="utf-8")), indent=1, ensure_ascii=False) + "\n"
    if os.environ.get("GONIA_UPDATE_DOCS"):
        NOTEBOOK.write_text(made, encoding="utf-8", newline="\n")
    assert NOTEBOOK.read_text(encoding="utf-8") == made, "GONIA_UPDATE_DOCS=1 writes the notebook"


def test_the_notebook_runs(tmp_path):
    nbformat = pytest.importorskip("nbformat")
    client = pytest.importorskip("nbclient")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(notebook)
    client.NotebookClient(notebook, resources={"metadata": {"path": tmp_path}}).execute()
    texts = [out.get("text", "") for cell in notebook.cells for out in cell.get("outputs", [])]
    assert any("gonia.Dense" in text for text in texts), texts
