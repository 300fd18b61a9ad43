"""The velocity behind a displacement: much less noisy than differences, and never far from them."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.records.slope import slope

T = np.arange(6000) * 1e-3
TONES, PHASES = 2 * np.pi * np.array([0.4, 1.7, 3.1]), np.array([0.0, 1.0, 2.5])
Q = 0.01 * np.sin(TONES * T[:, None] + PHASES).sum(axis=1)
V = 0.01 * (TONES * np.cos(TONES * T[:, None] + PHASES)).sum(axis=1)


def error(rate: np.ndarray, true: np.ndarray = V) -> float:
    """Relative error without the ends."""
    return float(np.nanstd((rate - true)[20:-20]) / np.std(true))


@pytest.mark.parametrize(
    ("shown", "better"),
    [
        (Q, 100),
        (Q + np.random.default_rng(1).normal(0.0, 1e-5, T.size), 10),
        (np.round(Q / 5e-5) * 5e-5, 5),
        (np.round(Q / 1e-3) * 1e-3, 20),
    ],
    ids=["clean", "noise", "resolution", "coarse"],
)
def test_it_is_better_than_differences(shown, better):
    rate, _ = slope(T, shown)
    assert error(rate) < error(np.gradient(shown, T)) / better


def test_the_noise_is_told():
    sigma = 1e-5
    assert slope(T, Q + np.random.default_rng(2).normal(0.0, sigma, T.size))[1] == pytest.approx(sigma, rel=0.05)
    assert slope(T, np.round(Q / 5e-5) * 5e-5)[1] == pytest.approx(5e-5 / np.sqrt(12), rel=0.1)


def test_slow_motion_shown_in_coarse_steps():
    q = 0.1 * np.sin(0.5 * T)
    rate, _ = slope(T, np.round(q / 2e-5) * 2e-5)
    assert error(rate, 0.05 * np.cos(0.5 * T)) < 0.01


def test_missing_and_uneven_samples():
    rng = np.random.default_rng(3)
    t = np.sort(rng.uniform(0.0, 6.0, 6000))
    q, v = np.sin(3.0 * t) + rng.normal(0.0, 1e-3, t.size), 3.0 * np.cos(3.0 * t)
    q[100:110] = np.nan
    rate, _ = slope(t, q)
    assert np.isnan(rate[100:110]).all()
    assert np.isfinite(np.delete(rate, np.arange(100, 110))).all()
    assert error(rate, v) < 0.02


@pytest.mark.parametrize("values", [np.zeros(50), np.arange(50) * 0.1, np.array([0.0, 1.0, 4.0]), np.array([2.0])])
def test_what_hardly_is_a_record(values):
    rate, _ = slope(np.arange(values.size) * 0.1, values)
    assert rate.shape == values.shape
    if values.size == 50:
        np.testing.assert_allclose(rate, values[1] * 10, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("noise", [0.0, 1e-5])
def test_what_is_held_counts_where_it_is_new(noise):
    """A laser at 1 kHz logged at 10 kHz: the rate was that of the stairs, and their noise that of the treads."""
    t = np.arange(3000) * 1e-4
    fresh = np.floor(t / 0.997e-3) * 0.997e-3
    q = 0.01 * np.sin(30.0 * fresh) + np.random.default_rng(4).normal(0.0, noise, t.size)
    rate, _ = slope(t, q)
    assert error(rate, 0.3 * np.cos(30.0 * t)) < 0.03
