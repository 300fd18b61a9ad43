"""Several records at once: pendulums that were let go and seen by an encoder."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.diagnosis import diagnose
from signlin_ros.fitting.problem import prepare
from signlin_ros.model import Model
from signlin_ros.noise import fourth_difference_noise
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

QUANTUM, NOISE = 0.00153, 5e-4
UNITS = {"force": "N·m", "displacement": "rad"}
PENDULUM = Model.from_dict(
    {
        "plant": "mass_spring_damper",
        "parameters": {"m": 0.0125, "c": 4e-4, "k": 0.0},
        "effects": {"gravity_load": {"A": 0.62, "q0": 0.0}},
    }
)


def record(t, u, q) -> ModelData:
    return ModelData(t, u[:, None], {"displacement": q}, None, PENDULUM.inputs, PENDULUM.states, UNITS)


def let_go(seed: int, *effects: tuple[str, dict[str, float]]) -> ModelData:
    """Return a record of a pendulum that swings until it hardly moves, seen by an encoder."""
    rng, t = np.random.default_rng(seed), np.arange(1500) * 0.01
    model = PENDULUM
    for name, values in effects:
        model = model.with_effect(name, **values)
    q = simulate(model, t, np.zeros((t.size, 1)), x0=[1.2 + 0.2 * rng.random(), 0.0]).x[:, 0]
    return record(t, np.zeros(t.size), QUANTUM * np.round((q + NOISE * rng.normal(size=t.size)) / QUANTUM))


def test_noise_is_not_told_from_where_one_record_ends_and_another_begins():
    rng = np.random.default_rng(1)
    first, second = rng.normal(size=2000), 1e4 + rng.normal(size=2000)
    assert fourth_difference_noise(first, second) == pytest.approx(1.0, rel=0.1)
    data = [let_go(seed) for seed in (1, 2)]
    alone = [prepare(PENDULUM, [d]).noise[0] for d in data]
    assert min(alone) <= prepare(PENDULUM, data).noise[0] <= max(alone)


@pytest.mark.slow
def test_two_frictions_of_a_pendulum_that_nothing_drives_are_told_apart():
    """Unexplained: in the regression all forces, with the inertia, shrank to nothing."""
    drag, dry = ("quadratic_drag", {"c2": 6e-4}), ("coulomb_friction", {"mu": 0.004})
    data = [let_go(seed, drag, dry) for seed in (1, 2, 3)]
    found = diagnose(PENDULUM.with_parameters({"m": 0.0125 * 1.02}), data[:2], data[2:])
    assert found.verdict == "missing"
    assert set(found.ladder[-1].effects) == {"quadratic_drag", "coulomb_friction"}
    assert found.parameters["quadratic_drag.c2"].value == pytest.approx(6e-4, rel=0.1)
    assert found.parameters["quadratic_drag.c2"].unit == "N·m·s²/rad²"
    assert found.parameters["coulomb_friction.mu"].value == pytest.approx(0.004, rel=0.1)
