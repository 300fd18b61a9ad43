"""Values of least absolute errors, for a servo that errs rarely and by much."""

from __future__ import annotations

import re

import numpy as np
import pytest

from signlin_ros.diagnosis.least_absolute import by_absolute_error
from signlin_ros.diagnosis.proposal import printed
from signlin_ros.diagnosis.verbs import add
from signlin_ros.fitting.absolute import heavy_tailed, least_absolute
from signlin_ros.fitting.candidate import candidate
from signlin_ros.fitting.following import follow_records
from signlin_ros.fitting.prepare import prepared
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

T = 0.005 * np.arange(800)


def servo(**parameters):
    effects = {"viscous_friction": {"b": 0.006}, "coulomb_friction": {"mu": 0.02}}
    values = {"K_t": 0.35, "R": 3.3, "J": 0.002, "mass": 0.5, "length": 0.1, "duty_per_error": 0.00288, "vin": 7.4}
    known = {"frozen": [*values], "tolerance": 1.0, "update_period": 0.05}
    return Model.from_dict(
        {"plant": "servo", "parameters": {**values, "kp": 300.0, **parameters}, "effects": effects} | known
    )


def record(kp, seed, wrong=0.0):
    """A record of whose positions a tenth is wrong, and all by the same."""
    rng = np.random.default_rng(seed)
    goal = np.repeat(rng.uniform(-1.0, 1.0, 40), 20)
    model = servo(kp=kp)
    q = simulate(model, T, goal[:, None], [0.0, 0.0])["position"]
    q = q + 1e-3 * rng.laplace(size=T.size) + wrong * (rng.uniform(size=T.size) < 0.1)
    names = model.inputs, model.states
    return ModelData(T, goal[:, None], {"position": q}, None, *names, model.units, f"{kp:g}", conditions={"kp": kp})


@pytest.mark.parametrize(("draw", "expected"), [("laplace", True), ("normal", False), ("uniform", False)])
def test_the_likelihood_tells_errors_that_are_few_and_large(draw, expected):
    rng = np.random.default_rng(3)
    assert heavy_tailed([getattr(rng, draw)(size=(500, 2)) for _ in range(3)]) is expected


def test_a_tenth_of_wrong_samples_bends_least_squares_and_not_least_absolute_errors():
    data = [record(200.0, 1, 0.3), record(400.0, 2, 0.3)]
    problem, _ = prepared(servo(), data, data)
    c = candidate(problem, problem.base, (), {})
    truth = {"coulomb_friction.mu": 0.02, "viscous_friction.b": 0.006}
    theta = least_absolute(problem, c, c.start({"coulomb_friction.mu": 0.03, "viscous_friction.b": 0.004}))
    found = c.named(theta)
    assert {n: found[n] for n in truth} == pytest.approx(truth, rel=0.1)
    errors = follow_records(problem, c, theta, problem.observer_gains[-1], False)[0]
    assert heavy_tailed(errors)


@pytest.mark.slow
def test_the_file_of_a_servo_has_these_values_and_a_note_tells_of_both_fits():
    model, data = servo().without_effect("coulomb_friction"), [record(200.0, 1, 0.3), record(400.0, 2, 0.3)]
    found = add("coulomb_friction", model, data)
    new = by_absolute_error(found, model, data)
    squares, absolute = (one.model.effects["coulomb_friction"].parameters["mu"] for one in (found, new))
    assert abs(absolute - 0.02) < min(0.002, abs(squares - 0.02))
    assert new.parameters == found.parameters
    text = printed(new, model, None, data).yaml
    assert f"mu: {absolute:.6g}" in text
    shown = re.search(r"coulomb_friction.mu: fitted, ([0-9.]+) ±", text)
    assert shown
    assert float(shown[1]) == pytest.approx(absolute, rel=1e-2)
    (note,) = set(new.notes) - set(found.notes)
    assert "free runs err rarely" in note
    assert by_absolute_error(found, Model.load("dc_motor"), data) is found
