"""Springs of shapes that no listed effect has: neither hysteresis, nor a few listed curves together, nor noise."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.hidden.drives import MASS, Drive
from signlin_ros.diagnosis import diagnose
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from tests.diagnosis.test_traps import proposed, recorded, status

SLIDE = Drive(MASS, {"m": 1.0, "c": 0.8, "k": 16.0}, 10.0, 4.0)
SATURATING = {"saturating_spring": {"F": 6.0, "q": 0.5}}
DETENT = {"detent": {"F": 6.0, "q": 0.5}}


def test_a_spring_that_saturates_is_no_hysteresis(tmp_path):
    """A loop without width has its shape: tanh for a power of two."""
    found = diagnose(*recorded(tmp_path, SLIDE, SATURATING, exc=("prbs", "sweep"), level=0.02, seed=2))
    assert "bouc_wen_hysteresis" not in proposed(found)
    assert status(found, "bouc_wen_hysteresis") == "rejected"
    assert found.verdict == "unexplained"


def test_curves_that_together_make_another_are_not_named(tmp_path):
    found = diagnose(*recorded(tmp_path, SLIDE, SATURATING, exc=("slow", "multisine"), level=0.005, seed=1))
    assert found.verdict == "unexplained"


@pytest.mark.long
def test_what_shows_on_larger_motion_only_is_not_noise_in_the_input(tmp_path):
    """The detent is left in the validation record alone: fifty times the noise is not adequate."""
    records = recorded(tmp_path, SLIDE, DETENT, exc=("multisine", "steps"), level=0.02, seed=1, seconds=16.0)
    assert diagnose(*records).verdict == "unexplained"


def pushed(seed: int, bend: float, noise_in_force: float) -> ModelData:
    """Return a slide whose spring stiffens on one side, pushed slowly by a force that is recorded without its noise."""
    rng, dt, fine = np.random.default_rng(seed), 5e-3, 10
    t = np.arange(3000) * dt
    fading = np.exp(-np.arange(0, 2, dt) / 0.35)
    u = np.convolve(rng.normal(size=t.size), fading, "same")
    u *= 8.0 / u.std()
    acting, q, state, v = u + rng.normal(size=t.size) * noise_in_force, np.empty_like(t), 0.0, 0.0
    for k, force in enumerate(acting):
        q[k] = state
        for _ in range(fine):
            v += (force - 0.8 * v - 16.0 * state - bend * (np.exp(state) - 1.0 - state)) * dt / fine
            state += v * dt / fine
    shown = {"displacement": q + rng.normal(size=t.size) * 0.03 * q.std()}
    units = {"displacement": "m", "force": "N"}
    return ModelData(t, u[:, None], shown, None, ("force",), ("displacement", "velocity"), units)


@pytest.mark.long
@pytest.mark.parametrize(
    ("bend", "noise_in_force", "verdict"),
    [
        (6.4, 0.0, "missing"),
        pytest.param(
            0.0,
            8.0,
            "adequate",
            marks=pytest.mark.limit("unexplained, though all that is left is noise of the force"),
        ),
    ],
)
def test_noise_in_the_force_does_not_go_with_the_position(bend, noise_in_force, verdict):
    """At the gain that follows both, little is left of either: one function of the motion tells them apart."""
    model = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.8, "k": 16.0}})
    found = diagnose(model, pushed(1, bend, noise_in_force), pushed(2, bend, noise_in_force))
    assert found.verdict == verdict
    assert proposed(found) == ({"asymmetric_stiffness"} if bend else set())


def circuit(seed: int, growing: bool) -> ModelData:
    """Return an oscillator like the Silverbox circuit: a cubic spring and a quadratic term of a hundredth of its force,
    driven by a multisine that is held between samples, nine of them in a period of its resonance.
    """
    rng, dt, fine = np.random.default_rng(seed), 1.0 / 610.35, 30
    t, lines = np.arange(4000) * dt, np.linspace(2.0, 200.0, 60)
    u = np.cos(2 * np.pi * np.outer(t, lines) + rng.uniform(0, 2 * np.pi, lines.size)).sum(axis=1)
    u *= 0.05 / u.std() * (0.2 + t / t[-1] if growing else 1.0)
    q, state, v, h = np.empty_like(t), 0.0, 0.0, dt / fine
    for k, force in enumerate(u.tolist()):
        q[k] = state
        for _ in range(fine):
            v += (force - 1.25e-4 * v - state - 3.93 * state**3 + 0.06 * state**2) * h / 5.43e-6
            state += v * h
    shown = {"displacement": q + rng.normal(size=t.size) * 4e-4}
    units = {"displacement": "m", "force": "N"}
    return ModelData(t, u[:, None], shown, None, ("force",), ("displacement", "velocity"), units)


@pytest.mark.limit("unexplained: a hundredth of the force is of another shape; 21 s")
def test_a_cubic_spring_with_a_little_of_something_else_is_cubic():
    """A loop without width explained more where it was fitted, and less on larger motion."""
    base = {"m": 5.18e-6, "c": 1.32e-4, "k": 1.08}
    model = Model.from_dict({"plant": "mass_spring_damper", "parameters": base, "tolerance": 0.08})
    found = diagnose(model, circuit(2, False), circuit(12, True))
    assert found.verdict == "missing"
    assert proposed(found) == {"cubic_stiffness"}
    assert found.parameters["cubic_stiffness.k3"].value == pytest.approx(3.93, rel=0.02)
