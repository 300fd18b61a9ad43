"""Does the planned experiment decide what a first record could not? `python -m benchmarks.experiment.run --seeds 1 2`.

For every tie, both machines and each seed: the first record is diagnosed, the next one planned with the limits of the
tie, both runs of it are made with fresh noise, and all are diagnosed again. A folder of each machine keeps its files;
`--again` judges them anew without planning. Lines of JSON go to the file of --output as they come.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.experiment.hidden import HIDDEN, hiding
from benchmarks.experiment.ties import TIES, Tie, true_model
from signlin_ros.diagnosis.discrimination import PlannedRival
from signlin_ros.diagnosis.results import Diagnosis
from signlin_ros.diagnosis.verbs import diagnose
from signlin_ros.errors import SignlinError
from signlin_ros.experiment.naming import open_names, with_named
from signlin_ros.experiment.plan import ExperimentPlan
from signlin_ros.experiment.search import NEEDED_EVIDENCE
from signlin_ros.experiment.setting import KnownLimits, bench_of, gains_of, known_rivals
from signlin_ros.experiment.sizes import Size
from signlin_ros.experiment.verbs import ExperimentWishes, designed
from signlin_ros.fitting.fit import fit
from signlin_ros.follow.data import load_sides
from signlin_ros.guard import check_sides
from signlin_ros.model import Model
from signlin_ros.model.numbers import numbers
from signlin_ros.records import ModelData

SEEN_STEPS = 12
"""Steps of a refit to all records."""
Row = dict[str, Any]


def read(tie: Tie, paths: Sequence[Path]) -> tuple[Any, list[ModelData]]:
    model, data, _ = load_sides(tie.given, paths, ())
    data, _, _ = check_sides(model, data, None, ("none",))
    return model, data


def beyond(tie: Tie, which: int, plan: ExperimentPlan) -> float:
    """Return the largest part of a limit that the true machine comes to."""
    shown, _ = tie.shown(which, plan.t, plan.u)
    parts = [np.abs(plan.u).max() / plan.limits[plan.input]]
    for name, most in plan.limits.items():
        if name in shown and name != plan.input:
            values = shown[name] - (shown[name][0] if name == tie.given.plant.position else 0.0)
            parts.append(np.abs(values).max() / most)
    return float(max(parts))


def margin(
    tie: Tie,
    which: int,
    records: Sequence[ModelData],
    rivals: Sequence[KnownLimits],
    planned: Sequence[PlannedRival] = (),
) -> float:
    """Return -2 log likelihood by which the best wrong rival is behind the true one, all refitted to all records, from
    the starts of the plan, a wrong one no smaller than it is of interest there; the true one, whatever its size, from
    what is true, too: a refit that is stuck says nothing of a record.
    """
    true, costs = tie.machines[which], dict[str, float]()
    bench, told = bench_of(tie.given, records, rivals), {"+".join(p.effects): p for p in planned}
    for c in bench.contenders:
        name = "+".join(c.effects)
        plan = told.get(name)
        size = None if name == true.names[0] else _size(plan) if plan else c.size
        low, high = replace(c, size=size).bounds
        sides = zip(c.candidate.coordinates, low.tolist(), high.tolist(), strict=True)
        own = replace(c.candidate, coordinates=tuple(replace(k, low=a, high=b) for k, a, b in sides), starts={})
        models = [*(plan.starts if plan else ()), *([true_model(tie.given, true)] if name == true.names[0] else [])]
        starts = [
            c.theta,
            *c.sigma_points[:2],
            *(own.start({**c.candidate.named(c.theta), **_named(m)}) for m in models),
        ]
        found = (fit(bench.problem, own, gains_of(bench.problem), np.clip(x, low, high), SEEN_STEPS) for x in starts)
        costs[name] = min((f.objective for f in found if f), default=np.inf)
    if true.names[0] not in costs:
        return float("nan")
    return min((v for n, v in costs.items() if n != true.names[0]), default=np.inf) - costs[true.names[0]]


def _size(plan: PlannedRival) -> Size | None:
    """Return the size of interest of a rival of a plan."""
    first = next(iter(plan.of_interest), "")
    return Size(first, not np.isfinite(plan.of_interest[first][0]), plan.of_interest) if first else None


def _named(model: Model) -> dict[str, float]:
    """Return the numbers of a model, and those of its sensors."""
    sensors = (use for use in model.effects.values() if use.type.startswith("sensor_"))
    return {**numbers(model), **{f"{use.type}.{c}": x for use in sensors for c, x in use.parameters.items()}}


def of_interest(tie: Tie, which: int, planned: Sequence[PlannedRival]) -> bool:
    """Tell whether a true machine is one that a plan is for: no smaller than its size of interest."""
    true = tie.machines[which]
    values = numbers(true_model(tie.given, true))
    sides = [p.of_interest for p in planned if p.effects == true.names]
    return all(a <= values[n] <= b for bounds in sides for n, (a, b) in bounds.items())


def rivals_of(found: Diagnosis, model: Any, data: Sequence[ModelData]) -> list[KnownLimits]:
    """Return the rivals as the command line takes them: with those of the family that the diagnosis only names."""
    return with_named(known_rivals([r.to_json() for r in found.rivals]), model, data, open_names(found.to_json()))


def planned(tie: Tie, which: int, seed: int, folder: Path) -> Row:
    """Return what was diagnosed of the first record and planned; files of both runs of the plan are in the folder."""
    names = tie.machines[which].names
    row: Row = {"tie": tie.key, "true": names[0], "seed": seed}
    first = tie.record(which, *tie.first, 1000 * seed + which, folder / "first.csv", True)
    model, data = read(tie, [first])
    found = diagnose(model, data, jobs=1)
    row |= {"first": list(found.ladder[-1].effects), "first_verdict": found.verdict}
    rivals = rivals_of(found, model, data)
    row["rivals"] = ["+".join(r.effects) for r in rivals]
    (folder / "diagnosis.json").write_text(json.dumps(found.to_json()))
    started = time.process_time()
    try:
        plan = designed(model, data, rivals, ExperimentWishes(limits=tie.limits, seed=seed))
    except SignlinError as error:
        return row | {"plan": "", "why": str(error)}
    row |= {"cpu": time.process_time() - started, "plan": plan.words, "verdict": plan.verdict, "tried": plan.tried}
    row |= {"sentence": plan.sentence, "peak": float(np.abs(plan.u).max()), "beyond": beyond(tie, which, plan)}
    (folder / "plan.json").write_text(json.dumps(plan.to_json()))
    (folder / "next.csv").write_text(plan.to_csv())
    (folder / "next.rivals.json").write_text(plan.to_rivals())
    name = names[0].replace("_", " ")
    own = [p for p in plan.pairs if name in p.rivals]
    told_apart = [p for p in own if p.expected >= NEEDED_EVIDENCE]
    row |= {"promised": min((p.expected for p in told_apart), default=None), "planned_for": bool(own)}
    row |= {"alike": [p.rivals for p in own if p.alike], "kept": sorted({n for p in told_apart for n in p.rivals})}
    for k in (0, 1):
        tie.record(which, plan.t, plan.u, 1000 * seed + 100 + 10 * which + k, folder / f"r{k}.csv")
    return row


def verdict(tie: Tie, which: int, records: Sequence[Path], told: Path) -> Row:
    """Return what `diagnose` makes of records, the last of which validates, with the rivals of a plan's file."""
    names = set(tie.machines[which].names)
    model, data = read(tie, records)
    started = time.process_time()
    found = diagnose(model, data[:-1], data[-1:], jobs=1, rivals=rivals_in(told))
    named = list(found.ladder[-1].effects)
    confirmed = [e.effect for e in found.ranking if e.status == "confirmed" and e.effect in named]
    there = names | set(tie.machines[which].listed)
    row: Row = {"named": named, "confirmed": confirmed, "then": found.verdict, "told": found.sentence}
    row |= {"judged_cpu": time.process_time() - started, "right": names <= set(named) <= there}
    return row | {"wrong": bool(set(confirmed) - there) and found.verdict != "unexplained"}


def rivals_in(told: Path) -> list[PlannedRival]:
    """Return the rivals of a plan's file."""
    return [PlannedRival.of_json(one) for one in json.loads(told.read_text())["rivals"]]


def judged(tie: Tie, which: int, folder: Path, row: Row) -> Row:
    """Return what `diagnose` makes of the first record and of both runs of a plan."""
    told, records = folder / "next.rivals.json", [folder / f"{name}.csv" for name in ("first", "r0", "r1")]
    planned = rivals_in(told)
    row |= {"of_interest": of_interest(tie, which, planned)} | verdict(tie, which, records, told)
    if row.get("kept") and "seen" not in row:
        model, data = read(tie, records[:2])
        rivals = rivals_of(diagnose(model, data[:1], jobs=1), model, data[:1])
        kept = [r for r in rivals if "+".join(r.effects).replace("_", " ") in row["kept"]]
        row["seen"] = margin(tie, which, data, kept, planned)
    return row


def case(tie: Tie, which: int, seed: int, folder: Path, again: bool) -> Row:
    """Return what became of one machine."""
    folder.mkdir(parents=True, exist_ok=True)
    own = folder / "row.json"
    if not (again and own.exists()):
        own.write_text(json.dumps(planned(tie, which, seed, folder)))
    row = json.loads(own.read_text())
    row = judged(tie, which, folder, row) if row["plan"] else row
    own.write_text(json.dumps(row))
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--only", nargs="*", default=[], help="ties")
    parser.add_argument("--machines", type=int, nargs="*", default=[0, 1], help="first, second or both of a tie")
    parser.add_argument(
        "--hidden", nargs="*", choices=HIDDEN, default=[""], help="what machines have beside, see hidden"
    )
    parser.add_argument("--again", action="store_true", help="judge what was planned before, without planning")
    parser.add_argument("--folder", type=Path, default=Path("experiment"), help="of the files of all machines")
    parser.add_argument("--output", type=Path, default=Path("experiment.jsonl"))
    chosen = parser.parse_args()
    rows = []
    ties = [t for t in (make() for make in TIES) if not chosen.only or t.key in chosen.only]
    for seed in chosen.seeds:
        for tie, kind in product(ties, chosen.hidden):
            for which in chosen.machines:
                folder = chosen.folder / kind / f"{tie.key}_{which}_{seed}"
                rows.append(case(hiding(tie, kind), which, seed, folder, chosen.again) | {"hidden": kind})
                row = rows[-1]
                print(json.dumps(row), flush=True)
                with chosen.output.open("a") as stream:
                    stream.write(json.dumps(row) + "\n")
    summary(rows)


def summary(rows: Sequence[Row]) -> None:
    """Print the scores."""
    done = [r for r in rows if r.get("plan")]
    open_ = [r for r in rows if set(r["first"]) != {r["true"]}]
    told = [r for r in done if r.get("promised") and np.isfinite(r.get("seen", np.nan)) and r["of_interest"]]
    kept = [r["seen"] >= 0.5 * r["promised"] for r in told]
    print(f"cases {len(rows)}, not decided by the first record {len(open_)}, planned {len(done)}", file=sys.stderr)
    print(f"right {sum(r['right'] for r in done)}, wrongly confirmed {sum(r['wrong'] for r in done)}", file=sys.stderr)
    print(
        f"promise kept to half {sum(kept)} of {len(kept)}; beyond a limit {sum(r['beyond'] > 1 for r in done)}",
        file=sys.stderr,
    )
    if done:
        print(f"processor time of a plan: median {np.median([r['cpu'] for r in done]):.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
