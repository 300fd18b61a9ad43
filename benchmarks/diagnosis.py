"""(f) The diagnosis: seconds against record length, split by step; names on the shared records, beside PySINDy."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from measure import Report
from prediction import DATA

from signlin_ros.diagnosis import diagnose, load_records
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

LENGTHS = {"one effect": (3_200, 12_800, 100_000), "two effects": (3_200,)}
MOST, MOST_AT_FIRST = {"one effect": 2.0, "two effects": 4.0}, 30.0
"""Seconds that the shortest record may take, and the first one on a machine."""
STEP = 0.005


ONE_DIAGNOSIS = "import sys; sys.path.insert(0, sys.argv[1]); import diagnosis; diagnosis.first()"


def run(report: Report) -> None:
    """Print all parts."""
    _speed(report)
    _first(report)
    _names(report)


def _record(model: Model, samples: int, seed: int) -> ModelData:
    """Return a noisy record of a motor under a multisine."""
    rng = np.random.default_rng(seed)
    t = np.arange(samples) * STEP
    tones = 2 * np.pi * rng.uniform(0.05, 3.0, 8)
    u = 1.5 * np.sin(tones * t[:, None] + rng.uniform(0, 6, 8)).sum(axis=1)[:, None]
    x = simulate(model, t, u).x
    y = x + 0.01 * np.std(x, axis=0) * rng.normal(size=x.shape)
    measured = {name: y[:, i] for i, name in enumerate(model.states)}
    return ModelData(t, u, measured, None, model.inputs, model.states, dict(model.units))


def _timed(base: Model, truth: Model, samples: int) -> tuple[float, dict[str, float], tuple[str, ...]]:
    data = [_record(truth, samples, 1)], [_record(truth, samples, 2)]
    steps: dict[str, float] = {}
    begun = last = time.perf_counter()
    name = "preparing"

    def note(what: str, share: float) -> None:
        nonlocal last, name
        now = time.perf_counter()
        steps[name] = steps.get(name, 0.0) + now - last
        last, name = now, what

    found = diagnose(base, *data, progress=note)
    note("end", 1.0)
    return time.perf_counter() - begun, steps, found.ladder[-1].effects


def _models() -> tuple[Model, dict[str, Model]]:
    """Return what the user has, and what the drives are."""
    base = Model.load("dc_motor").without_effect("coulomb_friction").with_options(with_position=True)
    one = base.with_effect("coulomb_friction", mu=0.033)
    return base, {"one effect": one, "two effects": one.with_effect("quadratic_drag", c2=6e-5)}


def _speed(report: Report) -> None:
    report.section("Diagnosis: seconds against record length (motor, all effects and sensor faults, two records)")
    base, drives = _models()
    for label, truth in drives.items():
        first, *_ = _timed(base, truth, LENGTHS[label][0])
        report.line(f"{label}, first run in this process", f"{first:8.1f} s (kernels from the cache if there is one)")
        for samples in LENGTHS[label]:
            seconds, steps, effects = _timed(base, truth, samples)
            parts = ", ".join(f"{k} {v:.1f}" for k, v in steps.items())
            report.figures[f"diagnosis, {label}, {samples} samples [s]"] = seconds
            report.line(f"{label}, {samples} samples", f"{seconds:8.1f} s  ({parts}) -> {' + '.join(effects)}")
        shortest = report.figures[f"diagnosis, {label}, {LENGTHS[label][0]} samples [s]"]
        report.target(f"diagnosis, {label}", shortest, high=MOST[label], unit="s")


def first() -> None:
    """Diagnose one record; what a process does that is timed from outside."""
    base, drives = _models()
    _timed(base, drives["one effect"], LENGTHS["one effect"][0])


def _first(report: Report) -> None:
    """Time whole processes: with nothing compiled on the machine, and again with what the first one left."""
    with tempfile.TemporaryDirectory() as cache:
        env = {**os.environ, "NUMBA_CACHE_DIR": cache}
        command = [sys.executable, "-c", ONE_DIAGNOSIS, str(Path(__file__).resolve().parent)]
        for label in ("nothing compiled yet", "the second process"):
            begun = time.perf_counter()
            subprocess.run(command, check=True, env=env)
            report.figures[f"diagnosis, {label} [s]"] = seconds = time.perf_counter() - begun
            report.line(f"a whole process, {label}", f"{seconds:8.1f} s")
    cold = "diagnosis, nothing compiled yet"
    report.target(cold, report.figures[f"{cold} [s]"], high=MOST_AT_FIRST, unit="s")


def _names(report: Report) -> None:
    report.section("Names on the sixteen shared records, beside PySINDy (its best setting without true values)")
    folder = DATA / "hidden_effects"
    if not folder.is_dir():
        report.line("skipped", f"no folder {folder}; name the data with SIGNLIN_DATA")
        return
    truths = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
    ours = [_right(t, _named(folder / t["name"])) for t in truths]
    report.line("signlin diagnose", f"{sum(ours)} of {len(ours)} right")
    theirs = [_right(t, name) for t, name in zip(truths, _pysindy(folder, truths), strict=True) if name is not None]
    report.line(
        "PySINDy",
        f"{sum(theirs)} of {len(theirs)} right" if theirs else "not installed: pip install 'signlin_ros[bench]'",
    )


def _right(truth: dict[str, Any], name: str | None) -> bool:
    hidden = [h for h in truth["hidden"] if h != "none"]
    if any("unlisted" in h for h in hidden):
        return name == "unexplained"
    return name == (" + ".join(sorted(hidden)) or "none")


def _named(folder: Path) -> str:
    paths = [str(folder / f"{part}.csv") for part in ("estimation", "validation")]
    model, (first, second) = load_records(Model.load(folder / "model.yaml"), paths)
    found = diagnose(model, first, second)
    if found.verdict == "unexplained":
        return "unexplained"
    return " + ".join(sorted(found.ladder[-1].effects)) or "none"


def _pysindy(folder: Path, truths: list[dict[str, Any]]) -> list[str | None]:
    try:
        import pysindy  # type: ignore[import-untyped, unused-ignore]  # noqa: F401
    except ImportError:
        return [None] * len(truths)
    import yaml

    from benchmarks.hidden.generator import HiddenRecord
    from benchmarks.hidden.pysindy_peer import name_record

    names: list[str | None] = []
    for t in truths:
        place = folder / t["name"]
        settings = yaml.safe_load((place / "model.yaml").read_text(encoding="utf-8"))
        parts = [_columns(place / f"{part}.csv") for part in ("estimation", "validation")]
        name = name_record(HiddenRecord(t["name"], settings, *parts, t))
        names.append("none" if name == "adequate" else name)
    return names


def _columns(path: Path) -> dict[str, Any]:
    table = np.genfromtxt(path, delimiter=",", names=True)
    return {name: table[name] for name in table.dtype.names or ()}
