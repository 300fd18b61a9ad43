"""What a diagnosis is worth: one design with no friction, Coulomb friction, what `refine` found, and the truth."""

from __future__ import annotations

import argparse
import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.controllers.plants import Rig
from benchmarks.controllers.table import read, report, trials, work
from benchmarks.controllers.trial import Trial, tuned
from signlin_ros.control.designs import DEFAULT_DESIGN, DESIGNS
from signlin_ros.control.drive import friction_free
from signlin_ros.model import Model
from signlin_ros.records import ModelData, read_for_model
from signlin_ros.simulation import simulate

RATE, LENGTH = 200.0, 16.0
"""Samples per second and length in s of the record that is diagnosed."""
KNOWN = ("friction_free", "coulomb", "refined", "truth")
"""What the controller knows."""


def record(rig: Rig, folder: Path) -> Path:
    """Write what the rig's sensors show under a slow multisine that reverses it."""
    file = folder / f"{rig.name}.csv"
    rng = np.random.default_rng(7)
    t = np.arange(0.0, LENGTH, 1.0 / RATE)
    u = sum(np.sin(2 * np.pi * f * t + rng.uniform(0, 6.3)) / f**0.3 for f in (0.15, 0.35, 0.8, 1.7, 3.1))
    u = 0.12 * rig.limit * u / np.std(u)
    run = simulate(rig.model, t, u[:, None])
    names = (rig.model.plant.position, rig.model.plant.velocity)
    noisy = [run[name] + s * rng.standard_normal(t.size) for name, s in zip(names, rig.noise, strict=True)]
    table = np.column_stack([t, u, *noisy])
    head = ",".join(("t", rig.model.inputs[0], *names))
    np.savetxt(file, table, delimiter=",", header=head, comments="", fmt="%.9g")
    return file


def _data(model: Model, file: Path) -> list[ModelData]:
    return [read_for_model(file, model)]


def models(rig: Rig, folder: Path) -> dict[str, Model]:
    """Return what a controller may know of a rig; what was found is kept in files."""
    from signlin_ros.diagnosis import add, refine

    folder.mkdir(parents=True, exist_ok=True)
    bare = friction_free(rig.model)
    data = _data(bare, record(rig, folder))
    makers = {
        "coulomb": lambda: add("coulomb_friction", bare, data).model,
        "refined": lambda: refine(bare, data).model,
    }
    found = {"friction_free": bare, "truth": rig.model}
    for name, make in makers.items():
        file = folder / f"{rig.name}-{name}.yaml"
        if not file.exists():
            make().save(file)
        found[name] = Model.load(file)
    return {name: found[name] for name in KNOWN}


def one(folder: Path, trial: Trial) -> dict[str, Any]:
    """Return the default design's result on a trial with each model."""
    return {name: tuned(trial, DESIGNS[DEFAULT_DESIGN], model) for name, model in models(trial.rig, folder).items()}


def gain(results: Mapping[Trial, dict[str, Any]]) -> str:
    """Return, by rig, the error with what was found over that with Coulomb friction alone, nominal plant."""
    lines = []
    for trial, result in results.items():
        mean = {k: np.mean([run["rms"] for run in result[k]["runs"][0].values()]) for k in KNOWN}
        lines.append(
            f"{trial.name.ljust(44)}{mean['refined'] / mean['coulomb']:8.2f}{mean['truth'] / mean['coulomb']:8.2f}"
        )
    return "error with what refine found, and with the truth, over that with Coulomb alone\n" + "\n".join(lines)


def main_diagnosis(options: argparse.Namespace) -> None:
    todo = trials(options.rigs, options.seeds, options.periods)
    folder = options.output / "diagnosis"
    if not options.only_print:
        work(todo, folder, options.jobs, functools.partial(one, options.output / "models"))
    results = read(todo, folder)
    print(report(results))
    print(gain(results))
