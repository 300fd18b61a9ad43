"""Models of which no base parameter may move are fitted like any other: there is nothing to fit, and nothing fails."""

import numpy as np
import pytest

from signlin_ros.fitting.candidate import candidate
from signlin_ros.fitting.fit import fit
from signlin_ros.fitting.problem import prepare
from signlin_ros.model import Model
from signlin_ros.records import ModelData

T = np.arange(2000) * 5e-3
V = 0.1 * np.sin(2.0 * T) + 0.05 * np.sin(5.3 * T)
Q = np.concatenate([[0.0], np.cumsum(V[:-1]) * 5e-3])
UNITS = {"displacement": "m", "force": "N", "velocity": "m/s"}


def element(c):
    force = 50.0 * V + np.random.default_rng(1).normal(0.0, 0.5, T.size)
    data = ModelData(T, V[:, None], {"displacement": Q, "force": force}, None, ("velocity",), ("displacement",), UNITS)
    options = {"frozen": ["c", "k"]} if c else {}
    return Model.from_dict({"plant": "force_element", "parameters": {"c": c, "k": 0.0}, **options}), data


def drive():
    model = Model.from_dict(
        {"plant": "mass_spring_damper", "parameters": {"m": 2.0, "c": 1.0, "k": 0.0}, "frozen": ["m", "c", "k"]}
    )
    force = 2.0 * np.gradient(V, T) + V
    states = ("displacement", "velocity")
    return model, ModelData(T, force[:, None], {"displacement": Q, "velocity": V}, None, ("force",), states, UNITS)


@pytest.mark.parametrize("case", [lambda: element(0.0), lambda: element(50.0), drive], ids=["zeros", "frozen", "drive"])
def test_a_model_without_free_parameters_is_fitted(case):
    model, data = case()
    problem = prepare(model, [data])
    c = candidate(problem, problem.base, ())
    assert c.coordinates == ()
    for gains in problem.observer_gains:
        found = fit(problem, c, gains)
        assert found is not None
        assert np.isfinite(found.objective)
        assert found.theta.size == 0
        assert found.hessian.shape == (0, 0)
        pairs = zip(found.innovations, problem.segments, strict=True)
        assert all(np.array_equal(np.isnan(e), np.isnan(s.y)) for e, s in pairs)
    if model.parameters.get("c") == 50.0:
        assert np.nanstd(found.innovations[0][:, problem.channels.index("force")]) == pytest.approx(0.5, rel=0.1)
