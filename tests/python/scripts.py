"""The scripts that a page prints: fences that begin with ```python NAME. `scripts.py PAGE FOLDER` writes them into files."""

import pathlib
import re
import sys


def scripts_of(page: str) -> dict[str, str]:
    """Scripts by their names, in the order of the page."""
    return dict(re.findall(r"^```python (\S+)\n(.*?)^```$", page, re.DOTALL | re.MULTILINE))


if __name__ == "__main__":
    page, folder = map(pathlib.Path, sys.argv[1:])
    for name, script in scripts_of(page.read_text()).items():
        (folder / name).write_text(script)
