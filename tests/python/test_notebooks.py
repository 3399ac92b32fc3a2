"""There is a notebook for each machining function. It runs as it is, and shows what it says it does.

    FEEDWAVE_WRITE_DOCS=1 tests/python/run.sh

writes what the notebooks show now into them.
"""

import json
import os

import pytest

import notebooks
from conftest import ROOT

NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))


def test_every_machining_function_has_one():
    pages = sorted(page.stem for page in (ROOT / "docs" / "functions").glob("*.md"))
    assert [notebook.stem for notebook in NOTEBOOKS] == pages


def kinds(notebook):
    """What each cell shows, without the values: figures may be others after a change of the planner."""
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    return [[(output["output_type"], sorted(output.get("data", ()))) for output in cell["outputs"]] for cell in cells]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(server, monkeypatch, path):
    monkeypatch.setenv("FEEDWAVE_SERVER", f"http://{server.ports['grpc']}")
    done = notebooks.run(path)
    if os.environ.get("FEEDWAVE_WRITE_DOCS") == "1":
        notebooks.write(done, path)
    assert kinds(done) == kinds(json.loads(path.read_text()))
    assert any("image/png" in data for outputs in kinds(done) for _, data in outputs)
