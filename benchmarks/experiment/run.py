"""Does the planned experiment decide what a first record could not? `python -m benchmarks.experiment.run --seeds 1 2`.

For every tie, both machines and each seed: the first record is diagnosed, the next one planned with the limits of the
tie, both runs of it are made with fresh noise, and all are diagnosed again. Beside it: the same with a chirp of the
largest peak within the limits. A line of JSON for each case goes to the file of --output.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.experiment.ties import TIES, Tie, chirp
from signlin_ros.diagnosis.verbs import diagnose
from signlin_ros.errors import SignlinError
from signlin_ros.experiment.plan import ExperimentPlan
from signlin_ros.experiment.search import NEEDED_EVIDENCE
from signlin_ros.experiment.setting import KnownLimits, bench_of, gains_of, known_rivals
from signlin_ros.experiment.verbs import ExperimentWishes, designed
from signlin_ros.fitting.fit import fit
from signlin_ros.follow.data import load_sides
from signlin_ros.guard import check_sides
from signlin_ros.records import ModelData


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


def margin(model: Any, records: Sequence[ModelData], rivals: Sequence[KnownLimits], true: str) -> float:
    """Return -2 log likelihood by which the best wrong rival is behind the true one, all refitted to all records."""
    bench, costs = bench_of(model, records, rivals), dict[str, float]()
    for c in bench.contenders:
        low, high = c.bounds
        sides = zip(c.candidate.coordinates, low.tolist(), high.tolist(), strict=True)
        own = replace(c.candidate, coordinates=tuple(replace(k, low=a, high=b) for k, a, b in sides), starts={})
        starts = [c.theta, *c.sigma_points[:2]]
        fits = [f for f in (fit(bench.problem, own, gains_of(bench.problem), x, 12) for x in starts) if f]
        costs["+".join(c.effects)] = min((f.cost for f in fits), default=np.inf)
    if true not in costs:
        return float("nan")
    return min((v for n, v in costs.items() if n != true), default=np.inf) - costs[true]


def verdict(tie: Tie, folder: Path, files: Sequence[Path], validation: Path) -> tuple[list[str], list[str], str]:
    """Return the effects that are named, those that are confirmed, and the verdict."""
    model, data = read(tie, [*files, validation])
    found = diagnose(model, data[:-1], data[-1:], jobs=1)
    named = list(found.ladder[-1].effects)
    confirmed = [e.effect for e in found.ranking if e.status == "confirmed" and e.effect in named]
    return named, confirmed, found.verdict


def case(tie: Tie, which: int, seed: int, folder: Path, chirps: bool) -> dict[str, Any]:
    """Return what became of one machine."""
    names = tie.machines[which].names
    row: dict[str, Any] = {"tie": tie.key, "true": names[0], "seed": seed}
    first = tie.record(which, *tie.first, 1000 * seed + which, folder / "first.csv", True)
    model, data = read(tie, [first])
    found = diagnose(model, data, jobs=1)
    row |= {"first": list(found.ladder[-1].effects), "first_verdict": found.verdict}
    rivals = known_rivals([r.to_json() for r in found.rivals])
    row["rivals"] = ["+".join(r.effects) for r in rivals]
    started = time.process_time()
    try:
        plan = designed(model, data, rivals, ExperimentWishes(limits=tie.limits, duration=tie.duration, seed=seed))
    except SignlinError as error:
        return row | {"plan": "", "why": str(error)}
    row |= {"cpu": time.process_time() - started, "plan": plan.words, "verdict": plan.verdict, "tried": plan.tried}
    row |= {"sentence": plan.sentence, "peak": float(np.abs(plan.u).max()), "beyond": beyond(tie, which, plan)}
    name = names[0].replace("_", " ")
    own = [p for p in plan.pairs if name in p.rivals]
    told = [p.expected for p in own if p.expected >= NEEDED_EVIDENCE]
    row |= {"promised": min(told, default=None), "planned_for": bool(own), "alike": [p.rivals for p in own if p.alike]}
    runs = [tie.record(which, plan.t, plan.u, 1000 * seed + 100 + 10 * which + k, folder / f"r{k}.csv") for k in (0, 1)]
    row["named"], row["confirmed"], row["then"] = verdict(tie, folder, [first, runs[0]], runs[1])
    row["right"] = set(row["named"]) == set(names)
    row["wrong"] = bool(set(row["confirmed"]) - set(names)) and row["then"] != "unexplained"
    if own and told:
        kept = [r for r in rivals if "+".join(r.effects).replace("_", " ") in {n for p in own for n in p.rivals
                if p.expected >= NEEDED_EVIDENCE}]  # fmt: skip
        row["seen"] = margin(model, [*data, *read(tie, runs)[1]], kept, names[0])
    if chirps:
        row["chirp"], row["chirp_peak"] = _chirp(tie, which, seed, folder, first, plan)
    return row


def _chirp(tie: Tie, which: int, seed: int, folder: Path, first: Path, plan: ExperimentPlan) -> tuple[bool, float]:
    """Return whether a chirp of the largest peak within the limits does as well, and that peak."""
    peak = plan.limits[plan.input]
    for _k in range(25):
        t, u = chirp(plan.duration, peak)
        if beyond(tie, which, replace(plan, t=t, u=u)) <= 1.0:
            break
        peak *= 0.85
    runs = [tie.record(which, t, u, 1000 * seed + 300 + 10 * which + k, folder / f"c{k}.csv") for k in (0, 1)]
    return set(verdict(tie, folder, [first, runs[0]], runs[1])[0]) == set(tie.machines[which].names), peak


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--only", nargs="*", default=[], help="ties")
    parser.add_argument("--chirps", action="store_true", help="judge a chirp of the full peak, too")
    parser.add_argument("--output", type=Path, default=Path("experiment.jsonl"))
    chosen = parser.parse_args()
    rows = []
    for seed in chosen.seeds:
        for tie in (t for t in (make() for make in TIES) if not chosen.only or t.key in chosen.only):
            for which in (0, 1):
                with TemporaryDirectory() as folder:
                    row = case(tie, which, seed, Path(folder), chosen.chirps)
                rows.append(row)
                print(json.dumps(row), flush=True)
                with chosen.output.open("a") as stream:
                    stream.write(json.dumps(row) + "\n")
    summary(rows)


def summary(rows: Sequence[dict[str, Any]]) -> None:
    """Print the scores."""
    done = [r for r in rows if r.get("plan")]
    open_ = [r for r in rows if set(r["first"]) != {r["true"]}]
    kept = [r["seen"] >= 0.5 * r["promised"] for r in done if r.get("promised") and np.isfinite(r.get("seen", np.nan))]
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
