"""Runs notebooks without a kernel: the cells one after the other in one namespace, with what they print and show."""

import ast
import base64
import contextlib
import io
import json
import pathlib


def run(path: pathlib.Path) -> dict:
    """The notebook as it is after it was run in its folder. What a cell raises is raised."""
    notebook = json.loads(path.read_text())
    names: dict = {"__name__": "__main__"}
    with contextlib.chdir(path.parent):
        cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
        for count, cell in enumerate(cells, 1):
            cell["execution_count"] = count
            cell["outputs"] = outputs(names, "".join(cell["source"]), f"{path.name}, cell {count}", count)
    return notebook


def outputs(names: dict, source: str, place: str, count: int) -> list:
    """What a cell prints, and what its last expression shows."""
    tree = ast.parse(source, place)
    last = ast.Expression(tree.body.pop().value) if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    printed, shown = io.StringIO(), None
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, place, "exec"), names)
        if last is not None:
            shown = eval(compile(last, place, "eval"), names)
    found = []
    if printed.getvalue():
        found.append({"output_type": "stream", "name": "stdout", "text": printed.getvalue().splitlines(keepends=True)})
    if shown is not None:
        found.append({"output_type": "execute_result", "execution_count": count, "metadata": {}, "data": forms(shown)})
    return found


def forms(value: object) -> dict:
    """A value in the forms that it has."""
    data: dict = {"text/plain": repr(value).splitlines(keepends=True)}
    if hasattr(value, "_repr_html_"):
        data["text/html"] = value._repr_html_().splitlines(keepends=True)
    if hasattr(value, "_repr_png_"):
        data["image/png"] = base64.b64encode(value._repr_png_()).decode()
        # No address of an object, which is another one each time.
        data["text/plain"] = [f"<{type(value).__name__}>"]
    return data


def write(notebook: dict, path: pathlib.Path) -> None:
    """Writes a notebook as Jupyter does."""
    path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n")
