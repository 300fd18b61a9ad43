"""Does the diagnosis name what machines hide that were drawn by hand? `python -m benchmarks.machines.run [NAME ...]`.

Each machine's records are made anew in a folder, and `signlin diagnose` is asked as a user asks it, in a process of its
own. Every answer is appended to the file of --results; --report judges what is in there and runs nothing. What an
answer is worth is in `judge`.
"""

from __future__ import annotations

import argparse
import csv
import json
import resource
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

from benchmarks.hidden.score import _brief, _known
from benchmarks.machines.families import MACHINES
from benchmarks.machines.judge import GRADES, judge, last_row, proposed, values
from benchmarks.machines.rig import Machine

MINUTES = 10.0
"""Of a processor, after which an answer is given up."""


def asked(machine: Machine, folder: Path, minutes: float = MINUTES) -> dict[str, Any]:
    """Return the row of a machine: the brief answer of the command line to its records, or the error."""
    model, training, validation = machine.write(folder)
    command = [sys.executable, "-m", "signlin_ros.cli", "diagnose", str(model), str(training)]
    began, limit = _processor_time(), round(60.0 * minutes)
    done = subprocess.run(
        [*command, "--validation", str(validation), "--jobs", "1", "--json"],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit, limit)),
    )
    refused = done.returncode == 2 and "--cure" in done.stderr
    late = f"no answer within {minutes:g} minutes of a processor" if done.returncode < 0 else ""
    said = done.stderr.strip().replace(f"{folder}/", "")[-2000:]
    error = late or (said if done.returncode else "")
    answer = json.loads(done.stdout) if not error else None
    return {
        "name": machine.name,
        "seconds": round(_processor_time() - began, 1),
        "answer": None if answer is None else _told(answer),
        "refused": refused,
        "error": error,
    }


def _processor_time() -> float:
    """Return the seconds of a processor that processes which have ended took."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _told(answer: dict[str, Any]) -> dict[str, Any]:
    """Return what is judged of an answer, and what the check found."""
    found = [f"{f['check']} ({f['severity']})" for f in answer["record"]["findings"]]
    return {**_brief(answer), "record": sorted(set(found))}


def said_of(row: dict[str, Any]) -> str:
    """Return an answer in short: the names of its last row, each with its ties."""
    answer = row["answer"]
    if answer is None:
        return f"{'refused' if row['refused'] else 'error'}: {(row['error'].splitlines() or [''])[-1]}"
    if answer["verdict"] == "missing":
        return " + ".join(" or ".join(sorted(tie)) for tie in proposed(answer))
    part = " + ".join(last_row(answer))
    return f"{answer['verdict']}{f', a part: {part}' if part else ''}"


def line(row: dict[str, Any]) -> str:
    """Return a machine's row of the table."""
    truth, answer = MACHINES[row["name"]].truth, row["answer"]
    told = values(truth, answer) if answer else []
    numbers = ", ".join(f"{n} {v:.3g} ({true:.3g}){'' if good else ' OFF'}" for n, v, true, good in told)
    grade = judge(truth, answer, row["refused"])
    return f"{row['name']:22} {grade:7} {row['seconds']:6.1f}  {' | '.join(truth.right):42} {said_of(row)}  {numbers}"


def report(rows: list[dict[str, Any]]) -> str:
    """Return the table, then how many answers have each grade."""
    grades = Counter(judge(MACHINES[r["name"]].truth, r["answer"], r["refused"]) for r in rows)
    head = f"{'machine':22} {'grade':7} {'s':>6}  {'right would be':42} answer, values (true)"
    count = ", ".join(f"{grades[g]} {g}" for g in GRADES)
    return "\n".join([head, *map(line, rows), f"{len(rows)} machines: {count}"])


def write_table(rows: list[dict[str, Any]], path: Path) -> None:
    """Write what was hidden, answered and judged as a CSV file."""
    with path.open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["machine", "hidden", "right", "answer", "grade", "seconds"])
        for row in rows:
            truth = MACHINES[row["name"]].truth
            grade = judge(truth, row["answer"], row["refused"])
            right = " or ".join(truth.right).replace("+", " + ")
            out.writerow([row["name"], truth.hidden, right, said_of(row), grade, row["seconds"]])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(MACHINES)}")
    parser.add_argument("--folder", type=Path, help="where the records are left; a temporary folder otherwise")
    parser.add_argument("--results", type=Path, help="JSON lines, appended to; the last row of a machine counts")
    parser.add_argument("--report", action="store_true", help="run nothing, judge what is in --results")
    parser.add_argument("--table", type=Path, help="write the table as CSV too")
    parser.add_argument("--minutes", type=float, default=MINUTES, help="of a processor, time-out of each")
    a = parser.parse_args()
    if unknown := [name for name in a.names if name not in MACHINES]:
        parser.error(f"unknown: {', '.join(unknown)}; there are {', '.join(MACHINES)}")
    names = a.names or list(MACHINES)
    rows = {r["name"]: r for r in _known(a.results) if r["name"] in names} if a.report else {}
    with tempfile.TemporaryDirectory() as scratch:
        for name in () if a.report else names:
            rows[name] = asked(MACHINES[name], (a.folder or Path(scratch)) / name, a.minutes)
            print(line(rows[name]), file=sys.stderr, flush=True)
            if a.results:
                a.results.parent.mkdir(parents=True, exist_ok=True)
                with a.results.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(rows[name]) + "\n")
    found = [rows[name] for name in names if name in rows]
    print(report(found))
    if a.table:
        write_table(found, a.table)


if __name__ == "__main__":
    main()
