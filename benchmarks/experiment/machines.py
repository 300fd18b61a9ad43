"""The command line of a benchmark that goes through the machines which `benchmarks.experiment.run` left in a folder."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from benchmarks.experiment.ties import TIES, Tie

Row = dict[str, Any]
Case = Callable[[Tie, int, int, Path], Row]


def each_machine(cases: Mapping[str, Case], about: str | None, output: str) -> list[Row]:
    """Return the row of every machine that has a plan; each is printed and appended to a file as it comes. Asked
    is the first of ``cases`` unless ``--judge`` names another.
    """
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--folder", type=Path, default=Path("experiment"))
    parser.add_argument("--only", nargs="*", default=[], help="names of machines in the folder")
    parser.add_argument("--output", type=Path, default=Path(output))
    first, *others = cases
    if others:
        parser.add_argument("--judge", choices=list(cases), default=first, help="what tells the laws apart")
    chosen = parser.parse_args()
    case = cases[getattr(chosen, "judge", first)]
    ties, rows = {t.key: t for t in (make() for make in TIES)}, []
    done = {path.parent for path in chosen.folder.glob("*/next.csv")}
    for folder in sorted(p for p in done if not chosen.only or p.name in chosen.only):
        key, which, seed = folder.name.rsplit("_", 2)
        rows.append(case(ties[key], int(which), int(seed), folder))
        with chosen.output.open("a") as stream:
            stream.write(json.dumps(rows[-1]) + "\n")
        print(json.dumps(rows[-1]), flush=True)
    return rows


__all__ = ["each_machine"]
