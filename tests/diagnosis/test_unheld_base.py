"""A nominal value that is far off hides the effect that is missing: it is told, and what would explain the record."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.diagnosis import diagnose
from signlin_ros.model import Model
from signlin_ros.records import ModelData

ELASTIC, POST_YIELD, YIELD = 8e6, 0.06, 7.5e-3
"""Stiffness in N/m, its share after yielding, and the displacement in m at which it yields."""


def pulled(cycles: int, seed: int = 5) -> ModelData:
    """Return a quasi-static cyclic test of a steel damper, some cycles of each amplitude, integrated by small steps.

    Its stiffness degrades by what it dissipates.
    """
    rng, step, period = np.random.default_rng(seed), 0.1, 20.0
    turns = np.arange(round(cycles * period / step)) * step / period
    q = np.concatenate([a * np.sin(2 * np.pi * turns) for a in (5e-3, 0.01, 0.015, 0.02, 0.03, 0.04)])
    force, z, energy = np.zeros(q.size), 0.0, 0.0
    for k in range(1, q.size):
        count = max(1, int(abs(q[k] - q[k - 1]) / 5e-5))
        d = (q[k] - q[k - 1]) / count
        for _ in range(count):
            held = 0.5 * (1.0 + np.sign(d * z)) * abs(z / YIELD) ** 2
            z += d * (1.0 - held * (1.0 + 2e-5 * energy)) / (1.0 + 1e-5 * energy)
            energy += (1.0 - POST_YIELD) * ELASTIC * z * d
        force[k] = POST_YIELD * ELASTIC * q[k] + (1.0 - POST_YIELD) * ELASTIC * z
    t, shown = np.arange(q.size) * step, q + rng.normal(0.0, 2e-5, q.size)
    measured = {"displacement": shown, "force": force + rng.normal(0.0, 500.0, q.size)}
    units = {"displacement": "m", "force": "N", "velocity": "m/s"}
    return ModelData(t, np.gradient(q, step)[:, None], measured, None, ("velocity",), ("displacement",), units)


@pytest.mark.parametrize("cycles", [2, pytest.param(3, marks=pytest.mark.long)])
def test_a_secant_stiffness_does_not_hide_that_a_damper_yields(cycles):
    """The force alone tells a stiffness near the secant's, and beside that no loop explains anything."""
    base = {"plant": "force_element", "parameters": {"c": 0.0, "k": 3e6}, "update_period": 1.0}
    found = diagnose(Model.from_dict(base), pulled(cycles))
    assert found.verdict == "unexplained"
    assert found.ladder[-1].effects[0] == "bouc_wen_hysteresis"
    assert found.sentence.startswith("Check this first: k ends")
    assert "Bouc-Wen hysteresis" in found.sentence
