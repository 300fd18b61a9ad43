"""Tapes at many points, four at a time, against NumPy."""

import casadi as ca
import numpy as np
import pytest

from signlin_ros.engine.operations import NUMPY as OPERATIONS
from signlin_ros.engine.tape import Tape
from signlin_ros.engine.wide import LANES, WideWriter, at_points
from tests.unit.test_native import CORNERS, DOMAINS, SPECIAL

RANDOM = np.random.default_rng(5)


def tape_of(*results):
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p", 2)
    return Tape.of(ca.Function("f", [x, u, p], [ca.vertcat(*(result(x, u, p) for result in results))]))


def found_and_wanted(tape, x, u, constants):
    results = np.full((len(x), tape.n_out), 7.0)
    at_points(tape, (2, 1), constants)(x, u, results)
    return results, tape.batch([*x.T, *u.T, *constants]).T


@pytest.mark.parametrize("count", [1, LANES - 1, LANES, LANES + 1, 4 * LANES + 3])
def test_any_number_of_points(count):
    tape = tape_of(
        lambda x, u, p: x[0] * p[1] + u,
        lambda x, u, p: ca.tanh(x[1]) / p[0],
        lambda x, u, p: p[0] ** 2 / p[1],  # the same everywhere
        lambda x, u, p: ca.SX(3.0),
        lambda x, u, p: x[1],
        lambda x, u, p: ca.if_else(x[0] > p[0], x[0], ca.sign(u)),
    )
    x, u = RANDOM.normal(size=(count, 2)), RANDOM.normal(size=(count, 1))
    found, wanted = found_and_wanted(tape, x, u, np.array([0.2, -3.0]))
    np.testing.assert_allclose(found, wanted, rtol=1e-15)


def test_no_point_at_all():
    at_points(tape_of(lambda x, u, p: x[0]), (2, 1), np.ones(2))(np.zeros((0, 2)), np.zeros((0, 1)), np.zeros((0, 1)))


@pytest.mark.parametrize("op", OPERATIONS)
def test_every_operation_in_a_lane_is_the_one_of_numpy(op):
    """Of two inputs that differ from lane to lane, and of one of them with what is the same everywhere."""
    points = [*RANDOM.uniform(*DOMAINS.get(op, (-3.0, 3.0)), (50, 2)).tolist(), *CORNERS, *SPECIAL]
    a, b = (np.array(column) for column in zip(*points, strict=True))
    columns, none = [a, b, np.zeros(a.size), np.float64(0.75)], np.zeros(0)
    for one, other in ((0, 1), (0, 3), (3, 0)):
        tape = Tape(np.array([op]), np.array([one]), np.array([other]), none, np.array([4]), n_in=4, n_head=1)
        results = np.empty((a.size, 1))
        at_points(tape, (2, 1), np.array([0.75]))(np.column_stack([a, b]), np.zeros((a.size, 1)), results)
        np.testing.assert_allclose(results[:, 0], tape.batch(columns)[0], rtol=1e-15)


def test_what_is_the_same_everywhere_stands_before_the_loop():
    text = WideWriter(tape_of(lambda x, u, p: x[0] * ca.exp(p[0] * p[1])), (2, 1)).loop("f")
    before, _, loop = text.partition("loop:")
    assert "llvm.exp.f64(" in before
    assert "exp" not in loop
