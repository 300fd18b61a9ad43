"""What a prediction is worth where it follows nothing: no error is measured in a noise that is all of the signal."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.comparison.scores import MIN_FIT_PERCENT, follows_nothing, score, unfollowed

T = np.linspace(0.0, 10.0, 2000)
Y = np.sin(T)


def test_a_good_fit_is_told_in_multiples_of_the_noise():
    noise = 0.05 * np.random.default_rng(1).normal(size=T.size)
    found = score(Y + noise, Y, 0.05)
    assert found is not None
    assert found.rmse_over_noise == pytest.approx(1.0, abs=0.05)
    assert unfollowed({"speed": found}) == []


@pytest.mark.parametrize("noise", [0.5, 0.7, 1.0])
def test_noise_as_large_as_the_signal_is_none_to_measure_by(noise):
    found = score(Y, np.zeros_like(Y), noise)
    assert found is not None
    assert found.fit_percent is not None
    assert found.fit_percent < MIN_FIT_PERCENT
    assert found.rmse_over_noise is None
    assert unfollowed({"speed": found}) == ["speed"]


def test_an_error_far_beyond_the_noise_is_told_whatever_the_fit():
    found = score(Y, np.zeros_like(Y), 0.01)
    assert found is not None
    assert found.rmse_over_noise == pytest.approx(np.sqrt(np.mean(Y**2)) / 0.01, rel=1e-6)


def test_the_sentence_names_the_channels_and_what_may_be():
    assert follows_nothing(["speed"]).startswith("The speed fits no model")
    assert follows_nothing(["speed", "position"]).startswith("The speed and position fit no model")
