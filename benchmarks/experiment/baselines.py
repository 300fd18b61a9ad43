"""Would a chirp or a multisine do as well? `python -m benchmarks.experiment.baselines --folder experiment`.

For every machine that `benchmarks.experiment.run` left in a folder: one run each of the plan, and of a chirp and a
multisine of the full and of the plan's peak (lowered where the true machine would leave a limit), with the first
record; both laws of the tie are refitted to these. Right: the true one is ahead by `NEEDED_EVIDENCE`. With `--judge
diagnose`: what `diagnose` names after two runs of each, with the plan's rivals.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.experiment.machines import Row, each_machine
from benchmarks.experiment.run import beyond, margin, read, verdict
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


def commands(tie: Tie, which: int, folder: Path) -> dict[str, tuple[Array, Array]]:
    """Return the plan and the plain commands (t, u) by name."""
    t, u = np.loadtxt(folder / "next.csv", delimiter=",", skiprows=1).T
    content: dict[str, Any] = {"verdict": "", "sentence": "", "words": "", "input": tie.given.inputs[0], "unit": ""}
    content |= {"rivals": (), "pairs": (), "families": (), "assumed": (), "visits": {}, "units": {}, "smallest": {}}
    plan = ExperimentPlan(t=t, u=u, limits=tie.limits, spare=0.2, **content)
    peak, full = float(np.abs(u).max()), tie.limits[tie.given.inputs[0]]
    found = {"plan": (t, u)}
    for kind in ("chirp", "multisine"):
        found |= {f"{kind}, full peak": within(tie, which, plan, kind, full)}
        found |= {f"{kind}, same peak": within(tie, which, plan, kind, peak)}
    return found


def by_refit(tie: Tie, which: int, seed: int, folder: Path) -> Row:
    """Return by command the -2 log likelihood by which the true law of a tie is ahead of the other one."""
    names = [m.names[0] for m in tie.machines]
    model, first = read(tie, [folder / "first.csv"])
    rivals = with_named([], model, first, names)
    row: Row = {"tie": tie.key, "true": names[which], "seed": seed}
    for k, (name, command) in enumerate(commands(tie, which, folder).items()):
        path = tie.record(which, *command, 1000 * seed + 500 + 10 * which + k, folder / f"baseline_{k}.csv")
        value = margin(tie, which, [*first, *read(tie, [path])[1]], rivals)
        row[name] = {"margin": value, "right": value > NEEDED_EVIDENCE, "wrong": value < -NEEDED_EVIDENCE}
    return row


def by_diagnosis(tie: Tie, which: int, seed: int, folder: Path) -> Row:
    """Return by command what `diagnose` makes of two runs of it, with the plan's rivals: of the plan, what it made."""
    row: Row = {"tie": tie.key, "true": tie.machines[which].names[0], "seed": seed}
    plan, *plain = commands(tie, which, folder).items()
    row[plan[0]] = json.loads((folder / "row.json").read_text())
    for k, (name, command) in enumerate(plain):
        noise = 1000 * seed + 700 + 100 * which + 2 * k
        runs = [tie.record(which, *command, noise + i, folder / f"plain_{k}_{i}.csv") for i in (0, 1)]
        row[name] = verdict(tie, which, [folder / "first.csv", *runs], folder / "next.rivals.json")
    return row


def main() -> None:
    rows = each_machine({"refit": by_refit, "diagnose": by_diagnosis}, __doc__, "baselines.jsonl")
    for name in [n for n in rows[0] if n not in ("tie", "true", "seed")] if rows else []:
        told = [row[name] for row in rows]
        right, wrong = (sum(bool(one[which]) for one in told) for which in ("right", "wrong"))
        margins = [one["margin"] for one in told if "margin" in one]
        more = f", median margin {np.median(margins):.3g}" if margins else ""
        sure = sum(bool(one["right"] and one["confirmed"]) for one in told if "confirmed" in one)
        more += "" if margins else f", right and confirmed {sure}"
        print(f"{name}: right {right} of {len(told)}, wrong {wrong}{more}")


if __name__ == "__main__":
    main()
