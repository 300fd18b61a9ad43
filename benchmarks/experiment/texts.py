"""Do texts of effects tell a tie apart better than the plan? `python -m benchmarks.experiment.texts --folder F`.

For every machine that `benchmarks.experiment.run` left in a folder: the distance of both laws of its tie by refits, the
smaller of both ways, under the plan for these two and under each family of commands that their texts ask for, as long
as the plan and at a ladder of sizes within the limits; and under the plan for all rivals, which share its time.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.experiment.machines import each_machine
from benchmarks.experiment.run import read
from benchmarks.experiment.ties import Tie
from signlin_ros.experiment.families import COMMAND_FAMILIES, LADDER
from signlin_ros.experiment.limits import limits_of
from signlin_ros.experiment.naming import with_named
from signlin_ros.experiment.remedies import least
from signlin_ros.experiment.search import ENOUGH, CommandSearch
from signlin_ros.experiment.setting import bench_of
from signlin_ros.experiment.verbs import ExperimentWishes, designed

SPARE, PART_OF_BEST, REFITTED = 0.2, 0.8, 3
"""Part of the limits that is spared; part of the best text at the plan's peak that a plan must show; commands of the
largest linear distance that are refitted."""


def case(tie: Tie, which: int, seed: int, folder: Path) -> dict[str, Any]:
    """Return the distance of both laws under the plan for them, under the best text, and under the best one no larger
    than the plan, all as long as that; ``shared``: under the plan for all rivals that the first record leaves.
    """
    names = [m.names[0] for m in tie.machines]
    model, first = read(tie, [folder / "first.csv"])
    rivals = with_named([], model, first, names)
    wishes = ExperimentWishes(between=tuple(names), limits=tie.limits, spare=SPARE, seed=seed)
    plan = designed(model, first, rivals, wishes)
    t, peak, bench = plan.t, float(np.abs(plan.u - plan.u[0]).max()), bench_of(model, first, rivals)
    search = CommandSearch(bench, limits_of(bench.problem, tie.limits), t, SPARE, lambda what, share: None)
    asked = [f for f in COMMAND_FAMILIES if set(f.texts) & set(names)]
    for part in LADDER:
        for family in asked:
            search.screened(family, family.at(part * search.most))

    def best(most: float) -> float:
        quiet = [one for one in search.tried if one.peak <= most]
        loud = sorted(quiet, key=lambda one: -float(one.linear.min()))[:REFITTED]
        return max((least(bench, bench.pairs, t, one.u) for one in loud), default=0.0)

    row: dict[str, Any] = {"tie": tie.key, "true": names[which], "seed": seed, "promised": plan.pairs[0].expected}
    row |= {"plan": least(bench, bench.pairs, t, plan.u), "texts": best(np.inf), "same_peak": best(1.001 * peak)}
    t, u = np.loadtxt(folder / "next.csv", delimiter=",", skiprows=1).T
    return row | {"shared": least(bench, bench.pairs, t, u), "peak": peak, "seconds": plan.duration}


def main() -> None:
    rows = each_machine({"refit": case}, __doc__, "texts.jsonl")
    reach = [row for row in rows if row["texts"] >= ENOUGH]
    print(f"{ENOUGH:g} by the plan, where a text has it: {sum(r['plan'] >= ENOUGH for r in reach)} of {len(reach)}")
    as_good = sum(row["plan"] >= PART_OF_BEST * row["same_peak"] for row in rows)
    print(f"{PART_OF_BEST:g} of the best text at the plan's peak: {as_good} of {len(rows)}")
    print(f"{ENOUGH:g} by the plan for all rivals there: {sum(r['shared'] >= ENOUGH for r in reach)} of {len(reach)}")


if __name__ == "__main__":
    main()
