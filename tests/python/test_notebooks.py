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


def shown(notebook):
    """What each cell shows: texts as they are, of pictures that there is one."""
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    return [[(output["output_type"], output.get("text"), texts(output.get("data", {}))) for output in cell["outputs"]] for cell in cells]


def texts(data):
    """The forms of a value without the bytes of pictures, which are others with every version of what draws them."""
    return {form: value if form.startswith("text/") else None for form, value in data.items()}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(server, monkeypatch, path):
    monkeypatch.setenv("FEEDWAVE_SERVER", f"http://{server.ports['grpc']}")
    done = notebooks.run(path)
    if os.environ.get("FEEDWAVE_WRITE_DOCS") == "1":
        notebooks.write(done, path)
    assert shown(done) == shown(json.loads(path.read_text())), "write it anew: FEEDWAVE_WRITE_DOCS=1 tests/python/run.sh"
    assert any("image/png" in data for outputs in shown(done) for *_, data in outputs)
