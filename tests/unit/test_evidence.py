"""Evidence: the right coordinate, a curve that lies on what was measured, and none where the effect is not there."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from signlin_ros.comparison.waves import Wave
from signlin_ros.diagnosis import add
from signlin_ros.diagnosis.effect_evidence import _place, _unexplained
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.report.diagnosis_pictures import evidence_picture
from signlin_ros.simulation import simulate

pytestmark = pytest.mark.slow

MASS = Model.from_dict(
    {"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.8, "k": 30.0}, "update_period": 0.1}
)


def recorded(model, seed, channels=None, seconds=12, size=3.0):
    """A simulated record with 1 % white noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(200 * seconds) / 200
    u = sum(size * np.sin(2 * np.pi * f * t + rng.uniform(0, 6.28)) for f in rng.uniform(0.1, 2.0, 8))[:, None]
    run = simulate(model, t, u, [0.0] * len(model.states))
    names = channels or [n for n in model.states if "." not in n]
    measured = {n: run[n] + 0.01 * run[n].std() * rng.standard_normal(t.size) for n in names}
    return ModelData(t, u, measured, None, model.inputs, model.states, model.units, source=f"run_{seed}.csv")


def shown(effect, channels=None, seconds=12, size=3.0, **parameters):
    true = MASS.with_effect(effect, **parameters)
    found = add(effect, MASS, *([recorded(true, k, channels, seconds, size)] for k in (1, 2)), jobs=1)
    return found.findings.effects.get(effect)


def off(explanation):
    """By how many of their standard errors measured means miss the curve (RMS)."""
    pairs = zip(explanation.found, explanation.curve, strict=True)
    parts = [(b.mean - c.mean) / (b.two_errors / 2 + 0.01 * np.abs(b.mean).max()) for b, c in pairs]
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


@pytest.mark.parametrize(
    ("effect", "parameters", "coordinate"),
    [
        ("coulomb_friction", {"mu": 0.6}, "velocity [m/s]"),
        ("cubic_stiffness", {"k3": 200.0}, "displacement [m]"),
    ],
)
def test_over_the_coordinate_of_its_law(effect, parameters, coordinate):
    e = shown(effect, **parameters)
    assert (e.quantity, e.unit, e.place.label) == ("missing force", "N", coordinate)
    assert off(e.named) < 2.0
    assert e.rival is not None  # by the force: no other was simulated
    assert e.rival.effect != effect
    assert np.std(e.rival.measured - e.rival.computed) >= 0.99 * np.std(e.named.measured - e.named.computed)
    assert e.sources == ("run_2.csv",)
    assert e.named.effect == effect
    assert set(e.named.parameters) == set(parameters)
    if effect == "coulomb_friction":
        sizes = np.concatenate([-b.mean[np.abs(b.at) > 0.2] * np.sign(b.at[np.abs(b.at) > 0.2]) for b in e.named.found])
        assert_allclose(sizes.mean(), 0.6, rtol=0.05)
    assert len(evidence_picture(e).axes) >= 2


def test_what_changes_the_input_is_shown_by_no_force():
    assert shown("input_deadzone", d=1.0) is None


def test_the_share_that_no_curve_over_a_coordinate_tells():
    rng = np.random.default_rng(0)
    x, other = rng.uniform(-1, 1, size=(2, 4000))
    assert _unexplained(x, np.ones(4000), x**2) < 0.02
    assert _unexplained(other, np.ones(4000), x) > 0.95
    assert (
        _unexplained(x, np.sign(other), x * np.sign(other))
        < 0.02
        < 0.9
        < _unexplained(x, np.ones(4000), x * np.sign(other))
    )


@pytest.mark.parametrize(("order", "folds"), [(5e-324, False), (6.0, False), (70.0, True)])
def test_only_a_wave_of_which_the_records_hold_a_period_folds_the_position(order, folds):
    """A wave that a fit made a constant, of order 5e-324: its period is infinite, and so was every place in it."""
    q = 0.1 * np.sin(np.arange(4000) * 0.01)
    values = {"displacement": q, "velocity": np.gradient(q, 0.01)}
    piece = SimpleNamespace(values=values, kept=np.ones(q.size, dtype=bool), cutoff=20.0, t=np.arange(q.size) * 0.01)
    training = SimpleNamespace(shown=lambda unit: unit, units={"displacement": "m"})
    force = SimpleNamespace(validation=SimpleNamespace(pieces=(piece,)))
    evidence = SimpleNamespace(dataset=SimpleNamespace(plant=MASS.plant, training=training))
    found = _place(evidence, force, 3.0 * q, [Wave(order, 1.0)])
    assert np.isfinite(found.x).all()
    assert (found.name == "displacement within a period") is folds
    assert found.x.max() - found.x.min() <= min(np.ptp(q), 2 * np.pi / order)
