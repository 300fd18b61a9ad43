"""Write docs/results.md from the measured results in docs/results/*.csv.

    python docs/make_results.py

A CSV is appended to where something is measured; the page is never edited by hand.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

DOCS = Path(__file__).resolve().parent
INTRODUCTION = """\
# Measured results

Written by `python docs/make_results.py` from the tables in `docs/results`. Intervals are
those of Wilson (1927), 95 %. A seed is fresh if nobody had looked into its records before the version that was scored.
"""
GROUPS = {
    "single": "one hidden effect, named",
    "weak": "at a third of the strength",
    "none": "nothing hidden, nothing named",
    "outside": "outside the catalogue, refused",
}
NEWEST = 4
"""Seeds that have a row of their own; the sum is of all, which are in docs/results/simulated_effects.csv."""


def rows_of(name: str) -> list[dict[str, str]]:
    """Return the rows of a table by column."""
    with (DOCS / "results" / f"{name}.csv").open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def interval(right: int, total: int) -> tuple[float, float]:
    """Return the 95 % interval of a share, in per cent.   [Wilson 1927, doi:10.1080/01621459.1927.10502953]"""
    z = 1.959964
    p, n = right / total, total
    centre, half = p + z**2 / (2 * n), z * math.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    return tuple(100 * (centre + sign * half) / (1 + z**2 / n) for sign in (-1, 1))  # type: ignore[return-value]


def share(right: str, total: str) -> str:
    """Return ``126 / 130 (92.4 to 98.8 %)``, or a dash where it was not run."""
    if not total:
        return "-"
    low, high = interval(int(right), int(total))
    return f"{right} / {total} ({low:.1f} to {high:.1f} %)"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def simulated() -> str:
    """Return the table of simulated records with one hidden effect."""
    rows = rows_of("simulated_effects")
    body = [[r["seed"], *(share(r[f"{g}_right"], r[f"{g}_of"]) for g in GROUPS)] for r in rows[:NEWEST]]
    sums = ["all"]
    for group in GROUPS:
        run = [r for r in rows if r[f"{group}_of"]]
        sums.append(share(*(str(sum(int(r[f"{group}_{what}"]) for r in run)) for what in ("right", "of"))))
    text = "`python -m benchmarks.hidden.score --groups single --count 130 --seed N` repeats a cell on today's version."
    text += " Older seeds: `docs/results/simulated_effects.csv`; `all` counts them."
    return f"\n## Simulated records\n\n{text}\n\n{table(['seed', *GROUPS.values()], [*body, sums])}"


def measured() -> str:
    """Return the tables of measured machines."""
    rows = [
        [r["record"], r["answer"], f"{r['before']} to {r['after']} {r['unit']}"] for r in rows_of("measured_machines")
    ]
    pieces = rows_of("published_machines")
    rounds = max(int(r["round"]) for r in pieces)
    text = (
        f"{len(pieces)} pieces of logs that others have published, in {rounds} rounds, each described (what may be "
        "expected) before it was asked: expectation and first answer of each are in "
        "`docs/results/published_machines.csv`."
    )
    return (
        f"\n## Measured machines\n\nForce residual or error on validation data, before and after.\n\n"
        f"{table(['record', 'answer', 'residual'], rows)}\n{text}\n"
    )


def arms() -> str:
    """Return the table of simulated arms with one hidden effect."""
    rows = rows_of("simulated_arms")
    body = [
        [r["seed"], r["hidden"].replace("_", " "), share(r["right"], r["of"]), r["neighbour"], r["false_second"]]
        for r in rows
    ]
    text = (
        "A UR10e under a controller, simulated by another program, its links not those of the URDF: joint and effect "
        "named, alone or with a tie on that joint; of *none* nothing named. *Neighbour*: a law of another joint, or of "
        "the robot, is named first; *false second*: another law beside the right one. "
        "`python -m benchmarks.arms URDF KIND COUNT SEED` repeats a row."
    )
    head = ["seed", "hidden", "right", "neighbour", "false second"]
    return f"\n## Simulated arms\n\n{text}\n\n{table(head, body)}"


def drawn() -> str:
    """Return how machines drawn by hand were answered, and which not rightly."""
    rows, before = rows_of("drawn_machines"), rows_of("drawn_machines_first")
    grades = ("right", "part", "honest", "wrong", "failed")
    now, first = (
        ", ".join(f"{sum(r['grade'] == grade for r in of)} {grade}" for grade in grades) for of in (rows, before)
    )
    text = (
        f"{len(rows)} machines with their controllers, encoders, filters and logs, simulated by a program of their own "
        "(`python -m benchmarks.machines.run`), among them some that hide nothing and some whose effect is not listed. "
        "Truth and seed were written down before, but for the delays of a held command and of a filter, which were "
        "allowed where they were found, and two whose law hardly acted, which were drawn again. First answers of "
        f"{len(before)}: {first}. Answers after what they showed was mended: {now}. *Part*: a true name is told, but "
        "not confirmed or not alone, or with a wrong value; *honest*: nothing is named. What each machine hides, and "
        "its answer, are in `docs/results/drawn_machines.csv`. Not right:"
    )
    body = [
        [grade, ", ".join(r["machine"].replace("_", " ") for r in rows if r["grade"] == grade)]
        for grade in grades[1:]
        if any(r["grade"] == grade for r in rows)
    ]
    return f"\n## Machines drawn by hand\n\n{text}\n\n{table(['grade', 'machines'], body)}"


def live() -> str:
    """Return the table of changes of running machines, and that of times."""
    rows = [[r["what"], share(r["right"], r["of"]), r["seeds"]] for r in rows_of("live_changes")]
    times = [[r["what"], f"{r['value']} {r['unit']}"] for r in rows_of("speed")]
    text = "One thread, a quiet machine with two cores; `make bench` prints ratios against peers of the same run."
    return (
        "\n## Changes of a running machine\n\n`benchmarks/live_changes.py`.\n\n"
        f"{table(['what', 'right', 'seeds'], rows)}"
        f"\n## Speed\n\n{text}\n\n{table(['what', 'value'], times)}"
    )


def page() -> str:
    """Return the whole page."""
    return INTRODUCTION + simulated() + arms() + drawn() + measured() + live()


def main() -> None:
    """Write the page."""
    (DOCS / "results.md").write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
