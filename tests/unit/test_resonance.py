"""A load behind a coupling shows in the spectra of what a model lacks: where its fit starts from."""

import numpy as np
import pytest
from scipy.signal import cont2discrete

from signlin_ros.diagnosis import diagnose
from signlin_ros.diagnosis.dataset import dataset_of
from signlin_ros.diagnosis.output_error.trials import seen_loads
from signlin_ros.fitting.resonance import load_start
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

STEP = 0.004
MOTOR, LOAD, STIFFNESS, DAMPING, VISCOUS = 2.3, 3.9, 9000.0, 9.0, 8.6


def carriage(seed, coupled=True, seconds=12.0):
    """Return the record of a motor that moves a carriage over a belt; rigid where it is not ``coupled``."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, seconds, STEP)
    tones = np.geomspace(0.4, 18.0, 14)
    u = np.sin(2 * np.pi * tones * t[:, None] + rng.uniform(0.0, 6.28, tones.size)).sum(axis=1)[:, None] * 8.0
    k, c = (STIFFNESS, DAMPING) if coupled else (0.0, 0.0)
    m = MOTOR if coupled else MOTOR + LOAD
    A = np.array([[0, 1, 0, 0], [-k / m, -(c + VISCOUS) / m, k / m, c / m], [0, 0, 0, 1], [k, c, -k, -c]], dtype=float)
    A[3] /= LOAD
    B, C = np.array([[0.0], [1.0 / m], [0.0], [0.0]]), np.array([[1.0, 0.0, 0.0, 0.0]])
    F, G, *_ = cont2discrete((A, B, C, np.zeros((1, 1))), STEP)
    x, q = np.zeros(4), np.empty(t.size)
    for i, force in enumerate(u):
        q[i] = x[0]
        x = F @ x + G @ force
    shown = {"displacement": q + rng.normal(0.0, 1e-5, t.size)}
    return ModelData(t, u, shown, None, ("force",), ("displacement",), {"force": "N", "displacement": "m"})


def stage(mass):
    return Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": mass, "c": 9.0, "k": 0.0}})


@pytest.mark.parametrize("nominal", [2.4, 6.0], ids=["of the motor", "of all that moves"])
def test_a_load_shows_whatever_the_nominal_mass_is_of(nominal):
    dataset = dataset_of(stage(nominal), carriage(1), carriage(2))
    load, driven = load_start(dataset.training, dataset.model)
    assert load == {
        "k": pytest.approx(STIFFNESS, rel=0.1),
        "c": pytest.approx(DAMPING, rel=0.5),
        "J": pytest.approx(LOAD, rel=0.1),
    }
    assert driven == pytest.approx(MOTOR, rel=0.1)


def test_a_belt_is_named_where_the_nominal_mass_is_of_all_that_moves():
    """Each fit started from a third of the mass: ADEQUATE was said beside two thirds of the effort."""
    found = diagnose(stage(6.0), carriage(3), carriage(4))
    assert found.verdict == "missing"
    assert found.ladder[-1].effects == ("compliant_load",)
    assert found.parameters["compliant_load.k"].value == pytest.approx(STIFFNESS, rel=0.03)
    assert found.parameters["compliant_load.J"].value == pytest.approx(LOAD, rel=0.03)
    assert found.parameters["m"].value == pytest.approx(MOTOR, rel=0.03)


def test_nothing_swings_in_a_rigid_stage():
    found = diagnose(stage(6.0), carriage(5, coupled=False), carriage(6, coupled=False))
    assert found.verdict == "adequate"


def test_a_current_alone_shows_no_load():
    values = {"R_a": 0.8, "L_a": 0.002, "K_t": 0.06, "K_m": 0.06, "B": 4e-4, "J": 2e-3}
    motor, rng = Model.from_dict({"plant": "dc_motor", "parameters": values}), np.random.default_rng(7)
    t = np.arange(0.0, 4.0, STEP)
    u = np.repeat(rng.uniform(-6.0, 6.0, t.size // 50), 50)[:, None]
    shown = {"current": simulate(motor, t, u).x[:, 0] + rng.normal(0.0, 0.01, t.size)}
    record = ModelData(t, u, shown, None, ("voltage",), ("current", "speed"), {"voltage": "V", "current": "A"})
    dataset = dataset_of(motor, record, record)
    assert load_start(dataset.training, dataset.model) is None
    assert list(seen_loads(dataset.training)) == []
