"""The band of an arm's record is that of its motion, whatever noise its positions have that are differentiated."""

import numpy as np
import pytest

from signlin_ros.arms.data import ArmRun
from signlin_ros.arms.piece import LOWEST, OF_RATE, chosen_band
from signlin_ros.filters import low_pass
from tests.arm_records import STEP, record, small

MODEL = small()


def run(q, v=None):
    return ArmRun(STEP * np.arange(len(q)), q, v, np.zeros(q.shape), "simulated", np.zeros(q.shape[1]))


def quantized(q, bits):
    """Return positions in steps of an encoder."""
    step = 2.0 * np.pi / 2**bits
    return step * np.round(q / step)


def filtered(q, size):
    """Return positions with noise up to half of the highest frequency."""
    return q + low_pass(size * np.random.default_rng(5).normal(size=q.shape), 0.25 / STEP, STEP)


@pytest.mark.parametrize(
    "shown",
    [
        lambda q: quantized(q, 16),
        lambda q: quantized(q, 12),
        lambda q: filtered(q, 1e-3),
        lambda q: q + 1e-3 * np.random.default_rng(6).normal(size=q.shape),
    ],
    ids=["16 bits", "12 bits", "filtered noise", "white noise"],
)
def test_the_band_of_noisy_positions_is_that_of_the_velocities(shown):
    _, q, v, _ = record(MODEL, 3)
    plain = chosen_band([run(q, v)])
    assert plain < 1.0 / STEP / OF_RATE
    assert chosen_band([run(shown(q))]) == pytest.approx(plain, rel=0.35)


def test_a_fast_motion_of_a_joint_widens_the_band():
    _, q, _, _ = record(MODEL, 3)
    q = quantized(q, 16)
    q[:, 1] += 0.01 * np.sin(2.0 * np.pi * 5.0 * STEP * np.arange(len(q)))
    assert chosen_band([run(q)]) == pytest.approx(1.0 / STEP / OF_RATE, rel=0.02)
    assert chosen_band([run(q)]) > LOWEST
