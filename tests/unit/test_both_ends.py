"""Encoders at both ends: a state of an effect that is measured is fitted, as the plant's own states are."""

import numpy as np

from signlin_ros.fitting.gains import linear_base
from signlin_ros.fitting.problem import prepare
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

STEP, COUNT = 0.004, 2 * np.pi / 65536
LOAD = "compliant_load.position"


def test_a_load_that_is_measured_is_fitted() -> None:
    drive = {"plant": "mass_spring_damper", "axis": "rotary", "parameters": {"m": 0.001, "c": 0.002, "k": 0.0}}
    effects = {"compliant_load": {"k": 9.0, "c": 0.004, "J": 0.002}}
    model = Model.from_dict({**drive, "effects": effects, "signals": {"force": "M", "displacement": "q", LOAD: "q2"}})
    t = np.arange(1000) * STEP
    u = 0.1 * np.sin(3.0 * t) + 0.05 * np.sin(17.0 * t)
    x = simulate(model, t, u[:, None]).x
    measured = {name: np.round(x[:, model.states.index(name)] / COUNT) * COUNT for name in ("displacement", LOAD)}
    data = ModelData(t, u[:, None], measured, None, model.inputs, model.states, dict(model.units))
    problem = prepare(model, [data])
    assert problem.channels == ("displacement", LOAD)
    _, _, C = linear_base(model, problem.channels)
    np.testing.assert_array_equal(C[0], C[1])  # the bare plant has one position
    assert all(np.isfinite(observer.values).all() for observer in problem.force_observers)
