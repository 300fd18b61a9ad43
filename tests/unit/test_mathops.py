"""The three meanings of the vocabulary agree; the recorder notes each surface once."""

import casadi as ca
import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

from signlin_ros.mathops import NumpyMath, Recorder, SympyMath

WORDS = {
    "sign": lambda m, x: m.sign(x),
    "abs": lambda m, x: m.abs(x),
    "positive": lambda m, x: m.positive(x),
    "contact": lambda m, x: m.contact(x),
    "clip": lambda m, x: m.clip(x, 0.7),
    "dead_zone": lambda m, x: m.dead_zone(x, 0.7),
    "exp": lambda m, x: m.exp(x),
    "sin": lambda m, x: m.sin(x),
    "cos": lambda m, x: m.cos(x),
    "sqrt": lambda m, x: m.sqrt(x * x),
    **{f"abs_power {n}": lambda m, x, n=n: m.abs_power(x, n) for n in (1.0, 2.0, 3.0, 1.5, 7.25)},
    **{f"signed_power {n}": lambda m, x, n=n: m.signed_power(x, n) for n in (1.0, 2.0, 3.0, 1.5, 7.25)},
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
    x = sympy.Symbol("x", real=True)
    return float(sympy.sympify(word(SympyMath(), x)).subs(x, sympy.Float(value, 40)))


@pytest.mark.parametrize("name", WORDS)
@pytest.mark.parametrize("value", [-2.0, -0.7, -0.3, 0.1, 0.25, 0.7, 1.9])
def test_numpy_recorder_and_sympy_agree(name, value):
    want = float(WORDS[name](NumpyMath(), np.float64(value)))
    # on a surface the recorded contact (1 + sign(0))/2 is a half: no effect may depend on it
    assert recorded(WORDS[name], value) == pytest.approx(want, rel=1e-14, abs=1e-15)
    assert rendered(WORDS[name], value) == pytest.approx(want, rel=1e-14, abs=1e-15)


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
