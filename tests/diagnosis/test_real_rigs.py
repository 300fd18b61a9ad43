"""What rigs do and simulated records do not: inputs logged now and then, coarse encoders."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from signlin_ros.diagnosis import diagnose
from signlin_ros.diagnosis.comparison import compare
from signlin_ros.effects import find_effect
from signlin_ros.fitting.prepare import prepared
from signlin_ros.fitting.scan import finest
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from tests.diagnosis.test_traps import AXIS, SMALL, proposed, recorded

TICK, EVERY = 1e-3, 5


def test_windows_are_those_of_compare(tmp_path):
    model, known, unseen = recorded(tmp_path, AXIS, {"coulomb_friction": {"mu": 21.0}}, level=1e-3)
    found = diagnose(model, known, unseen)
    shown, told = found.ladder[-1].validation, compare(found.model, unseen[0])
    assert not found.findings.reversed  # no sign is doubted where an effect is missing
    assert shown.to_json()["score"] == "windowed"
    for name, one in shown.channels.items():
        assert one.rmse == pytest.approx(told.channels[name].windowed.rmse, rel=0.15)


def cart(seed: int, load: float) -> ModelData:
    """Return a cart on a rail with a constant load, in closed loop; every fifth tick is logged, and counts of 10 um."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(16.0 / TICK)) * TICK
    tones = 2 * np.pi * rng.uniform(0.15, 1.6, 5)
    wanted = 0.06 * np.sin(t[:, None] * tones + rng.uniform(0, 6, 5)).sum(axis=1)
    shown, effort, q, v, h = np.empty_like(t), np.empty_like(t), 0.0, 0.0, TICK / 10
    for k in range(t.size):
        shown[k] = np.round(q / 1e-5) * 1e-5
        effort[k] = 160.0 * (wanted[k] - shown[k]) - 9.0 * v
        for _ in range(10):
            v += h * (effort[k] - 13.0 * v + load) / 0.94
            q += h * v
    part = slice(None, None, EVERY)
    units = {"displacement": "m", "force": "N"}
    return ModelData(
        t[part], effort[part, None], {"displacement": shown[part]}, None, ("force",), ("displacement",), units
    )


@pytest.mark.long  # inputs that are not held are found in test_input_hold
@pytest.mark.limit("an input delay is named beside the load, where the torque changes between the samples of the log")
def test_an_input_that_changes_between_its_samples_is_no_load_on_a_coupling():
    """A second inertia on a coupling damped five times beyond the critical value took what the held input left."""
    content = {"plant": "mass_spring_damper", "parameters": {"m": 0.99, "c": 12.5, "k": 0.0}}
    found = diagnose(Model.from_dict(content), cart(1, -0.55), cart(2, -0.55))
    assert proposed(found) == {"constant_load"}
    assert found.parameters["constant_load.F0"].value == pytest.approx(-0.55, rel=0.02)


@pytest.mark.parametrize(("damping", "real"), [(0.05, True), (0.7, True), (5.0, False)])
def test_a_load_swings_on_its_coupling(damping, real):
    k, J = 30.0, 0.2
    assert (
        find_effect("compliant_load", "effects").plausible({"k": k, "c": 2 * damping * (k * J) ** 0.5, "J": J}) is real
    )


def test_no_order_is_sought_that_an_encoder_does_not_show(tmp_path):
    model, known, unseen = recorded(tmp_path, SMALL, {}, only=("position",))
    step = np.ptp(known[0].measured["position"]) / 400  # every step is visited
    coarse = [replace(d, measured={"position": np.round(d.measured["position"] / step) * step}) for d in known + unseen]
    problem, _ = prepared(model, coarse[:1], coarse[1:])
    assert 2 * np.pi / finest(problem) == pytest.approx(6 * step, rel=0.01)
    assert finest(prepared(model, known, unseen)[0]) > 10 * finest(problem)
