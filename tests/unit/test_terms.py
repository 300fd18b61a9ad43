"""Additive terms, and differences that do not cancel."""

import casadi as ca
import mpmath
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from signlin_ros.engine.terms import Change, TermSplitter

pytestmark = pytest.mark.slow

X, Y, P = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("p")
SPLITTER_X = ([X, Y], [frozenset({0}), frozenset({1})])


def groups(e):
    return TermSplitter(*SPLITTER_X).split(e)


EXPRESSIONS = {
    "constant": (P * 2 + 1, [set()]),
    "linear": (3 * X - P * Y, [{0}, {1}]),
    "a sum of squares": ((X + Y) ** 2, [{0}, {0, 1}, {1}]),
    "hot resistance": ((1 + P * Y) * X**2, [{0}, {0, 1}]),
    "a function": (ca.sin(X + P) - ca.exp(-Y), [{0}, {1}]),
    "a function of two": (ca.sin(X + Y) + X, [{0}, {0, 1}]),
    "a quotient": ((X + 2) / (1 + Y**2), [{0, 1}, {1}]),
    "negated": (-(X + Y + 1), [set(), {0}, {1}]),
    "twice": (2 * (X * Y + P), [set(), {0, 1}]),
}


@pytest.mark.parametrize("name", EXPRESSIONS)
def test_groups_by_the_states_that_a_term_depends_on(name):
    e, want = EXPRESSIONS[name]
    found = groups(e)
    assert sorted(map(sorted, found)) == sorted(map(sorted, want))


@pytest.mark.parametrize("name", EXPRESSIONS)
@given(x=st.floats(-3, 3), y=st.floats(-3, 3), p=st.floats(-3, 3))
def test_the_groups_sum_to_the_expression(name, x, y, p):
    e, _ = EXPRESSIONS[name]
    total, size = sum(groups(e).values(), ca.SX(0)), sum(map(ca.fabs, groups(e).values()), ca.SX(0))
    want, found, scale = (float(v) for v in ca.Function("f", [X, Y, P], [e, total, size])(x, y, p))
    assert found == pytest.approx(want, rel=1e-13, abs=1e-13 * (1 + scale))


def test_a_sign_counts_as_the_states_of_its_surface():
    s = ca.SX.sym("s")
    splitter = TermSplitter([X, Y, s], [frozenset({0}), frozenset({1}), frozenset({0, 1})])
    assert set(splitter.split(X * s + Y)) == {frozenset({0, 1}), frozenset({1})}


REFERENCE = 1.3
FUNCTIONS = {
    "sin": (ca.sin, mpmath.sin),
    "cos": (ca.cos, mpmath.cos),
    "exp": (ca.exp, mpmath.exp),
    "log": (ca.log, mpmath.log),
    "sqrt": (ca.sqrt, mpmath.sqrt),
    "square": (lambda x: x**2, lambda x: x**2),
    "cube": (lambda x: x**3, lambda x: x**3),
    "power": (lambda x: x**1.5, lambda x: x ** mpmath.mpf(1.5)),
    "quotient": (lambda x: (x + 1) / (x * x + 2), lambda x: (x + 1) / (x * x + 2)),
    "inverse": (lambda x: 1 / x, lambda x: 1 / x),
    "fabs": (lambda x: ca.fabs(x - 4), lambda x: abs(x - 4)),
    "nested": (
        lambda x: 3 * ca.exp(-(x**2)) * x - 2 * ca.sin(x),
        lambda x: 3 * mpmath.exp(-(x**2)) * x - 2 * mpmath.sin(x),
    ),
    "tanh, by subtraction": (ca.tanh, mpmath.tanh),
}


@pytest.mark.parametrize("name", FUNCTIONS)
@given(size=st.floats(-15.0, -0.5), sign=st.sampled_from([-1.0, 1.0]))
def test_a_change_keeps_its_digits(name, size, sign):
    """e(r + d) - e(r) to rounding even where d is a rounding error of r, because d itself is known."""
    build, exact = FUNCTIONS[name]
    d = sign * 10.0**size
    dx = ca.SX.sym("d")
    change = Change(X, ca.SX(REFERENCE), dx).of(build(X))
    found = float(ca.Function("c", [X, dx], [change])(REFERENCE + d, d))
    with mpmath.workdps(60):
        want = exact(mpmath.mpf(REFERENCE) + mpmath.mpf(d)) - exact(mpmath.mpf(REFERENCE))
        spare = 1e-15 if "subtraction" in name else 0.0
        # a quotient of a sum may lose what the sum's terms lose against each other, never what d loses against r
        assert abs(found - want) <= 1e-12 * abs(want) + spare


@given(st.floats(-20, 20))
def test_a_change_from_zero_is_exact_for_products_with_a_large_constant(exponent):
    """c = 10, v = 1e-14 must not cost a digit: (10 + v)(1 + v) - 10."""
    v = 10.0 ** (exponent - 5)
    assume(v < 1e3)
    change = Change(X, ca.SX(0), X).of((10 + X) * (1 + X))
    found = float(ca.Function("c", [X], [change])(v))
    assert found == pytest.approx(11 * v + v * v, rel=1e-15)


def test_a_symbol_that_is_not_named_stays():
    assert Change(X, ca.SX(0), X).of(P**2 + ca.sin(P)).is_zero()
