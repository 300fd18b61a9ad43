"""A motor whose current is over within a sample, as drives are logged: it is compared and diagnosed all the same."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_lyapunov

from signlin_ros.diagnosis import diagnose
from signlin_ros.diagnosis.comparison import compare
from signlin_ros.follow.tracking import discrete
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

DT, FRICTION = 0.01, 0.02


def record(model: Model, seed: int) -> ModelData:
    rng, times = np.random.default_rng(seed), np.arange(1500) * DT
    frequency, height, phase = rng.uniform((0.1, 0.5, 0.0), (3.0, 3.0, 6.0), (6, 3)).T
    u = (height * np.sin(2 * np.pi * frequency * times[:, None] + phase)).sum(axis=1)[:, None]
    x = simulate(model.with_effect("coulomb_friction", mu=FRICTION), times, u).x
    x = x + rng.normal(size=x.shape) * (0.02, 0.1)
    measured, units = {"current": x[:, 0], "speed": x[:, 1]}, {"voltage": "V", "current": "A", "speed": "rad/s"}
    return ModelData(times, u, measured, None, model.inputs, model.states, units)


@pytest.fixture(scope="module", params=[1e-4, pytest.param(1e-5, marks=pytest.mark.long)])
def motor(request) -> Model:
    model = Model.load("dc_motor").without_effect("coulomb_friction").with_parameters({"L_a": request.param})
    assert model.parameters["R_a"] / request.param * DT > 50.0
    return model


def test_what_is_missing_is_seen(motor):
    found = compare(motor, record(motor, 1)).to_json()
    forward, backward = (found["missing"]["torque"][side]["mean"] for side in ("forward", "backward"))
    assert (forward, backward) == pytest.approx((-FRICTION, FRICTION), rel=0.1)
    assert found["channels"]["current"]["noise"] == pytest.approx(0.02, rel=0.1)


def test_the_effect_is_named(motor):
    found = diagnose(motor, record(motor, 1), record(motor, 2))
    assert found.verdict == "missing"
    assert found.ladder[-1].effects == ("coulomb_friction",)
    assert found.ladder[-1].validation.over_noise < 1.05
    assert found.parameters["coulomb_friction.mu"].value == pytest.approx(FRICTION, rel=0.08)


@pytest.mark.parametrize("fast", [1.0, 30.0, 1e4])
def test_transition_and_noise_of_what_decays_fast(fast):
    A, intensity = np.array([[-fast, 0.5], [0.3, -0.2]]), np.array([2.0, 3.0])
    transition, noise, mean = discrete(A, intensity, 1.0)
    flow = expm(A)
    settled = solve_continuous_lyapunov(A, -np.diag(intensity))
    assert np.allclose(transition, flow, rtol=1e-9, atol=1e-12)
    assert np.allclose(noise, settled - flow @ settled @ flow.T, rtol=1e-9)
    assert np.allclose(mean, np.linalg.solve(A, flow - np.eye(2)), rtol=1e-9)
