"""Controllers beside one another: error, effort, chatter and limit cycles on twenty simulated plants.

    python -m benchmarks.controllers.table [--rigs NAME ...] [--seeds 3] [--jobs 2] [--output DIR] [--only-print]
    python -m benchmarks.controllers.table --standing      who oscillates in a stop of 30 s, with the tunings found
    python -m benchmarks.controllers.table --diagnosis     what a diagnosis is worth, beside it

Every trial (rig, what is tracked, period, seed) goes into a file of its own; what is there is not done again.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.controllers.plants import rigs
from benchmarks.controllers.trial import Trial, all_designs, standing, untuned
from signlin_ros.control.designs import DEFAULT_DESIGN, DESIGNS

PERIODS = (0.02, 0.2)
BASE = "friction_free"


def trials(names: Iterable[str], seeds: int, periods: Iterable[float]) -> list[Trial]:
    """Return all trials, the first seed of every rig first."""
    found = rigs()
    return [
        Trial(found[name], position, period, seed)
        for seed in range(seeds)
        for period in periods
        for name in names
        for position in (False, True)
    ]


def _politely() -> None:
    os.nice(max(0, 10 - os.nice(0)))


def work(todo: list[Trial], folder: Path, jobs: int, run: Callable[[Trial], dict[str, Any]]) -> None:
    """Do the trials that have no file yet, and write each when it is done."""
    folder.mkdir(parents=True, exist_ok=True)
    left = [trial for trial in todo if not (folder / f"{trial.name}.json").exists()]
    print(f"{len(todo) - len(left)} of {len(todo)} trials are there")
    with ProcessPoolExecutor(jobs, initializer=_politely) as pool:
        waiting = {pool.submit(run, trial): trial for trial in left}
        for k, future in enumerate(as_completed(waiting)):
            trial = waiting[future]
            partial = folder / f"{trial.name}.part"
            partial.write_text(json.dumps(future.result()))
            partial.rename(folder / f"{trial.name}.json")
            print(f"{k + 1}/{len(left)} {trial.name}", flush=True)


def read(todo: list[Trial], folder: Path) -> dict[Trial, dict[str, Any]]:
    """Return what has been done."""
    files = {trial: folder / f"{trial.name}.json" for trial in todo}
    return {trial: json.loads(file.read_text()) for trial, file in files.items() if file.exists()}


def beside(results: Mapping[Trial, dict[str, Any]], others: Mapping[Trial, dict[str, Any]]) -> dict[Trial, Any]:
    """Return results with others of the same trials beside them, once all of those are there."""
    if any(trial not in others for trial in results):
        return dict(results)
    return {trial: {**result, **others[trial]} for trial, result in results.items()}


# --------------------------------------------------------------------------- the table


def ratios(result: Mapping[str, Any], design: str, reference: str, base: str = BASE) -> tuple[float, float]:
    """Return a design's error over that of the base, on the nominal plant and in the mean of the mismatched."""
    own, other = result[design]["runs"], result[base]["runs"]
    mean = [float(np.mean([run[reference]["rms"] for run in runs[1:]])) for runs in (own, other)]
    return own[0][reference]["rms"] / other[0][reference]["rms"], mean[0] / mean[1]


def table(results: Mapping[Trial, dict[str, Any]], period: float, designs: Iterable[str], base: str = BASE) -> str:
    """Return medians over rigs of medians over seeds: nominal / mismatched, by design and reference."""
    kinds = {name: position for t in results for position in (t.position,) for name in t.rig.profiles(position)}
    lines = [f"updates every {1000 * period:g} ms".ljust(22) + "".join(name.rjust(34) for name in kinds)]
    for design in designs:
        cells = [_cell(results, period, design, name, position, base) for name, position in kinds.items()]
        lines.append(design.ljust(22) + "".join(cell.rjust(34) for cell in cells))
    return "\n".join(lines)


def _by_rig(
    results: Mapping[Trial, dict[str, Any]], period: float, position: bool, value: Callable[[dict[str, Any]], Any]
) -> dict[str, np.ndarray]:
    """Return the median over seeds of a value, by rig."""
    found: dict[str, list[Any]] = {}
    for trial, result in results.items():
        if (trial.period, trial.position) == (period, position):
            found.setdefault(trial.rig.name, []).append(value(result))
    return {name: np.median(np.array(values), axis=0) for name, values in found.items()}


def _cell(
    results: Mapping[Trial, dict[str, Any]], period: float, design: str, reference: str, position: bool, base: str
) -> str:
    by_rig = _by_rig(results, period, position, lambda r: ratios(r, design, reference, base))
    if not by_rig:
        return "-"
    values = np.array(list(by_rig.values()))
    middle, worst = np.median(values, axis=0), np.max(values, axis=0)
    return f"{middle[0]:.2f} / {middle[1]:.2f} (<{worst[0]:.2f} / {worst[1]:.2f})"


def oscillations(results: Mapping[Trial, dict[str, Any]], period: float, design: str) -> tuple[int, int, float]:
    """Return runs that oscillate at rest beyond the bound, all runs, and the largest as a multiple of the bound."""
    shares = [
        run[name]["oscillation"] / trial.rig.oscillation_bound
        for trial, result in results.items()
        if trial.position and trial.period == period
        for run in result[design]["runs"]
        for name in run
        if "oscillation" in run[name]
    ]
    return sum(s > 1.0 for s in shares), len(shares), max(shares, default=0.0)


def effort(results: Mapping[Trial, dict[str, Any]], period: float, design: str, what: str) -> float:
    """Return the median of effort or chatter as a share of the limit."""
    values = [
        run[name][what] / trial.rig.limit
        for trial, result in results.items()
        if trial.period == period
        for run in result[design]["runs"]
        for name in run
    ]
    return float(np.median(values)) if values else float("nan")


def report(results: Mapping[Trial, dict[str, Any]], base: str = BASE) -> str:
    """Return all tables."""
    designs = list(next(iter(results.values()))) if results else []
    parts = ["error relative to the friction-free LQR, nominal / mismatched, median over rigs (worst rig)"]
    for period in sorted({trial.period for trial in results}):
        parts.append(table(results, period, designs, base))
        rows = []
        for design in designs:
            bad, count, worst = oscillations(results, period, design)
            u, chatter = (effort(results, period, design, what) for what in ("effort", "chatter"))
            rows.append(f"{design.ljust(22)}{u:8.4f}{chatter:10.4f}{bad:8d} of {count}, worst {worst:.2g} x the bound")
        parts.append("effort and chatter as shares of the limit; oscillations at rest\n" + "\n".join(rows))
    return "\n\n".join(parts)


def standing_report(results: Mapping[Trial, dict[str, Any]]) -> str:
    """Return, by design and period, how many drives swing to and fro beyond the bound in a long stop, and the worst."""
    lines = []
    for period in sorted({trial.period for trial in results}):
        lines.append(f"updates every {1000 * period:g} ms: swings in a long stop beyond the bound")
        for name, design in DESIGNS.items():
            known = [(t, r[name]["tuning"]) for t, r in results.items() if t.position and t.period == period]
            shares = {t.name: standing(t, design, tuning) for t, tuning in known}
            every = [share for found in shares.values() for share in found]
            worst = max(shares, key=lambda key: max(shares[key]))
            bad, count = sum(s > 1.0 for s in every), len(every)
            lines.append(f"{name.ljust(22)}{bad:5d} of {count}, worst {max(every):.2g} x the bound ({worst})")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rigs", nargs="+", default=list(rigs()), choices=list(rigs()))
    parser.add_argument("--periods", nargs="+", type=float, default=list(PERIODS))
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--output", type=Path, default=Path("build/control"))
    parser.add_argument("--only-print", action="store_true", help="print what has been done, and do nothing")
    parser.add_argument("--standing", action="store_true", help="who oscillates in a long stop, of what has been done")
    parser.add_argument("--diagnosis", action="store_true", help="what a diagnosis is worth, with the default design")
    options = parser.parse_args()
    if options.diagnosis:
        from benchmarks.controllers.diagnosis import main_diagnosis

        main_diagnosis(options)
        return
    todo = trials(options.rigs, options.seeds, options.periods)
    folder = options.output / "designs"
    if options.standing:
        print(standing_report(read(todo, folder)))
        return
    if not options.only_print:
        work(todo, folder, options.jobs, all_designs)
        work(todo, options.output / "untuned", options.jobs, untuned)
    print(f"default design: {DEFAULT_DESIGN}\n")
    print(report(beside(read(todo, folder), read(todo, options.output / "untuned"))))


if __name__ == "__main__":
    main()
