"""Bodies that exist, nearest an estimate of bodies that do not: the optimum of a convex problem."""

from types import SimpleNamespace

import numpy as np
import pytest

from signlin_ros.arms.consistent import consistent
from signlin_ros.robots.inertia import TEN, from_pseudo_inertia, least_eigenvalue, pseudo_inertia

BODIES, MORE = 3, 2


def body(rng):
    """Return the inertial parameters (10,) of a body that exists."""
    L = np.tril(rng.normal(size=(4, 4))) * [1.0, 0.5, 0.5, 0.3]
    return from_pseudo_inertia(L @ L.T + 0.02 * np.eye(4))


def estimate(rng, broken, names=("0.offset", "1.offset")):
    """Return an estimate of bodies and other coefficients, some bodies with an inertia below nothing."""
    pi = np.concatenate([body(rng) for _ in range(BODIES)])
    for k in broken:
        J = pseudo_inertia(pi[TEN * k : TEN * (k + 1)])
        values, vectors = np.linalg.eigh(J)
        values[0] = -0.3 * values[-1]
        pi[TEN * k : TEN * (k + 1)] = from_pseudo_inertia((vectors * values) @ vectors.T)
    size = TEN * BODIES + MORE
    A = rng.normal(size=(2 * size, size)) * np.geomspace(1.0, 100.0, size)
    theta = np.concatenate([pi, rng.normal(size=MORE)])
    design = SimpleNamespace(names=(*("" for _ in pi), *names))
    return SimpleNamespace(pi=pi, theta=theta, G=A.T @ A, rows=SimpleNamespace(n=BODIES), design=design)


@pytest.mark.parametrize("seed", range(4))
def test_bodies_exist_and_no_others_are_nearer(seed):
    rng = np.random.default_rng(seed)
    own = estimate(rng, broken=(0, 2))
    start = np.concatenate([body(rng) for _ in range(BODIES)])
    found = consistent(own, start, np.zeros(TEN * BODIES))
    bodies = found[: TEN * BODIES].reshape(-1, TEN)
    assert min(least_eigenvalue(one) for one in bodies) > 0.0
    slope = own.G @ (found - own.theta)
    left = 0.5 * (found - own.theta) @ slope
    np.testing.assert_allclose(slope[TEN * BODIES :], 0.0, atol=1e-6 * np.abs(own.G).max())
    # convex: towards any bodies that exist, the squares do not fall
    for _ in range(50):
        other = np.concatenate([*(body(rng) for _ in range(BODIES)), found[TEN * BODIES :]])
        assert slope @ (other - found) > -1e-3 * left


def test_bodies_that_exist_stay_as_they_are():
    rng = np.random.default_rng(9)
    own = estimate(rng, broken=())
    assert consistent(own, own.pi, np.zeros(TEN * BODIES)) is own.theta


def test_what_is_carried_is_taken_off_before_a_body_has_to_exist():
    rng = np.random.default_rng(10)
    own = estimate(rng, broken=(1,))
    carried = np.concatenate([np.zeros(TEN), 2.0 * body(rng), np.zeros(TEN)])
    found = consistent(own, np.concatenate([body(rng) for _ in range(BODIES)]), carried)
    bodies = (found[: TEN * BODIES] - carried).reshape(-1, TEN)
    assert min(least_eigenvalue(one) for one in bodies) > 0.0


@pytest.mark.parametrize("exist", [True, False])
def test_what_cannot_be_below_nothing_is_not_and_the_rest_goes_with_it(exist):
    rng = np.random.default_rng(11)
    own = estimate(rng, broken=(1,) if exist else (), names=("0.motor_inertia", "0.viscous_friction.b"))
    own.theta[-MORE:] = [-0.4, 0.7]
    start = np.concatenate([body(rng) for _ in range(BODIES)])
    found = consistent(own, start, np.zeros(TEN * BODIES), exist)
    assert found[-MORE] == 0.0
    assert found[-1] > 0.0
    away, clipped = found - own.theta, own.theta.copy()
    clipped[-MORE] = 0.0
    slope = own.G @ away
    free = [-1, *(range(TEN * BODIES) if not exist else [])]
    np.testing.assert_allclose(slope[free], 0.0, atol=1e-6 * np.abs(own.G).max())
    assert slope[-MORE] > 0.0  # below nothing would be nearer
    if not exist:
        assert away @ own.G @ away < 0.9 * (clipped - own.theta) @ own.G @ (clipped - own.theta)
