"""Speed and latency, as ratios against other tools measured in the same run.

    python benchmarks/bench.py [--output DIR] [--only NAME ...] [--minute SECONDS]

Prints PASS or FAIL for every target of the project. The exit code is 0 unless something crashes: a slow or a busy
machine is no fault of the code.
"""

from __future__ import annotations

import argparse
import importlib
import os
import platform
import sys
from pathlib import Path

from measure import Report

SECTIONS = {
    "linearization": "A_k, B_k beside python-control and NumPy by hand",
    "simulation": "exact simulation beside SciPy's solve_ivp with events",
    "prediction": "what the method gains on measured data (EMPS)",
    "diagnosis": "what a diagnosis takes, and names beside PySINDy",
    "startup": "start-up and cold compilation",
    "ros_latency": "the nodes: latency, CPU share, rate (takes over a minute)",
}


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--output", type=Path, help="folder for bench.json")
    parser.add_argument("--only", nargs="+", choices=SECTIONS, default=list(SECTIONS), help="sections to run")
    parser.add_argument("--minute", type=float, default=60.0, help="seconds that the nodes are watched (default 60)")
    options = parser.parse_args()
    report = Report()
    load = os.getloadavg()[0]
    print(f"Python {platform.python_version()}, {os.cpu_count()} cores, load before the start {load:.2f}")
    for name in options.only:
        section = importlib.import_module(name)
        arguments = {"seconds": options.minute} if name == "ros_latency" else {}
        section.run(report, **arguments)
    report.summary()
    if options.output is not None:
        report.save(options.output / "bench.json")
    return 0


if __name__ == "__main__":
    sys.exit(main())
