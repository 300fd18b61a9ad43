"""Causal estimates: exact on polynomials, blind to the future, and the noise that the docstring states."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.errors import InputError
from signlin_ros.estimate import CausalDerivative, StateEstimator
from signlin_ros.model import Model
from signlin_ros.simulation import simulate


def test_a_parabola_is_differentiated_exactly_even_if_sampled_unevenly() -> None:
    t = np.cumsum(np.random.default_rng(0).uniform(0.5e-3, 2e-3, 200))
    v = CausalDerivative(0.01).all(t, 3 * t**2 - t + 2)
    assert v[10:] == pytest.approx(6 * t[10:] - 1, rel=1e-9)


def test_a_line_lags_half_its_window() -> None:
    t = np.arange(0, 1, 1e-3)
    derivative = CausalDerivative(0.02, degree=1)
    v = derivative.all(t, t**2)
    assert (2 * t - v)[-1] / 2 == pytest.approx(derivative.delay, rel=0.05)


def test_the_noise_is_what_the_docstring_says() -> None:
    rng, t = np.random.default_rng(1), np.arange(0, 4, 1e-3)
    v = CausalDerivative(0.0205).all(t, rng.normal(size=t.size))
    assert v[100:].std() == pytest.approx(14 / (1e-3 * 21**1.5), rel=0.15)


def test_the_future_does_not_matter() -> None:
    t, rng = np.arange(0, 1, 1e-2), np.random.default_rng(2)
    values = rng.normal(size=t.size)
    early = CausalDerivative(0.05).all(t[:50], values[:50])
    assert np.array_equal(early, CausalDerivative(0.05).all(t, values)[:50])


def test_time_must_increase() -> None:
    derivative = CausalDerivative()
    derivative.update(1.0, 0.0)
    with pytest.raises(InputError, match="time"):
        derivative.update(1.0, 0.0)


def test_states_that_nobody_measures_are_carried_by_the_model() -> None:
    """Presliding and velocity come from the position alone, close to the simulated truth."""
    model = Model.from_dict(
        {
            "plant": "mass_spring_damper",
            "parameters": {"m": 1.0, "c": 0.6, "k": 40.0},
            "effects": {"dahl_presliding": {"F_c": 1.0, "sigma": 50.0}},
        }
    )
    t = np.arange(0, 8, 0.002)
    u = 4.0 * np.sin(2.0 * t)[:, None]
    truth = simulate(model, t, u, [0.02, 0.1, 0.0])
    estimator = StateEstimator(model, ["position"], rate=500.0)
    x = np.array([estimator.update(t[k], {"displacement": truth["displacement"][k]}, u[k]) for k in range(t.size)])
    assert estimator.carried == ("dahl_presliding.z",)
    late = slice(1000, None)
    for name, part in (("velocity", 0.01), ("dahl_presliding.z", 0.05)):
        column = model.states.index(name)
        assert np.std(x[late, column] - truth[name][late]) < part * np.std(truth[name][late])
