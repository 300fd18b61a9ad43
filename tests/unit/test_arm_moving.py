"""A base that moves: gravity's direction changes along a record, which the equations do not have."""

from dataclasses import replace

import numpy as np
import pytest

from signlin_ros.arms.data import ArmRun
from signlin_ros.arms.notes import moving_notes
from signlin_ros.arms.told import verdict
from signlin_ros.arms.verbs import diagnose
from signlin_ros.robots import inverse_dynamics
from tests.arm_records import record, small

MODEL, BAND, ANGLE = small(), 6.0, np.deg2rad(2.0)


def run(source, seed, angle):
    """Return a record of an arm on a base that rolls to and fro by an angle (rad) along it."""
    t, q, v, u = record(MODEL, seed)
    rest = np.zeros_like(q)
    across = replace(MODEL.robot, gravity=np.array([0.0, 9.81, 0.0]))
    rolls = angle * np.sin(2.0 * np.pi * t / 11.0)
    return ArmRun(t, q, v, u + rolls[:, None] * inverse_dynamics(across, q, rest, rest), source, np.zeros(q.shape[1]))


def test_a_base_that_moves_is_told_with_its_angle_and_nothing_else_is():
    found = diagnose(MODEL, [run("a.csv", 41, ANGLE)], [run("b.csv", 42, 0.0)], BAND)
    (moving,) = found.comparison.study.moving
    assert moving.source == "a.csv"
    assert moving.size == pytest.approx(ANGLE, rel=0.25)
    (note,) = moving_notes(found.comparison.study)
    assert "a.csv" in note
    assert found.found == ()
    assert verdict(found) == "unexplained"


@pytest.mark.parametrize("seed", [43, 45])
def test_a_base_that_stands_is_not_told(seed):
    found = diagnose(MODEL, [run("a.csv", seed, 0.0)], [run("b.csv", seed + 1, 0.0)], BAND)
    assert found.comparison.study.moving == ()
    assert moving_notes(found.comparison.study) == []
