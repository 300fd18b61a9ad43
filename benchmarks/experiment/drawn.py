"""Does a planned run keep machines within their limits? `python -m benchmarks.experiment.drawn --folder experiment`.

For every machine that `benchmarks.experiment.run` left in a folder: machines drawn from the estimates of all rivals of
the plan, others than those that the plan was made with, run its command; the largest part of a limit of each is told.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from benchmarks.experiment.machines import Row, each_machine
from benchmarks.experiment.run import read, rivals_in
from benchmarks.experiment.ties import Tie
from signlin_ros.experiment.limits import limits_of
from signlin_ros.experiment.naming import open_names, with_named
from signlin_ros.experiment.setting import bench_of, known_rivals, movable

COUNT, SEED = 3, 61
"""Machines drawn of each rival, and what they are drawn with beside the seed of the records."""


def case(tie: Tie, which: int, seed: int, folder: Path) -> Row:
    """Return the largest part of a limit that each drawn machine comes to; infinite for one that diverges."""
    model, first = read(tie, [folder / "first.csv"])
    told = json.loads((folder / "diagnosis.json").read_text())
    every = with_named(known_rivals(told["rivals"]), model, first, open_names(told))
    planned = [one.effects for one in rivals_in(folder / "next.rivals.json")]
    bench = bench_of(model, first, [r for r in every if r.effects in planned])
    limits = limits_of(bench.problem, tie.limits)
    bench, _ = movable(bench, limits)
    t, u = np.loadtxt(folder / "next.csv", delimiter=",", skiprows=1).T
    parts, g = [], np.random.default_rng((SEED, seed))
    for i, c in enumerate(bench.contenders):
        runs = [bench.run(i, t, u, theta) for theta in c.drawn(g, COUNT)]
        parts += [limits.share(run)[0] if run is not None else np.inf for run in runs]
    return {"tie": tie.key, "true": tie.machines[which].names[0], "seed": seed, "parts": parts}


def main() -> None:
    rows = each_machine({"drawn": case}, __doc__, "drawn.jsonl")
    parts = np.array([part for row in rows for part in row["parts"]])
    if parts.size:
        print(f"beyond a limit: {int(np.sum(parts > 1.0))} of {parts.size} machines, the nearest at {parts.max():.2g}")


if __name__ == "__main__":
    main()
