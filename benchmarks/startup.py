"""(e) What a user waits for: start-up, and the first compilation on a new machine."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from measure import Report, timed

HELP = [str(Path(sys.executable).parent / "signlin"), "--help"]
IMPORT = [sys.executable, "-c", "import signlin_ros.linearization"]
LINEARIZE_CODE = """
from signlin_ros.model import Model
from signlin_ros.linearization import linearize
linearize(Model.load("dc_motor"), [0.4, 20.0])
"""
SIMULATE_CODE = """
import sys, numpy as np
from signlin_ros.model import Model
from signlin_ros.simulation import simulate
model = Model.load("dc_motor").with_options(operating_point="midpoint")
simulate(model, np.arange(10) * 0.1, np.ones((10, 1)), kind=sys.argv[1])
"""
LINEARIZE = [sys.executable, "-c", LINEARIZE_CODE]
SIMULATE = [sys.executable, "-c", SIMULATE_CODE]
KINDS = ("exact", "smooth", "piecewise")


def start(command: list[str], cache: str = "") -> None:
    """Run a command to its end; it must succeed."""
    env = {**os.environ, **({"NUMBA_CACHE_DIR": cache} if cache else {})}
    subprocess.run(command, check=True, env=env, stdout=subprocess.DEVNULL)


def run(report: Report) -> None:
    report.section("Start-up, wall time of a fresh process")
    calls = {"signlin --help": HELP, "import signlin_ros.linearization": IMPORT, "one linear model": LINEARIZE}
    calls["exact simulation, compiled before"] = [*SIMULATE, "exact"]
    found = timed({name: (lambda c=command: start(c), 1) for name, command in calls.items()}, repeats=5)  # type: ignore[misc]
    for name, timing in found.items():
        report.timing(name, name, timing, "s")
    for kind in KINDS:
        with tempfile.TemporaryDirectory() as cache:
            cold = timed({kind: (lambda kind=kind, cache=cache: start([*SIMULATE, kind], cache), 1)}, 1, warm=False)  # type: ignore[misc]
        report.timing(f"{kind} simulation, first on a machine", f"{kind} simulation, nothing compiled", cold[kind], "s")
    report.target("signlin --help", found["signlin --help"].median, high=0.5, unit="s")
