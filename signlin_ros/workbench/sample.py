"""A sample to try the page with: a motor whose dry friction and load the model file does not know.

The records are made by the project's own exact simulation, noise by a generator with a fixed seed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from signlin_ros.model import Model
from signlin_ros.records import Record, Signal, write_record
from signlin_ros.simulation import simulate

Array = NDArray[np.float64]

SAMPLE_RATE, SAMPLE_DURATION = 200.0, 16.0
SAMPLE_NOISE = {"current": 0.03, "speed": 0.15}
"""Standard deviations in A and rad/s."""
SAMPLE_RECORDS = {"monday": 1, "tuesday": 2}
"""Names of the records, and the seeds of input and noise."""


def write_sample(folder: Path) -> list[Path]:
    """Write ``my_motor.yaml``, ``monday.csv`` and ``tuesday.csv``; return them."""
    known = Model.load("dc_motor").without_effect("coulomb_friction")
    truth = known.with_effect("coulomb_friction", mu=0.033).with_effect("constant_load", F0=-0.012)
    model = folder / "my_motor.yaml"
    known.with_options(update_period=0.1).save(model)
    files = [folder / f"{name}.csv" for name in SAMPLE_RECORDS]
    for file, seed in zip(files, SAMPLE_RECORDS.values(), strict=True):
        write_record(_measured(truth, seed), file)
    return [model, *files]


def _measured(truth: Model, seed: int) -> Record:
    random = np.random.default_rng(seed)
    t = np.arange(int(SAMPLE_RATE * SAMPLE_DURATION)) / SAMPLE_RATE
    voltage = _multisine(t, random)
    run = simulate(truth, t, voltage[:, None], np.zeros(len(truth.states)))
    signals = {"voltage": Signal(voltage, "V")}
    for name, sigma in SAMPLE_NOISE.items():
        signals[name] = Signal(run[name] + sigma * random.standard_normal(t.size), truth.units[name])
    return Record(t, signals, "sample")


def _multisine(t: Array, random: np.random.Generator) -> Array:
    """Return slow and fast waves together, so that the motor reverses often and also stands."""
    waves = [(0.15, 1.6), (0.4, 1.0), (0.9, 0.7), (2.1, 0.4)]
    phases = random.uniform(0.0, 2 * np.pi, len(waves))
    return np.asarray(sum(a * np.sin(2 * np.pi * f * t + p) for (f, a), p in zip(waves, phases, strict=True)))


__all__ = ["write_sample"]
