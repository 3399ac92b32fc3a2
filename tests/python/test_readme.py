"""The scripts of the package's README run as printed, and a stranger can read them: at most thirty lines each."""

import os
import subprocess
import sys

import pytest

from conftest import ROOT
from scripts import scripts_of

README = (ROOT / "clients" / "python" / "README.md").read_text()
SCRIPTS = scripts_of(README)
# Longest script, lines.
LONGEST = 30


def test_every_script_is_short():
    assert list(SCRIPTS) == ["validate.py", "plan.py", "live.py", "local.py"]
    assert max(len(script.splitlines()) for script in SCRIPTS.values()) <= LONGEST


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where they run one after the other, as a reader runs them."""
    folder = tmp_path_factory.mktemp("scripts")
    for name, script in SCRIPTS.items():
        (folder / name).write_text(script)
    return folder


@pytest.mark.parametrize(
    ("name", "told", "files"),
    [
        ("validate.py", ["warning[VIB-CHIP-UNBROKEN]", "accepted: nothing found", "breaks per revolution"], ["fixed.nc"]),
        ("plan.py", ["last point X 5.0 mm (radius), Z 20.0 mm", "the vibration reaches 0.0300 mm"], ["feed.svg", "chip.png"]),
        ("live.py", ["FEED_ABOVE_LIMIT", "WITHIN_LIMITS", "cause='DECISION'", "Ended(state='FINISHED'"], []),
        ("local.py", ["accepted", "X_mm", "mm/min"], []),
    ],
)
def test_a_script_runs_as_printed(server, folder, name, told, files):
    done = run(server, folder, sys.executable, name)
    assert done.returncode == 0, done.stderr
    for words in told:
        assert words in done.stdout, done.stdout
    assert all((folder / file).stat().st_size > 0 for file in files)


def run(server, folder, python, name):
    environment = {**os.environ, "FEEDWAVE_SERVER": f"http://{server.ports['grpc']}"}
    return subprocess.run([python, name], cwd=folder, env=environment, capture_output=True, text=True, timeout=120)


def test_an_environment_with_nothing_else_is_enough(server, folder):
    python = os.environ["FEEDWAVE_FRESH_PYTHON"]
    done = run(server, folder, python, "live.py")
    assert done.returncode == 0 and "Ended(state='FINISHED'" in done.stdout, done.stderr
    # What pictures need is said where it is missing.
    done = run(server, folder, python, "plan.py")
    assert done.returncode != 0 and "pip install 'feedwave[plot]'" in done.stderr, done.stderr


@pytest.mark.parametrize(
    ("call", "package", "extra"),
    [("to_pandas()", "pandas", "pandas"), ("to_polars()", "polars", "polars"), ("to_arrow()", "pyarrow", "arrow"), ("plot", "matplotlib", "plot")],
)
def test_what_an_extra_installs_is_said_where_it_is_missing(call, package, extra):
    script = (
        "import numpy as np, feedwave, feedwave.plot\n"
        "layout = feedwave.setpoints.Layout(('X_mm', 'Y_mm', 'feed_mm_per_min'), {}, ('X_mm', 'Y_mm'), 1000.0, 2, 'MACHINE')\n"
        "setpoints = feedwave.Setpoints(layout, 0, {name: np.ones(2) for name in layout.names}, np.ones(2, np.uint32))\n"
    )
    script += "feedwave.plot.path(setpoints)" if call == "plot" else f"setpoints.{call}"
    done = subprocess.run([os.environ["FEEDWAVE_FRESH_PYTHON"], "-c", script], capture_output=True, text=True, timeout=60)
    said = done.stderr.splitlines()[-1]
    assert said.startswith("ImportError: ") and f"need {package}: pip install 'feedwave[{extra}]'" in said, done.stderr
