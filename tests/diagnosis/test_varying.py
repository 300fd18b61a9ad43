"""Friction that varies along the way has no name in the list; constant friction and plain waves have."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.diagnosis import Diagnosis, diagnose
from signlin_ros.model import Model
from signlin_ros.records import ModelData

M, C, FORCE, STEP, FINE, COUNT = 2.0, 3.0, 12.0, 0.005, 10, 2400
WAVE = 0.25
"""Length of a wave, m."""
STAGE = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": M, "c": C, "k": 0.0}})


def slid(seed: int, viscous: float = 0.0, wave: float = 0.0, dry: float = 0.0, plain: float = 0.0) -> ModelData:
    """Return a record of a stage with ``viscous`` friction and a ``wave`` of it along the way, in N·s/m, with ``dry``
    friction of which all varies, and with a ``plain`` wave of force, in N; integrated with tiny steps.
    """
    rng, dt = np.random.default_rng(seed), STEP / FINE
    t = STEP * np.arange(COUNT)
    tones = 2 * np.pi * rng.uniform(0.1, 1.2, 6)
    u = FORCE / 3 * np.sin(tones * t[:, None] + rng.uniform(0, 6, 6)).sum(axis=1)
    shown, q, v = np.zeros((COUNT, 2)), 0.0, 0.0
    for k in range(COUNT):
        shown[k] = q, v
        for _ in range(FINE):
            phase = 2 * np.pi * q / WAVE + 1.0
            along = np.sin(phase)
            friction = (C + viscous + wave * along) * v + dry * (1.0 + along) * np.tanh(v / 2e-3)
            v += dt * (u[k] - friction - plain * np.sin(phase + 0.5)) / M
            q += dt * v
    shown += 0.01 * shown.std(axis=0) * rng.normal(size=shown.shape)
    measured, units = {"displacement": shown[:, 0], "velocity": shown[:, 1]}, {"displacement": "m", "force": "N"}
    return ModelData(t, u[:, None], measured, None, ("force",), ("displacement", "velocity"), units)


def told(**what: float) -> Diagnosis:
    return diagnose(STAGE, slid(1, **what), slid(2, **what))


def test_waves_of_viscous_friction_are_no_listed_effect():
    d = told(viscous=2.0, wave=2.0)
    assert d.verdict == "unexplained"


@pytest.mark.parametrize("what", [{"viscous": 2.0}, {"plain": 2.0}])
def test_what_does_not_vary_with_the_position_is_named(what):
    d = told(**what)
    assert d.verdict == "missing"
    assert d.ladder[-1].effects == ({"viscous": "viscous_friction", "plain": "cogging_torque"}[next(iter(what))],)
