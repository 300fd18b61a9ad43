"""The three meanings of the vocabulary agree; the recorder notes each surface once."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from signlin_ros.engine.compiling import caller
from signlin_ros.engine.native import native
from signlin_ros.engine.tape import Tape
from signlin_ros.mathops import SMOOTH_FUNCTIONS, VOCABULARY, NumpyMath, Recorder, SympyMath

CASES = {
    "sign": lambda m, x: m.sign(x),
    "abs": lambda m, x: m.abs(x),
    "positive": lambda m, x: m.positive(x),
    "contact": lambda m, x: m.contact(x),
    "clip": lambda m, x: m.clip(x, 0.7),
    "dead_zone": lambda m, x: m.dead_zone(x, 0.7),
    **{name: lambda m, x, name=name: getattr(m, name)(x) for name in SMOOTH_FUNCTIONS},
    **{name: lambda m, x, name=name: getattr(m, name)(x * x) for name in ("sqrt", "log1p")},
    **{f"abs_power {n}": lambda m, x, n=n: m.abs_power(x, n) for n in (1.0, 2.0, 3.0, 1.5, 7.25)},
    **{f"signed_power {n}": lambda m, x, n=n: m.signed_power(x, n) for n in (1.0, 2.0, 3.0, 1.5, 7.25)},
    "spline": lambda m, x: m.spline(x, (-1.5, -0.3, 0.1, 0.7, 1.0), (-1.0, 0.2 + 0.1 * x, 0.2, 0.9, 0.4)),
    "nested": lambda m, x: m.abs(m.positive(x - 0.2) - 0.3) * m.sign(x),
}


def recorded(word, value):
    """The value of a word under the recorder, with every sign chosen as the exact one, inner ones first."""
    m, x = Recorder(), ca.SX.sym("x")
    result = ca.SX(word(m, x))
    known = []
    for surface in m.surfaces:
        g = ca.Function("g", [x, *(s.symbol for s in m.surfaces[: len(known)])], [surface.g])
        known.append(np.sign(float(g(value, *known))))
    return float(ca.Function("w", [x, *(s.symbol for s in m.surfaces)], [result])(value, *known))


def rendered(word, value):
    """The value of a word's equation."""
    import sympy

    x = sympy.Symbol("x", real=True)
    return float(sympy.sympify(word(SympyMath(), x)).subs(x, sympy.Float(value, 40)))


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("value", [-2.0, -0.7, -0.3, 0.1, 0.25, 0.7, 1.9])
def test_numpy_recorder_and_sympy_agree(name, value):
    want = float(CASES[name](NumpyMath(), np.float64(value)))
    # on a surface the recorded contact (1 + sign(0))/2 is a half: no effect may depend on it
    assert recorded(CASES[name], value) == pytest.approx(want, rel=1e-14, abs=1e-15)
    assert rendered(CASES[name], value) == pytest.approx(want, rel=1e-14, abs=1e-15)


@pytest.mark.parametrize("name", SMOOTH_FUNCTIONS)
@pytest.mark.parametrize("x", [0.01, 0.25, 1.9])
def test_smooth_words_are_compiled_with_their_derivatives(name, x):
    import sympy

    z = ca.SX.sym("z")
    e = getattr(Recorder(), name)(z)
    tape = Tape.of(ca.Function("f", [z], [e, ca.jacobian(e, z), ca.hessian(e, z)[0]]))
    t = sympy.Symbol("t", real=True)
    law = getattr(SympyMath(), name)(t)
    wanted = [float(sympy.diff(law, t, n).subs(t, sympy.Float(x, 40))) for n in range(3)]
    out = np.zeros(3)
    caller(native(tape)[0])(np.array([x]), out)
    np.testing.assert_allclose(out, wanted, rtol=1e-13)
    np.testing.assert_allclose(np.ravel(tape.batch([np.array([x])])), wanted, rtol=1e-13)


def test_every_vocabulary_has_every_word():
    for m in (NumpyMath(), Recorder(), SympyMath()):
        assert all(callable(getattr(m, word)) for word in VOCABULARY)
    assert set(SMOOTH_FUNCTIONS) < set(VOCABULARY)


@given(st.floats(-1e3, 1e3), st.floats(0.0, 1e3))
def test_clip_and_dead_zone_share_the_input(x, limit):
    m = NumpyMath()
    assert m.clip(x, limit) == pytest.approx(np.clip(x, -limit, limit), abs=1e-12)
    assert m.clip(x, limit) + m.dead_zone(x, limit) == pytest.approx(x, abs=1e-12)


def test_equal_and_opposite_surfaces_share_a_symbol():
    m, v = Recorder(), ca.SX.sym("v")
    first, again, opposite = m.abs(v), m.abs(v), m.positive(-v)
    assert len(m.surfaces) == 1
    assert ca.is_equal(first, again, 5)
    assert float(ca.Function("f", [v, m.surfaces[0].symbol], [opposite])(-2.0, -1.0)) == 2.0


def test_kinds_are_told_apart():
    m, v = Recorder(), ca.SX.sym("v")
    m.sign(v), m.abs(v), m.contact(v)
    assert [s.kind for s in m.surfaces] == ["switch", "kink", "contact"]
    assert {s.name for s in m.surfaces} == {"v"}


def test_a_constant_is_evaluated_not_recorded():
    m = Recorder()
    assert float(m.abs(ca.SX(-3.0))) == 3.0
    assert float(m.sign(0.0)) == 0.0
    assert not m.surfaces


@pytest.mark.parametrize("n", [1.5, 2.5])
def test_real_powers_have_slope_0_at_0(n):
    m, x = Recorder(), ca.SX.sym("x")
    for word in (m.abs_power(x, n), m.signed_power(x, n)):
        slope = ca.Function("d", [x, m.surfaces[0].symbol], [ca.jacobian(word, x)])
        assert 0.0 <= float(slope(0.0, 0.0)) < 1e-100


KNOTS = (-1.5, -0.3, 0.1, 0.7, 1.0)


@pytest.mark.parametrize("values", [(-1.0, -0.2, -0.2, 0.9, 1.4), (-2.0, -1.0, 0.5, 0.6, 5.0)])
def test_a_spline_goes_through_its_values_and_rises_where_they_do(values):
    m, x = NumpyMath(), np.linspace(-2.5, 2.0, 4001)
    curve = m.spline(x, KNOTS, values)
    np.testing.assert_allclose(m.spline(np.array(KNOTS), KNOTS, values), values, rtol=1e-14, atol=1e-14)
    assert np.all(np.diff(curve) >= -1e-14)
    for beyond in (x < KNOTS[0], x > KNOTS[-1]):  # straight on
        np.testing.assert_allclose(np.diff(curve[beyond], 2), 0.0, atol=1e-13)


@pytest.mark.parametrize("at", [*KNOTS, -2.0, 0.0, 1.7])
def test_a_spline_has_one_derivative_everywhere(at):
    """The derivative that CasADi finds, at a knot too, is the difference quotient from either side."""
    x, values = ca.SX.sym("x"), (-1.0, 0.2, 0.1, 0.9, 0.4)
    e = Recorder().spline(x, KNOTS, values)
    f = ca.Function("f", [x], [e, ca.jacobian(e, x)])
    slope = float(f(at)[1])
    for h in (-1e-6, 1e-6):
        assert (float(f(at + h)[0]) - float(f(at)[0])) / h == pytest.approx(slope, abs=2e-5)


def test_the_derivatives_by_the_values_of_a_spline_are_numbers_even_where_it_is_flat():
    x, v = ca.SX.sym("x"), ca.SX.sym("v", len(KNOTS))
    e = Recorder().spline(x, KNOTS, ca.vertsplit(v))
    f = ca.Function("f", [x, v], [ca.jacobian(e, v)])
    flat = np.array([f(at, np.zeros(len(KNOTS))) for at in np.linspace(-2.0, 2.0, 21)]).squeeze()
    assert np.isfinite(flat).all()
    np.testing.assert_allclose(
        flat.sum(axis=1), 1.0, atol=1e-12
    )  # a constant added to all values is added to the curve
