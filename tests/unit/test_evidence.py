"""Evidence: the right coordinate, a curve that lies on what was measured, and none where the effect is not there."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from signlin_ros.diagnosis.coordinates import Place, share_told
from signlin_ros.diagnosis.onestep import smoothed

from signlin_ros.diagnosis import add
from signlin_ros.diagnosis.evidence import evidence
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulate import simulate

pytestmark = pytest.mark.slow

MASS = Model.from_dict(
    {"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.8, "k": 30.0}, "update_period": 0.1}
)
MOTOR = Model.load("dc_motor").without_effect("coulomb_friction").with_options(with_position=True)


def recorded(model, seed, channels=None, seconds=12, size=3.0):
    """A simulated record with 1 % white noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(200 * seconds) / 200
    u = sum(size * np.sin(2 * np.pi * f * t + rng.uniform(0, 6.28)) for f in rng.uniform(0.1, 2.0, 8))[:, None]
    run = simulate(model, t, u, [0.0] * len(model.states))
    names = channels or [n for n in model.states if "." not in n]
    measured = {n: run[n] + 0.01 * run[n].std() * rng.standard_normal(t.size) for n in names}
    return ModelData(t, u, measured, None, model.inputs, model.states, model.units, source=f"run_{seed}.csv")


def shown(base, effect, channels=None, size=3.0, **parameters):
    true = base.with_effect(effect, **parameters)
    found = add(effect, base, [recorded(true, 1, channels, size=size)], [recorded(true, 2, channels, size=size)])
    return evidence(found.findings, effect)


def off(explanation):
    """By how many of their standard errors measured means miss the curve (RMS)."""
    pairs = zip(explanation.found, explanation.curve, strict=True)
    parts = [(b.mean - c.mean) / (b.two_errors / 2 + 0.01 * np.abs(b.mean).max()) for b, c in pairs]
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


@pytest.mark.parametrize(
    ("base", "effect", "parameters", "quantity", "coordinate"),
    [
        (MASS, "coulomb_friction", {"mu": 0.6}, "missing force [N]", "velocity [m/s]"),
        (MASS, "cubic_stiffness", {"k3": 200.0}, "missing force [N]", "displacement [m]"),
        (MASS, "input_deadzone", {"d": 1.0}, "missing force [N]", "force [N]"),
        (MOTOR, "input_saturation", {"u_max": 4.0}, "missing voltage [V]", "voltage [V]"),
        (MOTOR, "torque_constant_saturation", {"kappa": 0.02}, "missing torque [N·m]", "current [A]"),
        (MOTOR, "gravity_load", {"A": 0.08}, "missing torque [N·m]", "position [rad]"),
    ],
)
def test_over_the_coordinate_of_its_law(base, effect, parameters, quantity, coordinate):
    e = shown(base, effect, **parameters)
    assert f"{e.quantity} [{e.unit}]" == quantity
    assert e.place.label.split(" within")[0].split(" [")[0] == coordinate.split(" [")[0]
    assert e.place.unit == coordinate.split("[")[1][:-1]
    assert off(e.named) < 1.5
    assert e.rival.effect == ""  # nothing else was tried: what is left without it
    assert off(e.rival) > 3.0
    assert e.sources == ("run_2.csv",)


def test_size_of_the_missing_force():
    e = shown(MASS, "coulomb_friction", mu=0.6)
    (means,) = e.named.found
    fast = np.abs(means.at) > 0.2
    force = -means.mean[fast] * np.sign(means.at[fast])
    assert np.mean(np.abs(force - 0.6) < means.two_errors[fast]) > 0.85
    assert_allclose(force.mean(), 0.6, rtol=0.05)


def test_without_a_measured_velocity():
    e = shown(MASS, "coulomb_friction", channels=["displacement"], mu=1.0)
    assert e.place.name == "velocity"
    assert off(e.named) < 2.0


def test_a_hysteretic_spring_is_a_loop_over_position():
    e = shown(MASS, "bouc_wen_hysteresis", alpha=0.4, D=0.08, beta=0.6, gamma=0.35, n=2.0, **{"lambda": 1.0})
    assert e.place.name == "displacement"
    assert len(e.named.found) == 2
    backward, forward = (float(np.interp(0.0, b.at, b.mean)) for b in e.named.found)
    assert backward - forward > 0.1
    assert off(e.named) < 2.0


def test_a_sensor_is_shown_in_the_unit_of_its_channel():
    true, place = MASS.with_effect("sensor_gain", displacement=1.1), "displacement"
    data = [recorded(MASS, k) for k in (1, 2)]
    for d in data:
        d.measured[place] *= 1.1
    found = add("sensor_gain", MASS, data[:1], data[1:])
    e = evidence(found.findings, "sensor_gain")
    assert true.sensors[place].gain == 1.1
    assert (e.quantity, e.unit, e.place.name) == ("displacement shown too much", "m", "displacement")
    (curve,) = e.named.curve
    slope = np.polyfit(curve.at, curve.mean, 1)[0]
    assert_allclose(slope, 0.1, rtol=0.1)


def test_smoothing_keeps_constants_and_missing_samples():
    part = np.full(50, 2.0)
    part[20] = np.nan
    result = smoothed([part, np.full(30, 3.0)], 9)
    assert np.isnan(result[20])
    assert_allclose(np.delete(result, 20), [*[2.0] * 49, *[3.0] * 30])


def test_share_told_by_a_coordinate():
    rng = np.random.default_rng(0)
    x, other = rng.uniform(-1, 1, size=(2, 4000))
    told = Place("x", "-", x, np.zeros(4000), np.ones(4000, dtype=bool))
    assert share_told(told, x**2) > 0.98
    assert share_told(told, other) < 0.05
    side = Place("x", "-", x, np.sign(other), np.ones(4000, dtype=bool))
    assert share_told(side, x * np.sign(other)) > 0.98 > 0.1 > share_told(told, x * np.sign(other))
