"""What follows from the motion is no noise, however white it looks: under a noisy force a square looks like noise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from signlin_ros.diagnosis import diagnose
from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
from signlin_ros.diagnosis.output_error import FitCache, estimator_of
from signlin_ros.fitting.prepare import held_out, prepared
from signlin_ros.model import Model
from signlin_ros.records import ModelData

BARE = Model.load("mass_spring_damper").without_effect("coulomb_friction")
RINGING = BARE.with_parameters({"m": 0.0455, "c": 1.73, "k": 9700.0})
DT, SAMPLES, NOISE = 1 / 600.0, 5000, 2.5e-6
"""A resonance at 73 Hz, eight samples in each of its periods."""


def shaken(spring: Callable[[float], float], seed: int, drag: Callable[[float], float] = lambda q: 0.0) -> ModelData:
    """Return a record of an oscillator under a noisy force with one more spring (N over m), and a viscosity (N s/m)
    over the position: fixed steps of RK4.
    """
    rng = np.random.default_rng(seed)
    u = 1.4 * lfilter(*butter(2, 200.0 * 2 * DT), rng.normal(size=SAMPLES)) * np.linspace(0.3, 1.0, SAMPLES)
    p, h, steps = RINGING.parameters, DT / 6, 6

    def rates(q: float, v: float, force: float) -> tuple[float, float]:
        return v, (force - (p["c"] + drag(q)) * v - p["k"] * q + spring(q)) / p["m"]

    q, v, found = 0.0, 0.0, np.zeros(SAMPLES)
    for i in range(SAMPLES):
        found[i] = q
        for _ in range(steps):
            a = rates(q, v, u[i])
            b = rates(q + h / 2 * a[0], v + h / 2 * a[1], u[i])
            c = rates(q + h / 2 * b[0], v + h / 2 * b[1], u[i])
            d = rates(q + h * c[0], v + h * c[1], u[i])
            q += h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
            v += h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
    measured = {"displacement": found + NOISE * rng.normal(size=SAMPLES)}
    units = {"force": "N", "displacement": "m"}
    return ModelData(np.arange(SAMPLES) * DT, u[:, None], measured, None, RINGING.inputs, RINGING.states, units)


def share(record: ModelData) -> float:
    """Return the share of what the fitted model leaves that follows from its own motion."""
    model = RINGING.with_parameters({"m": 0.0442, "c": 1.76, "k": 9500.0})
    found = estimator_of(*prepared(model, *held_out([record])), DEFAULT_CRITERIA, FitCache(), jobs=1)
    return found.base.residual_tests[0].dependent


def test_a_right_model_leaves_what_nothing_predicts():
    assert share(shaken(lambda q: 0.0, 1)) < DEFAULT_CRITERIA.max_dependent_share / 2


def test_a_square_is_seen_in_what_looks_white():
    assert share(shaken(lambda q: -2.7e5 * q * q, 2)) > 10 * DEFAULT_CRITERIA.max_dependent_share


def test_a_viscosity_that_repeats_over_the_position_is_seen():
    """It was called viscous friction: what was left of it looked white, since the wave is quicker than any power of the
    position.
    """
    record = shaken(lambda q: 0.0, 7)
    order = 12 * np.pi / float(np.ptp(record.measured["displacement"]))
    assert share(record) < DEFAULT_CRITERIA.max_dependent_share / 2
    patterned = shaken(lambda q: 0.0, 7, lambda q: 0.9 * RINGING.parameters["c"] * np.sin(order * q + 1.0))
    assert share(patterned) > 2 * DEFAULT_CRITERIA.max_dependent_share


def test_a_spring_that_is_stiffer_one_way_is_named():
    nominal = RINGING.with_parameters({"m": 0.0442, "c": 1.76, "k": 9300.0})
    nominal = nominal.with_options(tolerance=0.1)
    found = diagnose(nominal, shaken(lambda q: -2.7e5 * q * q, 3), shaken(lambda q: -2.7e5 * q * q, 4))
    assert found.verdict == "missing"
    assert found.ladder[-1].effects == ("asymmetric_stiffness",)
    assert found.parameters["asymmetric_stiffness.k2"].value == pytest.approx(2.7e5, rel=0.03)


def test_a_spring_in_the_catalogue_is_named_all_the_same():
    found = diagnose(RINGING, shaken(lambda q: -3e8 * q**3, 5), shaken(lambda q: -3e8 * q**3, 6))
    assert found.verdict == "missing"
    assert found.ladder[-1].effects == ("cubic_stiffness",)
    assert found.parameters["cubic_stiffness.k3"].value == pytest.approx(3e8, rel=0.03)


@pytest.mark.long  # a friction of this shape on a lift: test_several
def test_a_friction_that_no_effect_describes_is_not_explained():
    element = Model.load("force_element")
    for name in list(element.effects):
        element = element.without_effect(name)
    element = element.with_parameters({"c": 560.0, "k": 7100.0})

    def sheared(seed: int) -> ModelData:
        rng, t = np.random.default_rng(seed), np.arange(1500) / 250.0
        w = 2 * np.pi * np.array([0.4, 1.1, 2.3, 4.7])
        size, phase = np.array([6.0, 4.0, 3.0, 2.0]) * 1e-3, rng.uniform(0, 6.3, 4)
        q = (size * np.sin(w * t[:, None] + phase)).sum(axis=1)
        v = (size * w * np.cos(w * t[:, None] + phase)).sum(axis=1)
        force = 560.0 * v + 7100.0 * q + 120.0 * np.sqrt(np.abs(v)) * np.sign(v) + 4.0 * rng.normal(size=t.size)
        units = {"force": "N", "displacement": "m", "velocity": "m/s"}
        return ModelData(
            t, v[:, None], {"force": force, "displacement": q}, None, element.inputs, element.outputs, units
        )

    found = diagnose(element, sheared(1), sheared(2))
    assert found.verdict == "unexplained"
