"""What a residual says: structure that channels share, colour; and what a gain in blocks of time is worth."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from signlin_ros.comparison.residuals import Colour, colours, correlations, related, residual_test, white
from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
from signlin_ros.diagnosis.output_error.score import beyond_noise, improvement

T = 4000


def coloured(rng, count=2, rho=0.8):
    return lfilter([np.sqrt(1 - rho**2)], [1, -rho], rng.normal(size=(T, count)), axis=0)


def shares(parts, noise) -> list[Colour]:
    return colours(parts, np.asarray(noise, dtype=float))


@pytest.mark.parametrize("seed", range(5))
def test_coloured_noise_of_two_sensors_is_not_shared(seed):
    found = shares([coloured(np.random.default_rng(seed))], [1.0, 1.0])
    assert not any(one.structured for one in found)
    assert [one.coloured for one in found] == pytest.approx([1.0, 1.0], abs=0.15)
    assert [one.rho for one in found] == pytest.approx([0.8, 0.8], abs=0.08)


@pytest.mark.parametrize("seed", range(5))
def test_an_oscillation_that_two_channels_share_is_structure(seed):
    rng = np.random.default_rng(seed)
    common = coloured(rng, 1)
    innovations = [np.hstack([common, -2 * common, np.zeros((T, 1))]) + rng.normal(size=(T, 3))]
    found = shares(innovations, np.ones(3))
    assert [one.structured for one in found] == [True, True, False]


def test_noise_of_a_speed_derived_from_the_position_is_not_shared():
    position = np.random.default_rng(0).normal(size=T)
    both = np.column_stack([position, np.gradient(position)])
    assert not shares([both], both.std(axis=0))[0].structured


def test_records_are_taken_together():
    rng = np.random.default_rng(3)
    common = coloured(rng, 1)
    both = np.hstack([common, common]) + rng.normal(size=(T, 2))
    whole, halves = shares([both], [1.0, 1.0]), shares([both[: T // 2], both[T // 2 :]], [1.0, 1.0])
    assert all(one.structured for one in (*whole, *halves))
    assert halves[0].slow == pytest.approx(whole[0].slow, abs=0.05)


def test_what_lasts_too_long_is_structure_beyond_white_noise():
    rng = np.random.default_rng(3)
    slow = lfilter([0.5], [1.0, -0.97], rng.normal(size=T))
    (found,) = shares([(slow + rng.normal(size=T))[:, None]], [1.0])
    assert found.structured
    assert found.slow == pytest.approx(1.0 - 1.0 / found.variance, abs=0.1)


def test_noise_of_little_colour_is_no_structure():
    said = [shares([coloured(np.random.default_rng(seed), 1, 0.32)[:1600]], [1.0])[0].structured for seed in range(60)]
    assert np.mean(said) < 0.05


def test_white_noise_is_white_and_coloured_is_not():
    rng = np.random.default_rng(4)
    assert white([rng.normal(size=T)])
    assert not white([coloured(rng, 1)[:, 0]])


def blocks(seed, level, spread=0.3):
    return level * np.exp(spread * np.random.default_rng(seed).normal(size=(50, 1)))


def test_one_lost_stretch_does_not_hide_a_gain():
    before, after = blocks(0, 9.0), blocks(1, 1.0)
    after[3] = 4e4
    found = improvement(before, after, np.ones(1))
    assert found.t_ratio > 5
    assert improvement(after, before, np.ones(1)).t_ratio < -5


def test_no_gain_is_no_gain():
    sure = [improvement(blocks(2 * k, 1.0), blocks(2 * k + 1, 1.0), np.full(1, 0.1)).t_ratio for k in range(100)]
    assert abs(np.mean(sure)) < 0.4
    assert np.std(sure) == pytest.approx(1.0, abs=0.35)


def test_a_channel_that_gets_worse_is_told_by_its_own_standard_error_and_by_what_shows():
    before, after = np.hstack([blocks(1, 9.0), blocks(2, 1.0)]), np.hstack([blocks(3, 1.0), blocks(4, 3.0)])
    found = improvement(before, after, np.full(2, 0.1))
    assert found.rmse_ratios[0] < 0.5 < 1.5 < found.rmse_ratios[1]
    assert found.worsens(DEFAULT_CRITERIA)
    assert not improvement(before, before * 1.0001, np.full(2, 0.1)).worsens(DEFAULT_CRITERIA)


def test_the_share_that_is_explained_is_of_what_is_no_noise():
    before, after = np.full((40, 1), 5.0), np.full((40, 1), 1.0)
    assert improvement(before, after, np.ones(1)).mse_reduction == pytest.approx(1.0)
    assert improvement(before, after, np.full(1, 1e-6)).mse_reduction == pytest.approx(0.8)


def test_the_share_of_all_channels_is_in_units_of_their_noise():
    before, after = np.tile([10.0, 6.0], (40, 1)), np.tile([10.0, 1.0], (40, 1))
    found = improvement(before, after, np.array([1.0, 1.0]))
    assert found.mse_reduction == pytest.approx(1.0)
    assert found.joint_reduction == pytest.approx(5.0 / 14.0)
    assert improvement(before, after, np.array([0.1, 1.0])).joint_reduction == pytest.approx(5.0 / (999.0 + 5.0))


def test_standard_errors_of_noise_are_those_of_a_difference_of_squares():
    """sum of (e + d)^2 - e^2 over n samples of noise e: n d^2 of expectation, 2 |d| sqrt(n) of deviation for unit e."""
    n, d = 400.0, 0.3
    found = beyond_noise(np.full((1, 1), 1.0 + d**2), np.ones((1, 1)), np.array([n]), np.ones(1))
    assert found == pytest.approx(n * d**2 / (2 * d * np.sqrt(n)))


def test_stretches_that_are_shorter_than_the_lags_count_as_far_as_they_go():
    """A live record with gaps: stretches of 20 to 700 samples, and 72 lags."""
    rng = np.random.default_rng(5)
    parts = [rng.normal(size=size) for size in (700, 20, 33, 64, 5, 700)]
    found, variance, count = correlations(parts, 72)
    sums = [sum(float(e[k:] @ e[: max(e.size - k, 0)]) for e in parts if e.size > k) for k in range(73)]
    assert found == pytest.approx(np.array(sums[1:]) / sums[0], abs=1e-12)
    assert (variance, count) == (pytest.approx(sums[0] / 1522), 1522)
    test = residual_test(parts, [rng.normal(size=(e.size, 1)) for e in parts])
    assert test.white
    assert not test.input_correlated
    assert not related(parts, [rng.normal(size=e.size) for e in parts])
