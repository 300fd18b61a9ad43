"""Which of several minima of a fit is taken, and what a rise of a channel's error says."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
from signlin_ros.diagnosis.output_error import OutputErrorEstimator
from signlin_ros.diagnosis.output_error.score import log_mse
from signlin_ros.diagnosis.validation import ValidationTests

NOISE = np.ones(2)
SAMPLES = 1000


def estimator() -> Any:
    side = SimpleNamespace(noise=NOISE, samples=SAMPLES)
    found = SimpleNamespace(training=side, validation=side, criteria=DEFAULT_CRITERIA)
    found.generalizes_badly = partial(OutputErrorEstimator.generalizes_badly, found)
    return found


def fitted(squares: tuple[float, float], clean: bool = True, odd: bool = False, unseen: Any = None) -> Any:
    known = np.tile(squares, (10, 1))
    other = known if unseen is None else np.tile(unseen, (10, 1))
    return SimpleNamespace(
        training_squares=known,
        validation_squares=other,
        log_mse=log_mse(other, NOISE),
        residual_is_noise=clean,
        white=clean,
        implausible=["lugre_friction"] if odd else [],
    )


# ---------------------------------------------------------------- a channel that errs more


def test_a_model_that_leaves_noise_may_err_a_little_more_in_a_channel():
    base, found = fitted((1.0, 300.0), clean=False), fitted((1.0, 1.0), unseen=(1.3, 1.0))
    assert OutputErrorEstimator.settles(estimator(), base, found)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (fitted((1.0, 300.0)), fitted((1.0, 1.0), unseen=(1.3, 1.0))),  # the other leaves noise, too
        (fitted((1.0, 300.0), clean=False), fitted((1.0, 30.0), clean=False)),  # it leaves more than noise
        (fitted((1.0, 300.0), clean=False), fitted((1.0, 1.0), unseen=(9.0, 1.0))),  # it is wrong elsewhere
        (fitted((1.0, 2.0), clean=False), fitted((1.0, 1.9), unseen=(3.0, 1.9))),  # it errs more in all
    ],
)
def test_a_model_is_refused_for_a_channel_that_errs_more_otherwise(before, after):
    assert not OutputErrorEstimator.settles(estimator(), before, after)


# ---------------------------------------------------------------- what a sensor's steps leave


def left_of_steps(rms: float, dependent: float, step: float) -> bool:
    one = SimpleNamespace(over_noise=rms, structured=True, dependent=dependent)
    final = SimpleNamespace(residual_tests=[one], effects=("stribeck_friction",))
    problem = SimpleNamespace(noise=np.ones(1), quanta=np.array([step]))
    evidence = SimpleNamespace(near_noise=lambda f: True)
    j: Any = SimpleNamespace(
        final=final,
        names=final.effects,
        evidence=evidence,
        dataset=SimpleNamespace(training=problem),
        criteria=DEFAULT_CRITERIA,
    )
    return bool(ValidationTests.of_steps.fget(j))  # type: ignore[attr-defined]


def test_an_error_within_half_a_step_that_follows_from_nothing_is_the_sensors():
    assert left_of_steps(1.1, -0.001, 12**0.5)
    assert not left_of_steps(1.1, 0.1, 12**0.5)  # it follows from the motion
    assert not left_of_steps(1.1, float("nan"), 12**0.5)  # too few samples to tell
    assert not left_of_steps(2.0, -0.001, 12**0.5)  # more than half a step
    assert not left_of_steps(1.1, -0.001, 0.0)  # the sensor shows no steps


# ---------------------------------------------------------------- which minimum


def test_values_of_a_real_thing_are_taken_where_they_err_not_surely_more():
    estimate, odd, real = estimator(), fitted((1.0, 1.0), odd=True), fitted((1.004, 1.004))
    worse = fitted((1.02, 1.02))
    assert OutputErrorEstimator._preferred(estimate, real, odd)
    assert not OutputErrorEstimator._preferred(estimate, odd, real)
    assert not OutputErrorEstimator._preferred(estimate, worse, odd)
    assert not OutputErrorEstimator._preferred(estimate, real, fitted((1.0, 1.0)))
    assert OutputErrorEstimator._preferred(estimate, fitted((1.0, 1.0)), real)
