"""Compile ahead: everything that a diagnosis, a comparison, gains and a controller will need, once, onto the disk."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from signlin_ros.control.controller import Controller, ControllerSettings
from signlin_ros.control.gains import Wishes, gains_content
from signlin_ros.diagnosis.comparison import compare
from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
from signlin_ros.diagnosis.output_error import FitCache, estimator_of
from signlin_ros.diagnosis.output_error.trials import CandidateParts, trials
from signlin_ros.diagnosis.verbs import diagnose
from signlin_ros.fitting.prepare import held_in_turn, prepared
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

WARMING_STEP, WARMING_SAMPLES = 0.005, 800
"""Sampling time in s, and how many samples a record has."""
WARMING_MOTOR = {"R_a": 1.0, "L_a": 0.0, "K_t": 0.1, "K_m": 0.1, "B": 1e-4, "J": 1e-3}
"""A small motor, in SI units."""
MOST_SHOWN = "load_dependent_friction"
"""The law that most geared servos show [Duclusaud et al., ICRA 2025, arXiv:2410.08650]."""


def warm_up() -> float:
    """Diagnose and compare a short simulated record that lacks friction, follow it with a play, control a motor and
    choose its gains; returns the seconds taken.
    """
    begun = time.perf_counter()
    model = Model.from_dict({"plant": "dc_motor", "parameters": WARMING_MOTOR})
    truth = model.with_effect("coulomb_friction", None, mu=0.02)
    known, unseen = _record(truth, 1), _record(truth, 2)
    diagnose(model, known, unseen, jobs=1)
    compare(model, known)
    Controller(Model.load("dc_motor"), ControllerSettings(limit=12.0))
    gains_content(Model.load("dc_motor"), {}, Wishes(limit=12.0))
    motion = estimator_of(*prepared(model, [known], [unseen]), DEFAULT_CRITERIA, FitCache(), jobs=1)
    motion.at_values_of(["backlash"], model.with_effect("backlash", None, gap=0.5, k=20.0, c=0.05, J=5e-4))
    return time.perf_counter() - begun


def warm_laws(model: Model) -> float:
    """Compile every law that a diagnosis of a plant in a closed loop tries on a model, alone and beside the friction
    that most servos show; returns the seconds taken.
    """
    begun = time.perf_counter()
    goals = (1.0, 0.7)
    problem, _ = held_in_turn(model, [_of_goal(model, size, f"warming {i}") for i, size in enumerate(goals, 1)])
    parts = [CandidateParts(problem.base, (), {})]
    options = trials(problem)
    parts += [parts[0].extended(t.name, t.starts[0]) for t in options if t.name == MOST_SHOWN]
    for now in parts:
        now.candidate(problem)
        for trial in options:
            if trial.name not in {use.type for use in now.model.effects.values()}:
                now.extended(trial.name, trial.starts[0]).candidate(problem)
    return time.perf_counter() - begun


def _of_goal(model: Model, size: float, source: str) -> ModelData:
    """Return a record of a goal of some size in rad."""
    t: NDArray[np.float64] = WARMING_STEP * np.arange(WARMING_SAMPLES, dtype=np.float64)
    u = np.tile(model.u0, (t.size, 1))
    u[:, 0] = size * np.sin(2.0 * t) + 0.3 * size * np.sin(9.0 * t)
    x0 = np.zeros(len(model.states))
    seen = {model.plant.position: simulate(model, t, u, x0)[model.plant.position]}
    return ModelData(t, u, seen, x0, model.inputs, model.states, model.units, source)


def _record(truth: Model, seed: int) -> ModelData:
    rng = np.random.default_rng(seed)
    t: NDArray[np.float64] = WARMING_STEP * np.arange(WARMING_SAMPLES, dtype=np.float64)
    tones = 2.0 * np.pi * rng.uniform(0.5, 5.0, 4)
    u = 2.0 * np.sin(tones * t[:, None] + rng.uniform(0.0, 6.0, 4)).sum(axis=1)[:, None]
    speed = simulate(truth, t, u).x[:, truth.states.index("speed")]
    seen = {"speed": speed + 0.01 * np.std(speed) * rng.normal(size=t.size)}
    return ModelData(t, u, seen, None, truth.inputs, ("speed",), {"speed": truth.units["speed"]})


__all__ = ["warm_laws", "warm_up"]
