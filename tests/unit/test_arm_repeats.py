"""Validation data that repeat the motion of the fit are told: errors on them do not test the bodies."""

import numpy as np
import pytest

from signlin_ros.arms.data import ArmRun
from signlin_ros.arms.repeats import repeated

PERIOD = 6.0


def run(first, last, period=PERIOD, source="run.csv", step=0.01):
    """Return two joints' motion of two sines each, of a period, between two times in s, with a sensor's noise."""
    t = np.arange(first, last, step)
    w = 2.0 * np.pi / period
    q = np.stack([np.sin(w * t) + 0.3 * np.cos(3 * w * t), np.cos(2 * w * t) + 0.2 * np.sin(w * t)], axis=1)
    q = q + 1e-4 * np.random.default_rng(1).normal(size=q.shape)
    return ArmRun(t, q, None, q, source, np.zeros(2))


def test_another_part_of_a_periodic_motion_is_no_test():
    (said,) = repeated([run(0.0, 16.0)], [run(16.0, 21.5)])
    assert "run.csv: its validation data repeat the motion of its own part to fit" in said


@pytest.mark.parametrize("step", [0.01, 0.013])
def test_a_record_of_the_same_motion_is_no_test(step):
    (said,) = repeated([run(0.0, 16.0)], [run(3.0, 9.0, source="other.csv", step=step)])
    assert said.startswith("other.csv: its validation data repeat the motion of run.csv")


def test_another_motion_is_one():
    assert repeated([run(0.0, 16.0)], [run(0.0, 10.0, period=7.0)]) == []
    assert repeated([run(0.0, 5.0)], [run(5.0, 12.0)]) == []  # longer than the part to fit: new for a part of it


def test_a_record_that_stands_still_is_not_held_against_others():
    still = run(0.0, 3.0)
    assert repeated([run(0.0, 16.0)], [ArmRun(still.t, 0.0 * still.q, None, still.q, "still.csv", np.zeros(2))]) == []
