"""How often the diagnosis names what a record hides: confusion by effect, rates with 95 % intervals by group.

    python -m benchmarks.hidden.score --groups single none --count 50 --seed 1 --results out/hidden.jsonl
    python -m benchmarks.hidden.score --folder RECORDS            records on disk, the shared examples among them
    python -m benchmarks.hidden.score --results out/hidden.jsonl --report
    python -m benchmarks.hidden.score --groups catalogue --by force       what the equation-error estimate says alone

Every answer is appended to the results file; a run that is started again skips what is in there. ``--report`` runs
nothing. What counts as right is in `judge`.
"""

from __future__ import annotations

import argparse
import csv
import json
import multiprocessing
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hidden import alone
from benchmarks.hidden.effects import UNLISTED
from benchmarks.hidden.generator import DEVELOPMENT, GROUPS, draw, write

MOST_TIED = 3
"""A tie counts if it has at most this many members, the truth among them."""
NAMED = ("confirmed", "ambiguous")


@dataclass(frozen=True)
class Task:
    """One record: drawn by (group, index, seed), or read from a folder; ``by``: which estimates are asked."""

    group: str
    index: int = 0
    seed: int = 0
    folder: str = ""
    truth: str = ""
    by: str = "both"

    @property
    def key(self) -> str:
        name = "/".join(Path(self.folder).parts[-2:]) if self.folder else f"{self.group}/{self.index}/{self.seed}"
        return name if self.by == "both" else f"{name}/{self.by}"


def diagnose_record(folder: Path) -> dict[str, Any]:
    """Return the diagnosis of a record's folder as the JSON of `signlin diagnose`; the only place that knows how."""
    from signlin_ros.diagnosis import diagnose, load_records
    from signlin_ros.model import Model

    paths = [str(folder / f"{name}.csv") for name in ("estimation", "validation")]
    model, (estimation, validation) = load_records(Model.load(folder / "model.yaml"), paths)
    return dict(diagnose(model, estimation, validation, jobs=1).to_json())  # the records run side by side, not the fits


def _brief(answer: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is scored of an answer: effects that were rejected are left out."""
    ranking = [e for e in answer["ranking"] if e["status"] in NAMED]
    ladder = [{"effects": r["effects"], "validation": r["validation"]} for r in answer["ladder"]]
    kept = {"verdict": answer["verdict"], "sentence": answer.get("sentence", ""), "ranking": ranking, "ladder": ladder}
    return {**kept, "base": answer["base"]["validation"]}


def run(task: Task) -> dict[str, Any]:
    """Diagnose one record; a failure is an answer too."""
    with tempfile.TemporaryDirectory() as scratch:
        if task.folder:
            folder, truth = Path(task.folder), json.loads(task.truth)
        else:
            record = draw(task.group, task.index, task.seed)
            folder, truth = write(record, Path(scratch)), record.truth
        began = time.perf_counter()
        try:
            found = diagnose_record(folder) if task.by == "both" else alone.answer(folder, task.by)
            answer, error = _brief(found), ""
        except Exception as fault:  # noqa: BLE001 - whatever goes wrong is counted as wrong
            answer, error = None, f"{type(fault).__name__}: {fault}"
        seconds = time.perf_counter() - began
    return {
        "key": task.key,
        "group": task.group,
        "seconds": round(seconds, 3),
        "truth": truth,
        "answer": answer,
        "error": error,
    }


def _run_before(end: float, task: Task) -> dict[str, Any] | None:
    """Diagnose one record, unless that would begin after a time of the clock (s)."""
    return run(task) if time.time() < end else None


def group_of(truth: Mapping[str, Any]) -> str:
    """Return the group that a record on disk belongs to."""
    hidden = truth["hidden"]
    if hidden == ["none"]:
        return "none_coloured" if truth["kind"] == "coloured" else "none"
    if hidden[0].startswith("("):
        return next((g for g, laws in UNLISTED.items() if truth.get("laws", hidden)[0] in laws), "outside")
    if len(hidden) > 1:
        return "pair"
    if truth.get("laws", hidden) != hidden or truth.get("values", {}).get(hidden[0], {}).get("n") == 1.5:
        return "similar"
    return "weak" if truth["strength"] < 1 else "single"


def tasks_in(folder: Path) -> Iterator[Task]:
    """Find the records of a folder; their truth stands in one list beside them or in each of them."""
    whole = folder / "truth.json"
    known = {t["name"]: t for t in json.loads(whole.read_text(encoding="utf-8"))} if whole.exists() else {}
    for place in sorted(p.parent for p in folder.glob("*/model.yaml")):
        truth = known.get(place.name) or json.loads((place / "truth.json").read_text(encoding="utf-8"))
        yield Task(group_of(truth), folder=str(place), truth=json.dumps(truth))


def wilson(right: int, count: int) -> tuple[float, float]:
    """Return the 95 % interval of a rate [Wilson 1927, doi:10.1080/01621459.1927.10502953]."""
    if not count:
        return 0.0, 1.0
    z, p = 1.959964, right / count
    centre, half = p + z * z / (2 * count), z * np.sqrt(p * (1 - p) / count + z * z / (4 * count**2))
    return float((centre - half) / (1 + z * z / count)), float((centre + half) / (1 + z * z / count))


def _tie(entry: Mapping[str, Any]) -> set[str]:
    return {entry["effect"], *entry["indistinguishable_from"]}


def _one_family(tie: Iterable[str]) -> bool:
    """Tell whether effects are all richer and simpler forms of one thing."""
    from signlin_ros.effects import EFFECTS

    return len({EFFECTS[name].family or name for name in tie}) == 1


def _named(answer: Mapping[str, Any]) -> tuple[str, set[str], list[set[str]]]:
    """Return the answer's label, the effects that it proposes, and the tie of each of them."""
    if answer["verdict"] != "missing":
        return answer["verdict"], set(), []
    final = set(answer["ladder"][-1]["effects"]) if answer["ladder"] else set()
    entries = {e["effect"]: e for e in answer["ranking"]}
    top = answer["ranking"][0]["effect"] if answer["ranking"] else "nothing"
    ties = [_tie(entries[e]) if e in entries else {e} for e in sorted(final)]
    return "+".join(sorted(final)) if len(final) > 1 else top, final, ties


def _pair(truth: set[str], answer: Mapping[str, Any], final: set[str], ties: list[set[str]]) -> dict[str, Any]:
    confirmed = {e["effect"] for e in answer["ranking"] if e["status"] == "confirmed"}
    exact = final == truth or (answer["verdict"] == "missing" and confirmed == truth)
    matched = len(ties) == 2 and all(len(t) <= MOST_TIED for t in ties)
    matched = matched and any(a in ties[0] and truth - {a} <= ties[1] for a in truth)
    parts = {e["effect"] for e in answer["ranking"] if e["status"] == "partial"}
    partial = bool(truth & (final | confirmed | parts))
    return {"right": exact or matched, "exact": exact, "partial": partial}


def judge(result: Mapping[str, Any]) -> dict[str, Any]:
    """Return whether an answer is right, and how it is labelled.

    One effect: the first of the ranking is it, or is tied with it among at most three; of the group "catalogue" also
    among any of its family. Two: the proposal, or what is confirmed, is exactly these two (a tie may stand for its
    member). Nothing hidden: adequate. Outside the catalogue: unexplained. ``exact``: the proposal is the truth and
    nothing else; ``alone``: it proposes one effect, ``several``: more.
    """
    truth, answer = set(result["truth"]["hidden"]), result["answer"]
    if answer is None:
        return {"label": "error", "right": False, "exact": False, "partial": False, "alone": False, "several": False}
    label, final, ties = _named(answer)
    more = {"label": label, "alone": len(final) == 1, "several": len(final) > 1}
    if truth == {"none"} or next(iter(truth)).startswith("("):
        right = label == ("adequate" if truth == {"none"} else "unexplained")
        return {**more, "right": right, "exact": right, "partial": right}
    if len(truth) == 2:
        return {**more, **_pair(truth, answer, final, ties)}
    tie = _tie(answer["ranking"][0]) if answer["verdict"] == "missing" and answer["ranking"] else set()
    right = truth <= tie and (len(tie) <= MOST_TIED or (result["group"] == "catalogue" and _one_family(tie)))
    proposed = set().union(*ties) if ties else set()
    return {**more, "right": right, "exact": final == truth, "partial": truth <= proposed | tie}


def error_over_floor(result: Mapping[str, Any]) -> float | None:
    """Return the largest validation error of the proposal over the noise that was really added."""
    answer = result["answer"]
    if answer is None or not answer["ladder"]:
        return None
    scores, sigma = answer["ladder"][-1]["validation"], result["truth"]["noise_sigma"]["validation"]
    found = [s["rmse"] / sigma[n] for n, s in scores.items() if n in sigma and sigma[n] > 0]
    return max(found) if found else None


def parameter_error(result: Mapping[str, Any]) -> float | None:
    """Return the median relative error of the true effects' parameters, where they were named."""
    answer, values = result["answer"], result["truth"].get("values", {})
    errors = []
    for entry in answer["ranking"] if answer else ():
        for name, true in values.get(entry["effect"], {}).items():
            got = entry["parameters"].get(name)
            if got and true and name not in ("phi", "q0"):
                errors.append(abs(got["value"] / true - 1))
    return float(np.median(errors)) if errors else None


def _median(values: Iterable[float | None]) -> str:
    known = [v for v in values if v is not None]
    return f"{np.median(known):.3g}" if known else "-"


def _rates(results: list[dict[str, Any]]) -> list[str]:
    """Return a line for each group."""
    lines = [
        f"{'group':14}{'right':>10}  95 % interval   exact  partly  several   error/noise  parameters off  s/record"
    ]
    by_group = defaultdict(list)
    for r in results:
        by_group[r["group"]].append(r)
    for group in sorted(by_group, key=lambda g: GROUPS.index(g) if g in GROUPS else 99):
        rows = by_group[group]
        judged = [judge(r) for r in rows]
        right, n = sum(j["right"] for j in judged), len(rows)
        low, high = wilson(right, n)
        off = _median(parameter_error(r) for r in rows)
        several = sum(bool(j["several"]) for j in judged)
        lines.append(
            f"{group:14}{right:5} / {n:<3} {100 * low:5.1f} .. {100 * high:5.1f} %"
            f"{sum(j['exact'] for j in judged):8}{sum(j['partial'] for j in judged):8}{several:9}"
            f"{_median(error_over_floor(r) for r in rows):>14}{off:>16}{_median(r['seconds'] for r in rows):>10}"
        )
    return lines


def _confusion(results: list[dict[str, Any]]) -> dict[str, dict[str, Counter[str]]]:
    """Return by group and by what was hidden how often each label was given."""
    table: dict[str, dict[str, Counter[str]]] = defaultdict(lambda: defaultdict(Counter))
    for r in results:
        table[r["group"]]["+".join(r["truth"]["hidden"])][judge(r)["label"]] += 1
    return table


def report(results: list[dict[str, Any]]) -> str:
    """Return the rates, then for each hidden effect what it was called."""
    lines = _rates(results)
    for group, rows in _confusion(results).items():
        lines += ["", f"{group}: hidden, and what it was called"]
        for truth, labels in sorted(rows.items()):
            said = ", ".join(f"{name} {n}" for name, n in labels.most_common())
            lines.append(f"  {truth:48} {sum(labels.values()):3}: {said}")
    wrong = [r for r in results if not judge(r)["right"]]
    lines += ["", f"not right: {len(wrong)}"]
    for r in wrong:
        t = r["truth"]
        note = r["error"][:60] or f"{t['kind']}, {t['exc']}, {t.get('channels') or 'all channels'}"
        lines.append(f"  {r['key']:24} {t['plant']:19} {'+'.join(t['hidden']):40} {judge(r)['label']:36} {note}")
    return "\n".join(lines)


def write_table(results: list[dict[str, Any]], path: Path) -> None:
    """Write the confusion as a CSV file: rows what was hidden, columns what it was called."""
    table = _confusion(results)
    columns = sorted({label for rows in table.values() for labels in rows.values() for label in labels})
    with path.open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file)
        out.writerow(["group", "hidden", *columns])
        for group, rows in table.items():
            out.writerows([group, truth, *(labels[c] for c in columns)] for truth, labels in sorted(rows.items()))


def _known(path: Path | None) -> list[dict[str, Any]]:
    if path is None or not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]


def run_all(tasks: list[Task], path: Path | None, jobs: int, minutes: float = np.inf) -> list[dict[str, Any]]:
    """Run the tasks that have no result yet, none begun after some minutes; return all their results."""
    end = time.time() + 60.0 * minutes
    wanted = {t.key for t in tasks}
    results = [r for r in _known(path) if r["key"] in wanted]
    done = {r["key"] for r in results}
    left = [t for t in tasks if t.key not in done]
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        waiting = [pool.submit(_run_before, end, t) for t in left]
        for k, future in enumerate(as_completed(waiting), 1):
            result = future.result()
            if result is None:
                continue
            results.append(result)
            if path is not None:
                with path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(result) + "\n")
            verdict = judge(result)
            mark = "right" if verdict["right"] else "WRONG"
            said = f"{'+'.join(result['truth']['hidden'])} called {verdict['label']}"
            print(f"{k}/{len(left)} {result['key']} {mark}: {said}, {result['seconds']:.1f} s", file=sys.stderr)
    return results


def main() -> None:
    """Run, then print the report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--groups", nargs="+", choices=GROUPS, default=["single", "none", "none_coloured", "outside"])
    parser.add_argument("--count", type=int, default=48, help="records of each group")
    parser.add_argument("--first", type=int, default=0, help="index of the first record")
    parser.add_argument("--seed", type=int, default=DEVELOPMENT)
    parser.add_argument("--folder", type=Path, help="score the records in a folder instead")
    parser.add_argument("--by", choices=alone.ESTIMATES, default="both", help="ask one of the two estimates alone")
    parser.add_argument("--results", type=Path, help="JSON lines, appended to; what is in there is not run again")
    parser.add_argument("--report", action="store_true", help="run nothing, report the results file")
    parser.add_argument("--table", type=Path, help="write the confusion as CSV too")
    parser.add_argument("--minutes", type=float, default=np.inf, help="begin no record after so long")
    parser.add_argument("--jobs", type=int, default=2)
    a = parser.parse_args()
    if a.report:
        results = _known(a.results)
    else:
        indices = range(a.first, a.first + a.count)
        tasks = list(tasks_in(a.folder)) if a.folder else [Task(g, k, a.seed) for g in a.groups for k in indices]
        tasks = [replace(task, by=a.by) for task in tasks]
        results = run_all(tasks, a.results, a.jobs, a.minutes)
    results.sort(key=lambda r: str(r["key"]))
    print(report(results))
    if a.table:
        write_table(results, a.table)


if __name__ == "__main__":
    main()
