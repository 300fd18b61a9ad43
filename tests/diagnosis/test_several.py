"""Several plain effects at once: a lift with a weight, a cable that pulls and dry friction."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from signlin_ros.diagnosis import diagnose
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from tests.diagnosis.test_traps import proposed

STEP, FINE = 0.01, 20
TRUE = {"m": 20.0, "c": 300.0}
NOMINAL = Model.from_dict(
    {"plant": "mass_spring_damper", "parameters": {"m": 21.0, "c": 290.0, "k": 0.0}, "tolerance": 0.06}
)
WEIGHT, CABLE, FRICTION = -160.0, 200.0, 130.0


def lift(seed: int, friction: Callable[[float], float] = lambda v: FRICTION, *, duration: float = 12.5) -> ModelData:
    """Return force and height of a lift that moves between heights under a controller, with dry friction by speed.

    Small steps with the friction clipped at standstill.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(round(duration / STEP)) * STEP
    at = np.cumsum(rng.uniform(1.5, 4.0, 40))
    wanted = gaussian_filter1d(rng.uniform(0.02, 0.33, 40)[np.searchsorted(at, t)], 40)
    u, shown = np.empty_like(t), np.empty_like(t)
    q, v, h = wanted[0], 0.0, STEP / FINE
    for k in range(t.size):
        shown[k] = q + rng.normal(0.0, 2e-5)
        u[k] = 9000.0 * (wanted[k] - shown[k]) - 600.0 * v + 150.0
        for _ in range(FINE):
            slips = v + h * (u[k] - TRUE["c"] * v + WEIGHT - CABLE * q) / TRUE["m"]
            v = np.copysign(max(abs(slips) - h * friction(abs(v)) / TRUE["m"], 0.0), slips)
            q += h * v
    return ModelData(t, u[:, None], {"displacement": shown}, None, ("force",), ("displacement",), {})


def test_three_plain_effects_are_not_taken_for_a_rich_one():
    """One after the other, hysteresis came first, and the rest was patched."""
    found = diagnose(NOMINAL, lift(5), lift(6))
    assert found.verdict == "missing"
    assert proposed(found) == {"coulomb_friction", "constant_load", "linear_stiffness"}
    assert found.parameters["coulomb_friction.mu"].value == pytest.approx(FRICTION, rel=0.01)
    assert found.parameters["constant_load.F0"].value == pytest.approx(WEIGHT, rel=0.01)
    assert found.parameters["linear_stiffness.k"].value == pytest.approx(CABLE, rel=0.03)


def test_three_plain_effects_are_not_named_for_an_unlisted_one():
    found = diagnose(NOMINAL, *(lift(seed, lambda v: FRICTION * (1.0 + v**0.5), duration=6.25) for seed in (7, 8)))
    assert found.verdict == "unexplained"
