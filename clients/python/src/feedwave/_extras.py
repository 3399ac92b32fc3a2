"""What is used where it is installed: the extras of the package."""

from __future__ import annotations

import importlib
from typing import Any


def extra(module: str, name: str, purpose: str) -> Any:
    """A module of an extra.

    Args:
        module: the module, as in `matplotlib.figure`.
        name: the extra that installs it, as in `plot`.
        purpose: what it is for, as the beginning of a sentence: `pictures`.

    Raises:
        ImportError: where it is not installed, with the command that installs it. What it lacks itself is told as it is.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        package = module.partition(".")[0]
        if error.name != package:
            raise
        raise ImportError(f"{purpose} need {package}: pip install 'feedwave[{name}]'", name=package) from error
