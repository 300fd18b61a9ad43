"""What the motion witness says by itself: named, nothing named, refused; on simulated records and on real ones.

    python -m benchmarks.motion_score --folder RECORDS
    python -m benchmarks.motion_score --groups single weak none none_coloured outside --count 20 --seed 145
    python -m benchmarks.motion_score --real DATA

``DATA`` is the folder of the shared records. Every answer is appended to ``--results``, and is not asked for again.
"""

from __future__ import annotations

import argparse
import itertools
import json
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from benchmarks.hidden.generator import GROUPS, draw, write
from benchmarks.hidden.score import MOST_TIED, Task, wilson
from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.data import load_records
from signlin_ros.diagnosis.motion import Motion
from signlin_ros.model import Model

DAMPER = {
    "plant": "force_element",
    "parameters": {"c": 800.0, "k": 0.0},
    "tolerance": 0.5,
    "effects": {"sensor_offset": {"force": 132.0}},
    "signals": {"velocity": "v [mm/s]", "force": "F [N]"},
}


def witness(model: Path | str, known: list[str], unseen: list[str], depth: int = 3) -> dict[str, Any]:
    """Return what the witness says of records."""
    loaded, data = load_records(Model.load(model), [*known, *(unseen or [])])
    wall, cpu = time.perf_counter(), time.process_time()
    motion = Motion.of(loaded, data[: len(known)], data[len(known) :], Criteria(), jobs=1)
    path = motion.search(depth)
    spent = {"seconds": time.perf_counter() - wall, "cpu": time.process_time() - cpu}
    base, final = motion.base, path[-1][0]
    steps = [_told(motion, before[0], after[0]) for before, after in itertools.pairwise(path)]
    verdict = ("missing" if final.effects else "adequate") if final.white else "unexplained"
    return {
        "verdict": verdict,
        "effects": list(final.effects),
        "steps": steps,
        "ties": _ties(motion, path),
        "left": [f"{x.channel}: {x.over_noise:.2f} slow {x.slow:.3f} dependent {x.dependent:.3f}" for x in final.left],
        "options": [_option(motion, path[-1][0], one) for one in path[-1][1:6]],
        "rms": {c: _rms(base, final, i) for i, c in enumerate(motion.problem.channels)},
        "strain": round(final.strain, 1),
        **spent,
    }


def _ties(motion: Any, path: list[list[Any]]) -> list[list[str]]:
    """Return the sets of effects that are as good as the proposal, at its last step."""
    if len(path) < 2:
        return []
    return [list(one.effects) for one in motion.ties(path[-2][0], path[-1][0], path[-1])]


def _told(motion: Any, before: Any, after: Any) -> str:
    g, sure = motion.gain(before, after), motion.certainty(before, after)
    values = ", ".join(f"{n} = {p}" for n, p in after.parameters.items() if n not in before.parameters)
    return f"{after.effects[-1]}: {g.certainty:.1f} ({sure:.1f}) standard errors, share {g.share:.2f}; {values}"


def _option(motion: Any, final: Any, one: Any) -> str:
    return f"{'+'.join(one.effects)} level {one.level:.2f}: {motion.refused(motion.base, one) or 'a step'}"


def _rms(base: Any, final: Any, i: int) -> list[float]:
    return [float(np.sqrt(np.nanmean(f.unseen_squares[:, i]))) for f in (base, final)]


def right(truth: dict[str, Any], answer: dict[str, Any]) -> bool:
    """Tell whether a verdict is right: the hidden effects and no other, nothing where nothing is, else refused."""
    hidden = set(truth["hidden"])
    if hidden == {"none"}:
        return bool(answer["verdict"] == "adequate")
    if next(iter(hidden)).startswith("("):
        return bool(answer["verdict"] == "unexplained")
    near = [set(answer["effects"]), *map(set, answer["ties"])]
    return answer["verdict"] == "missing" and len(near) <= MOST_TIED and hidden in near


def run(task: Task) -> dict[str, Any]:
    """Ask for one record; a failure is an answer too."""
    with tempfile.TemporaryDirectory() as scratch:
        if task.folder:
            folder, truth = Path(task.folder), json.loads(task.truth)
        else:
            record = draw(task.group, task.index, task.seed)
            folder, truth = write(record, Path(scratch)), record.truth
        try:
            answer = witness(folder / "model.yaml", [str(folder / "estimation.csv")], [str(folder / "validation.csv")])
        except Exception as fault:  # noqa: BLE001 - whatever goes wrong is counted as wrong
            answer = {
                "verdict": "error",
                "effects": [],
                "ties": [],
                "why": f"{type(fault).__name__}: {fault}",
                "cpu": 0.0,
                "seconds": 0.0,
            }
    return {"key": task.key, "group": task.group, "truth": truth, "answer": answer, "right": right(truth, answer)}


def real(data: Path, scratch: Path) -> Iterator[tuple[str, str, list[str], list[str]]]:
    """Return the real records: name, model, what is fitted to, what is held out."""
    bare = Model.load("emps").without_effect("coulomb_friction").without_effect("constant_load")
    bare.save(scratch / "emps.yaml")
    (scratch / "mr.yaml").write_text(yaml.safe_dump({"/**": {"ros__parameters": DAMPER}}))
    emps, kp100, mr = data / "emps", data / "xl330", data / "mr_damper"
    yield "emps", str(scratch / "emps.yaml"), [str(emps / "DATA_EMPS.csv")], [str(emps / "DATA_EMPS_PULSES.csv")]
    names = [str(mr / f"ensaio{n}.1_0V.csv") for n in (1, 4, 7, 10)]
    yield "mr damper", str(scratch / "mr.yaml"), names[:3], names[3:]
    names = [
        str(kp100 / f"xl330_kp100_{n}.csv") for n in ("lift_and_drop", "sin_sin", "sin_time_square", "up_and_down")
    ]
    yield "xl330", "xl330", names[:3], names[3:]
    for place in sorted((data / "field" / "verdicts").glob("*")):
        yield place.name, str(place / "nominal.yaml"), [str(place / "a.csv")], [str(place / "b.csv")]
    cogging, damper = data / "real" / "cogging_motor", data / "real" / "friction_damper"
    loops = [[str(cogging / f"speed_loop_{x}.csv")] for x in "ab"]
    yield "cogging", str(cogging / "nominal.yaml"), *loops
    rates = [[str(damper / f"{x}.csv")] for x in ("0.5Hz_1in", "1Hz_0.5in")]
    yield "friction damper", str(damper / "nominal.yaml"), *rates


def tasks_in(folder: Path) -> list[Task]:
    """Return the records of a folder whose truth stands in one list beside them."""
    truths = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
    return [Task("shared", folder=str(folder / t["name"]), truth=json.dumps(t)) for t in truths]


def _print(r: dict[str, Any]) -> None:
    a = r["answer"]
    mark = {True: "right", False: "WRONG"}[r["right"]] if "truth" in r else "     "
    ties = " = ".join("+".join(t) for t in a.get("ties", ()))
    said = f"{a['verdict']} {'+'.join(a['effects'])} {'= ' + ties if ties else ''} {a.get('why', '')}"
    hidden = "+".join(r["truth"]["hidden"]) if "truth" in r else ""
    print(f"{mark} {r['key']:22} {hidden:28} -> {said}  [{a['cpu']:.1f} s of CPU, {a['seconds']:.1f} s]", flush=True)
    if mark != "right" and a["verdict"] != "error":
        for line in (*a["steps"], *a["left"], *a["options"], f"strain {a['strain']}", str(a["rms"])):
            print(f"        {line}", flush=True)


def _report(results: list[dict[str, Any]]) -> None:
    groups = defaultdict(list)
    for r in results:
        groups[r["group"]].append(r)
    for group, rows in groups.items():
        count, n = sum(r["right"] for r in rows), len(rows)
        low, high = wilson(count, n)
        verdicts = {
            v: sum(r["answer"]["verdict"] == v for r in rows) for v in ("missing", "adequate", "unexplained", "error")
        }
        named = sum(set(r["answer"]["effects"]) == set(r["truth"]["hidden"]) for r in rows)
        cpu = np.median([r["answer"]["cpu"] for r in rows])
        print(
            f"{group:14} right {count} / {n} ({100 * low:.0f} .. {100 * high:.0f} %), exact names {named}, {verdicts}, "
            f"median {cpu:.1f} s of CPU"
        )


def main() -> None:
    """Run, then print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--real", type=Path)
    parser.add_argument("--groups", nargs="+", choices=GROUPS, default=[])
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="+")
    parser.add_argument("--results", type=Path)
    a = parser.parse_args()
    done = [json.loads(x) for x in a.results.read_text().splitlines()] if a.results and a.results.exists() else []
    known, results = {r["key"] for r in done}, list(done)
    tasks = tasks_in(a.folder) if a.folder else []
    tasks += [Task(g, i, a.seed) for g in a.groups for i in range(a.first, a.first + a.count)]
    for task in tasks:
        if task.key in known or (a.only and not any(x in task.key for x in a.only)):
            continue
        result = run(task)
        results.append(result)
        _print(result)
        if a.results:
            with a.results.open("a") as file:
                file.write(json.dumps(result) + "\n")
    with tempfile.TemporaryDirectory() as scratch:
        for name, model, first, second in real(a.real, Path(scratch)) if a.real else ():
            if not a.only or any(x in name for x in a.only):
                _print({"key": name, "answer": witness(model, first, second), "right": False})
    _report([r for r in results if r["key"] in {t.key for t in tasks}])


if __name__ == "__main__":
    main()
