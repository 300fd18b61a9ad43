"""Effects with lists in the model as given: their elements are fitted like numbers, orders and knots are not."""

import numpy as np
import pytest

from signlin_ros.fitting.candidate import candidate
from signlin_ros.fitting.fit import fit
from signlin_ros.fitting.problem import prepare
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

T = np.arange(3000) * 5e-3
TRUE = {"A": [0.3, 0.15], "values": [-0.5, -0.1, 0.4, 0.9]}


def model(A, values):
    base = Model.from_dict(
        {"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.4, "k": 0.0}, "axis": "rotary"}
    )
    ripple = base.with_effect("torque_ripple", orders=[3.0, 7.0], A=A, phi=[0.3, 1.0])
    return ripple.with_effect("learned_force", over="speed", knots=[-3.0, -1.0, 1.0, 3.0], values=values)


def test_elements_of_known_lists_are_fitted():
    u = 2.0 * np.sign(np.sin(1.3 * T)) + np.sin(3.1 * T)
    x = simulate(model(**TRUE), T, u[:, None]).x
    rng = np.random.default_rng(2)
    measured = {
        "displacement": x[:, 0] + rng.normal(0, 1e-3, T.size),
        "velocity": x[:, 1] + rng.normal(0, 5e-3, T.size),
    }
    units = {"force": "N", "displacement": "m", "velocity": "m/s"}
    data = ModelData(T, u[:, None], measured, None, ("force",), ("displacement", "velocity"), units)
    given = model([0.28, 0.16], [-0.52, -0.095, 0.41, 0.92])
    problem = prepare(given, [data])
    c = candidate(problem, problem.base, ())
    names = {k.name for k in c.coordinates}
    assert {"torque_ripple.A[1]", "torque_ripple.phi[0]", "learned_force.values[3]"} <= names
    assert not any("orders" in name or "knots" in name or "over" in name for name in names)
    fits = [fit(problem, c, problem.observer_gains[-1], None, steps) for steps in (0, 10)]
    assert fits[1].objective < fits[0].objective
    fitted = fits[1].fitted()
    assert fitted.effects["torque_ripple"].parameters["orders[1]"] == 7.0
    assert [fitted.value(f"torque_ripple.A[{i}]") for i in (0, 1)] == pytest.approx(TRUE["A"], rel=0.05)
