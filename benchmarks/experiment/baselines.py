"""Would a chirp or a multisine do as well? `python -m benchmarks.experiment.baselines --folder experiment`.

For every machine that `benchmarks.experiment.run` left in a folder: one run each of the plan, and of a chirp and a
multisine of the full and of the plan's peak (lowered where the true machine would leave a limit), with the first
record; both laws of the tie are refitted to these. Right: the true one is ahead by `NEEDED_EVIDENCE`.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.experiment.machines import each_machine
from benchmarks.experiment.run import beyond, margin, read
from benchmarks.experiment.ties import Array, Tie, chirp, multisine
from signlin_ros.experiment.naming import with_named
from signlin_ros.experiment.plan import ExperimentPlan
from signlin_ros.experiment.search import NEEDED_EVIDENCE

LOWER, TIMES = 0.85, 25


def within(tie: Tie, which: int, plan: ExperimentPlan, kind: str, peak: float) -> tuple[Array, Array]:
    """Return a plain command of a peak, or of the largest one within the limits."""
    duration = float(plan.t[-1] + plan.t[1])
    for _ in range(TIMES):
        t, u = chirp(duration, peak) if kind == "chirp" else multisine(duration, peak, 10.0)
        if beyond(tie, which, replace(plan, t=t, u=u)) <= 1.0:
            break
        peak *= LOWER
    return t, u


def case(tie: Tie, which: int, seed: int, folder: Path) -> dict[str, Any]:
    """Return by input the -2 log likelihood by which the true law of a tie is ahead of the other one."""
    t, u = np.loadtxt(folder / "next.csv", delimiter=",", skiprows=1).T
    content: dict[str, Any] = {"verdict": "", "sentence": "", "words": "", "input": tie.given.inputs[0], "unit": ""}
    content |= {"rivals": (), "pairs": (), "families": (), "assumed": (), "visits": {}, "units": {}, "smallest": {}}
    plan = ExperimentPlan(t=t, u=u, limits=tie.limits, spare=0.2, **content)
    peak, full = float(np.abs(u).max()), tie.limits[tie.given.inputs[0]]
    inputs = {"plan": (t, u)}
    for kind in ("chirp", "multisine"):
        inputs |= {f"{kind}, full peak": within(tie, which, plan, kind, full)}
        inputs |= {f"{kind}, same peak": within(tie, which, plan, kind, peak)}
    names = [m.names[0] for m in tie.machines]
    model, first = read(tie, [folder / "first.csv"])
    rivals = with_named([], model, first, names)
    row: dict[str, Any] = {"tie": tie.key, "true": names[which], "seed": seed}
    for k, (name, command) in enumerate(inputs.items()):
        path = tie.record(which, *command, 1000 * seed + 500 + 10 * which + k, folder / f"baseline_{k}.csv")
        row[name] = margin(tie, which, [*first, *read(tie, [path])[1]], rivals)
    return row


def main() -> None:
    rows = each_machine(case, __doc__, "baselines.jsonl")
    for name in [n for n in rows[0] if n not in ("tie", "true", "seed")] if rows else []:
        values = np.array([row[name] for row in rows])
        right, wrong = int(np.sum(values > NEEDED_EVIDENCE)), int(np.sum(values < -NEEDED_EVIDENCE))
        print(f"{name}: right {right} of {values.size}, wrong {wrong}, median margin {np.median(values):.3g}")


if __name__ == "__main__":
    main()
