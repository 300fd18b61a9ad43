"""What each rule of the diagnosis is worth: every criterion is switched off, one after the other, on a fixed panel.

    python -m benchmarks.ablation [--real DATA] [--only NAME ...] [--jobs 2] [--results out/ablation.jsonl]

The panel: simulated records of a seed that decided nothing else (effects of ordinary and of a third of the strength,
nothing hidden, laws that are not listed), those that are answered in some seconds; and the records of another program
and the real machines in the folder of the shared records, if it is given.
Printed for each criterion: how many records are answered rightly without it, and which answers change. A criterion
without which nothing changes is worth nothing on this panel.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from benchmarks.hidden.generator import draw, write
from benchmarks.hidden.score import NAMED, judge
from signlin_ros.diagnosis import diagnose, load_records
from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA, Criteria
from signlin_ros.diagnosis.progress import CancelledError, Progress
from signlin_ros.model import Model
from signlin_ros.records import ModelData

SEED = 146
PANEL = {
    "single": (2, 4, 6, 7, 8, 9, 10, 11),
    "weak": (1, 2, 3, 4, 5, 6, 8, 9),
    "none": (1, 2, 3, 4, 5),
    "outside": (0, 4, 5, 8),
}
"""Seed and numbers of the simulated records."""
SHARED = "hidden_effects"
"""Folder of those of another program."""
REAL = {
    "null effect": ("field/verdicts/null-effect-confirmed", "nominal.yaml", "a.csv", "b.csv", {"coulomb_friction"}),
    "random current": ("field/verdicts/headline-vs-table", "nominal.yaml", "a.csv", "b.csv", set()),
    "friction damper": ("real/friction_damper", "*.yaml", "*0.5Hz_1in*", "*1Hz_0.5in*", {"play_friction"}),
}
"""Real machines: folder, model, what is fitted to, what is unseen, what must be named; nothing: unexplained."""
ALWAYS, NEVER = 0.0, 1e9
LIMIT = 60.0
"""Seconds of processor time that an answer may take: without some rules a search finds no end."""
OFF: dict[str, float | int] = {
    "min_t": ALWAYS,
    "min_validation_t": ALWAYS,
    "min_share_per_parameter": ALWAYS,
    "min_coefficient_t": 1e-3,
    "max_relative_std": NEVER,
    "max_rise_t": NEVER,
    "visible_change": ALWAYS,
    "tie_t": ALWAYS,
    "max_effects": 1,
    "beam_width": 1,
    "min_periods": 1.0,
    "min_turns": ALWAYS,
    "max_tolerances_off": NEVER,
    "max_bent": NEVER,
    "min_bent_share": NEVER,
    "max_inertial_noise": 0.1,
    "band_widening": 1.0,
    "min_force_over_noise": ALWAYS,
    "max_rmse_over_noise": ALWAYS,
    "max_dependent_share": NEVER,
    "min_flexible_t": NEVER,
    "min_flexible_share": ALWAYS,
    "max_force_mse_left": NEVER,
    "max_rmse_left": NEVER,
    "min_missing_share": NEVER,
}
"""The value of every criterion at which it decides nothing."""


@dataclass(frozen=True)
class Case:
    """A record of the panel with a criterion switched off (none: empty)."""

    record: str
    off: str
    data: str = ""

    @property
    def key(self) -> str:
        """The name under which its answer is kept."""
        return f"{self.record}|{self.off}"


def without(name: str) -> Criteria:
    """Return the criteria with one switched off."""
    return replace(DEFAULT_CRITERIA, **{name: OFF[name]}) if name else DEFAULT_CRITERIA


def run(case: Case) -> dict[str, Any]:
    """Diagnose a record of the panel."""
    began = time.process_time()
    try:
        told, right = (_real if case.record in REAL else _shared if case.data else _drawn)(case)
    except CancelledError:
        told, right = f"no answer in {LIMIT:.0f} s", False
    except Exception as error:  # noqa: BLE001  whatever goes wrong is an answer too
        told, right = f"{type(error).__name__}: {error}", False
    seconds = round(time.process_time() - began, 1)
    return {"key": case.key, "record": case.record, "off": case.off, "told": told, "right": right, "seconds": seconds}


def _answer(model: Model, known: ModelData, unseen: ModelData, case: Case) -> dict[str, Any]:
    """Return the diagnosis as JSON; raises `CancelledError` where it takes too long."""
    end = time.process_time() + LIMIT
    criteria = without(case.off)
    late = lambda: time.process_time() > end  # noqa: E731
    return diagnose(model, known, unseen, jobs=1, criteria=criteria, progress=Progress(cancelled=late)).to_json()


def _drawn(case: Case) -> tuple[str, bool]:
    group, index = case.record.split("/")
    record = draw(group, int(index), SEED)
    with tempfile.TemporaryDirectory() as scratch:
        return _judged(write(record, Path(scratch)), record.truth, case)


def _shared(case: Case) -> tuple[str, bool]:
    folder = Path(case.data, case.record)
    truths = json.loads((folder.parent / "truth.json").read_text(encoding="utf-8"))
    return _judged(folder, next(truth for truth in truths if truth["name"] == folder.name), case)


def _judged(folder: Path, truth: Mapping[str, Any], case: Case) -> tuple[str, bool]:
    paths = [str(folder / f"{name}.csv") for name in ("estimation", "validation")]
    model, (known, unseen) = load_records(Model.load(folder / "model.yaml"), paths)
    answer = _answer(model, known, unseen, case)
    answer["ranking"] = [e for e in answer["ranking"] if e["status"] in NAMED]
    return _told(answer), bool(judge({"truth": truth, "answer": answer})["right"])


def _real(case: Case) -> tuple[str, bool]:
    folder, *names, truth = REAL[case.record]
    model, known, unseen = (next(Path(case.data, folder).glob(name)) for name in names)
    loaded, data = load_records(Model.load(model), [str(known), str(unseen)])
    answer = _answer(loaded, data[0], data[1], case)
    named = set(answer["ladder"][-1]["effects"]) if answer["verdict"] == "missing" else set()
    return _told(answer), named == truth


def _told(answer: Mapping[str, Any]) -> str:
    effects = "+".join(answer["ladder"][-1]["effects"]) if answer["ladder"] else ""
    return effects if answer["verdict"] == "missing" else f"{answer['verdict']} {effects}".strip()


def cases(data: str, only: list[str]) -> Iterator[Case]:
    """Return all that is to be run, the criteria as they are first."""
    records = [(f"{g}/{i}", "") for g, numbers in PANEL.items() for i in numbers]
    shared = sorted(Path(data, SHARED).glob("*/model.yaml")) if data else []
    records += [(f"{SHARED}/{file.parent.name}", data) for file in shared]
    records += [(name, data) for name, (folder, *_) in REAL.items() if data and Path(data, folder).exists()]
    for off in ("", *(only or OFF)):
        yield from (Case(name, off, folder) for name, folder in records)


def table(rows: list[dict[str, Any]]) -> str:
    """Return what each criterion is worth, as Markdown."""
    by: dict[str, dict[str, dict[str, Any]]] = defaultdict(dict)
    for row in rows:
        by[row["off"]][row["record"]] = row
    usual = by.pop("", {})
    lines = ["| criterion off | value | right | answers that change |", "|---|---|---|---|"]
    lines.append(f"| none | | {sum(r['right'] for r in usual.values())} of {len(usual)} | |")
    for name, found in sorted(by.items(), key=lambda item: sum(r["right"] for r in item[1].values())):
        pairs = [(k, usual[k]["told"], r["told"]) for k, r in found.items() if k in usual]
        other = [f"{k}: {before} -> {after}" for k, before, after in pairs if before != after]
        right = sum(r["right"] for r in found.values())
        lines.append(f"| {name} | {OFF[name]:g} | {right} of {len(found)} | {'; '.join(other) or 'none'} |")
    return "\n".join(lines)


def main() -> None:
    """Run what has no answer yet, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--real", default="", help="folder of the shared records")
    parser.add_argument("--only", nargs="+", default=[], choices=sorted(OFF), metavar="NAME", help="these criteria")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--results", type=Path, default=Path("out/ablation.jsonl"))
    given = parser.parse_args()
    missing = {f.name for f in fields(Criteria)} ^ set(OFF)
    if missing:
        raise SystemExit(f"criteria and what switches them off differ: {sorted(missing)}")
    given.results.parent.mkdir(parents=True, exist_ok=True)
    rows = [json.loads(line) for line in given.results.read_text().splitlines()] if given.results.exists() else []
    there = {row["key"] for row in rows}
    left = [case for case in cases(given.real, given.only) if case.key not in there]
    with ProcessPoolExecutor(given.jobs) as pool, given.results.open("a") as file:
        for k, done in enumerate(as_completed([pool.submit(run, case) for case in left]), 1):
            rows.append(done.result())
            file.write(json.dumps(rows[-1]) + "\n")
            file.flush()
            print(f"\r{k} of {len(left)}", end="", flush=True)
    print("\n" + table(rows))


if __name__ == "__main__":
    main()
