"""How late a velocity is beside the position that it is the rate of."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from signlin_ros.relative_lag import relative_lag

STEP = 0.001
T = np.arange(8000) * STEP
RATES, PHASES = 2 * np.pi * np.array([0.7, 1.9, 4.3, 9.0, 17.0]), np.array([0.3, 2.0, 4.4, 1.1, 5.0])


def position(t: np.ndarray) -> np.ndarray:
    return (np.sin(np.outer(t, RATES) + PHASES) / RATES).sum(axis=1)


def velocity(t: np.ndarray) -> np.ndarray:
    return np.cos(np.outer(t, RATES) + PHASES).sum(axis=1)


def noise(level: float, seed: int = 0) -> np.ndarray:
    return level * np.random.default_rng(seed).normal(size=T.size)


@pytest.mark.parametrize("lag", [-0.012, -0.0003, 0.0004, 0.0017, 0.02])
@pytest.mark.parametrize("quantum", [0.0, 1e-4])
def test_a_lag_is_found_to_a_part_of_a_sample(lag: float, quantum: float) -> None:
    q = position(T)
    q = np.round(q / quantum) * quantum if quantum else q
    assert relative_lag(q, velocity(T - lag) + noise(0.01), STEP) == pytest.approx(lag, abs=1e-4)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("level", [0.001, 0.3])
def test_where_nothing_is_late_there_is_no_lag(seed: int, level: float) -> None:
    assert relative_lag(position(T) + noise(1e-4, 50 + seed), velocity(T) + noise(level, seed), STEP) == 0.0


def test_a_filter_is_late_by_its_time_constant() -> None:
    pole = np.exp(-STEP / 0.004)
    filtered = lfilter([1.0 - pole], [1.0, -pole], velocity(T))
    assert relative_lag(position(T), filtered, STEP) == pytest.approx(0.004 - STEP / 2, abs=5e-4)


def test_of_what_repeats_the_smallest_lag_is_taken() -> None:
    t = np.arange(4000) * STEP
    assert relative_lag(np.sin(330.0 * t) / 330.0, np.cos(330.0 * (t - 0.00175)), STEP) == pytest.approx(
        0.00175, rel=0.02
    )


@pytest.mark.parametrize("samples", [5, 20])
def test_too_few_samples_tell_of_no_lag(samples: int) -> None:
    t = T[:samples]
    assert relative_lag(position(t), velocity(t - 0.003), STEP) == 0.0


def test_what_stands_still_has_no_lag() -> None:
    assert relative_lag(np.zeros(500), np.zeros(500), STEP) == 0.0
