"""Machine code of a step, against the same written with matrices."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from signlin_ros.engine.compiling import call_among, compiled
from signlin_ros.engine.native import translated
from signlin_ros.engine.tape import Tape
from signlin_ros.follow.equations import equations
from signlin_ros.follow.steps import DECLARED, carrier, corrected, pace, padded, runge_kutta, seen
from signlin_ros.model import Model

RANDOM = np.random.default_rng(4)


@compiled
def run(address, a, b, i, c, d):
    call_among(address, a, b, i, c, d)


def built(text: str, name: str, declared: tuple[str, ...] = DECLARED) -> int:
    return translated("\n".join([*declared, text]), (name,))[0]


@pytest.mark.parametrize("n", [1, 2, 3, 5, 8])
@pytest.mark.parametrize("count", [1, 4, 11])
@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_sensitivities_are_carried_by_the_trapezoidal_rule(n, count, share):
    width = padded(count)
    J, P = RANDOM.random((n, n)) < share, np.zeros((n, width), dtype=bool)
    P[:, :count] = RANDOM.random((n, count)) < share
    address = built(carrier("tape_carry", J, P), "carry")
    (J0, J1), (P0, P1) = RANDOM.normal(size=(2, n, n)) * J, RANDOM.normal(size=(2, n, width)) * P
    S, early, late = RANDOM.normal(size=(n, width)), RANDOM.random(n) * 0.1, RANDOM.random(n) * 0.1
    right = S + early[:, None] * (J0 @ S + P0) + late[:, None] * P1
    wanted = np.linalg.solve(np.eye(n) - late[:, None] * J1, right)
    first = np.concatenate([J0.ravel(), P0.ravel()])
    last = np.concatenate([np.full(3, np.nan), J1.ravel(), P1.ravel()])
    run(address, first, last, 3, S, np.array([early, late]))
    np.testing.assert_allclose(S, wanted, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(("n", "ny", "count"), [(1, 1, 1), (3, 2, 4), (5, 3, 11)])
@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_what_is_seen_of_sensitivities_and_what_an_observer_makes_of_it(n, ny, count, share):
    width = padded(count)
    shown, known = RANDOM.random((ny, n)) < share, np.zeros((ny, width), dtype=bool)
    known[:, :count] = RANDOM.random((ny, count)) < share
    H, P = RANDOM.normal(size=(ny, n)) * shown, RANDOM.normal(size=(ny, width)) * known
    S, K = RANDOM.normal(size=(n, width)), RANDOM.normal(size=(n, ny))
    out, D = np.concatenate([[np.nan] * 2, H.ravel(), [np.nan] * 3, P.ravel()]), np.full((ny, width), np.nan)
    run(built(seen("tape_seen", shown, known, (2, 5 + H.size)), "seen"), out, D, 0, S, np.zeros(1))
    np.testing.assert_allclose(D, -(P + H @ S), rtol=1e-13, atol=1e-13)
    wanted = S + K @ D
    run(built(corrected("tape_corrected", n, ny, width), "corrected"), K, D, 0, S, np.zeros(1))
    np.testing.assert_allclose(S, wanted, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("n", [1, 3, 6])
@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_the_pace_is_the_largest_row_of_the_square(n, share):
    pattern = RANDOM.random((n, n)) < share
    J, ratio, result = RANDOM.normal(size=(n, n)) * pattern, RANDOM.random((n, n)), np.full(2, np.nan)
    lasting = tuple(range(0, n, 2))
    run(built(pace("tape_pace", pattern, lasting), "pace"), J.ravel(), ratio, 0, result, result)
    for found, of in zip(result, (tuple(range(n)), lasting), strict=True):
        part = np.ix_(of, of)
        wanted = (np.abs(J[part] @ J[part]) * ratio[part]).sum(axis=1).max()
        assert found == pytest.approx(wanted, rel=1e-12, abs=1e-300)


def rk4(f, x, h):
    k1 = f(x)
    k2 = f(x + h / 2 * k1)
    k3 = f(x + h / 2 * k2)
    return k1, x + h / 6 * (k1 + 2 * k2 + 2 * k3 + f(x + h * k3))


@pytest.mark.parametrize("stuck", [False, True])
def test_a_step_is_runge_and_kuttas(stuck):
    x, u, p, s = (ca.SX.sym(name, size) for name, size in (("x", 3), ("u", 1), ("p", 2), ("s", 1)))
    f = ca.vertcat(x[1], ca.sin(x[0]) - p[0] * x[1] + u - p[1] * (1 + x[2] ** 2) * s, -x[2] + ca.exp(p[0]) * x[0])
    g = x[1]
    rate = ca.mtimes(ca.jacobian(g, x), f)
    blocks = ca.vertcat(f, g, rate, ca.densify(ca.jacobian(f, s)), ca.jacobian(rate, s))
    function = ca.Function("f", [x, u, p, s], [ca.densify(blocks)])
    text, calls = runge_kutta("tape_step", Tape.of(function), 3, stuck)
    address = built(text, "step", tuple(sorted({*DECLARED, *calls})))

    def slope(state):
        at = lambda sign: function(state, 0.7, [0.3, 0.5], sign).full().ravel()  # noqa: E731
        free = at(-1.0 if not stuck else 0.0)
        return free[:3] if not stuck else free[:3] - free[5:8] * free[4] / free[8]

    start, h = np.array([0.2, 0.0 if stuck else -0.4, 1.3]), 0.05
    first, wanted = rk4(slope, start, h)
    z = np.array([9.0, 9.0, 9.0, 0.7, 0.3, 0.5, -1.0])
    run(address, z, start, 0, first, np.array([h]))
    np.testing.assert_allclose(z[:3], wanted, rtol=1e-13, atol=1e-14)
    assert not stuck or abs(z[1]) < 1e-14


def test_what_follows_without_sensitivities_knows_the_same():
    model = Model.load("dc_motor")
    free = tuple(model.trace.parameters)
    eq = equations(model.structure, ("speed",), free)
    plain = equations(model.structure, ("speed",), ())
    assert eq.calls(False)[:2] == plain.calls(False)[:2]
    assert eq.calls(True)[1] != eq.calls(False)[1]
    assert [eq.flags(with_s)[3] for with_s in (True, False)] == [len(free), 0]
