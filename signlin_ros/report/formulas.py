"""The laws of effects as formulas: the effect's own function called with SymPy, set by matplotlib.

Without the extra `symbolic`, or where a law cannot be set, the text of the catalogue stands in its place.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from typing import Any

from signlin_ros.effects import Effect, find_effect
from signlin_ros.effects.base import SensorEffect
from signlin_ros.mathops import SympyMath
from signlin_ros.model import Model
from signlin_ros.names import printed_name
from signlin_ros.par import Namespace, as_law_sees, declared_name, gathered, nominal_values, place_of
from signlin_ros.plotting import styled
from signlin_ros.report.page import Formula

MAX_WRITTEN_ELEMENTS = 3
"""Elements of a list with which a law is still written out."""
SIZE = 13.0
"""Size of the letters in points."""
WORD_NAMES = ("excess", "gap")
"""Names that are words and not letters."""
OWN_STATE_SYMBOLS = {"position": "q_2", "velocity": "v_2", "temperature_rise": "Theta"}
"""How own states are written, where not by their names."""


def formula(effect: str, model: Model) -> Formula:
    """Return the law of an effect on a model's plant."""
    kind = find_effect(effect, "effects")
    text = f"{printed_name(kind.name)}: {kind.equation}"
    try:
        lines = [] if _longest_list(kind, model) > MAX_WRITTEN_ELEMENTS else list(_lines(kind, model))
    except (ImportError, AttributeError, TypeError, ValueError):
        lines = []
    if not lines or any("\\theta" in line or "\\begin" in line for line in lines):
        return Formula(None, text)  # without SymPy, or with what matplotlib cannot set
    return Formula(_svg(lines), text)


def _longest_list(kind: type[Effect], model: Model) -> int:
    lists = (gathered(use.parameters).values() for use in model.effects.values() if use.type == kind.name)
    return max((len(value) for values in lists for value in values if isinstance(value, list)), default=0)


def _lines(kind: type[Effect], model: Model) -> Iterator[str]:
    """Yield the equations of an effect, in the subset of TeX that matplotlib sets."""
    import sympy

    if issubclass(kind, SensorEffect):
        return
    m, x, p = SympyMath(), _coordinates(kind, model), _parameters(kind, model)
    force, effect = "T" if model.unit_of("F") == "N·m" else "F", kind()
    if kind.input is not Effect.input:
        yield rf"u \rightarrow {_tex(effect.input(m, sympy.Symbol('u', real=True), p))}"
    if kind.delay is not Effect.delay:
        yield rf"u(t) \rightarrow u(t - {_tex(effect.delay(p))})"
    if kind.torque_constant is not Effect.torque_constant:
        yield rf"K_t \rightarrow {_tex(effect.torque_constant(m, x, p, sympy.Symbol('K_t')))}"
    if kind.resistance is not Effect.resistance:
        yield rf"R_a \rightarrow {_tex(effect.resistance(m, x, p, sympy.Symbol('R_a')))}"
    if kind.spring is not Effect.spring:
        yield rf"k\,q \rightarrow {_tex(effect.spring(m, x, p, sympy.Symbol('k')))}"
    elif kind.force is not Effect.force:
        yield f"{force} = {_tex(effect.force(m, x, p))}"
    for name, rate in effect.rates(m, x, p).items():
        yield rf"\dot{{{_tex(sympy.Symbol(OWN_STATE_SYMBOLS.get(name, name)))}}} = {_tex(rate)}"


def _tex(expression: Any) -> str:
    """Return an expression as TeX, with a common minus in front and whole words upright."""
    import sympy

    tidy = expression if expression.has(sympy.Max) else sympy.factor_terms(expression)
    words = {s: rf"\mathrm{{{s.name}}}\," for s in tidy.free_symbols if s.name.isalpha() and s.name in WORD_NAMES}
    return _plain_brackets(str(sympy.latex(tidy, symbol_names=words)))


def _plain_brackets(tex: str) -> str:
    r"""Take \left and \right from brackets around what is no taller than a letter: matplotlib makes them too small."""
    found = 1
    while found:
        tex, round_ones = re.subn(r"\\left\(((?:(?!\\left|\\right|\\frac).)*)\\right\)", r"(\1)", tex)
        tex, bars = re.subn(r"\\left\|((?:(?!\\left|\\right|\\frac).)*)\\right\|", r"|\1|", tex)
        found = round_ones + bars
    return re.sub(r"\\(operatorname|sin|cos|tanh|log|max)", r"\\,\\\1", tex)


def _coordinates(kind: type[Effect], model: Model) -> Namespace:
    import sympy

    def symbol(name: str) -> Any:
        return sympy.Symbol(name, real=True)

    own = Namespace({name: symbol(OWN_STATE_SYMBOLS.get(name, name)) for name in kind.states})
    known = {"velocity": "v", "position": "q", "drive_force": "F_drive", "external_force": "F_ext", "current": "i"}
    known |= {"temperature": "T"}
    symbols = {name: symbol(letter) for name, letter in known.items()}
    return Namespace({**symbols, "resistance": sympy.Symbol("R"), "own": own})


def _parameters(kind: type[Effect], model: Model) -> Namespace:
    """Return the parameters as symbols, those that shape the equations as the numbers that the model has for them.

    Elements of lists are ``A_1``, ``A_2``, ...
    """
    import sympy

    values: dict[str, Any] = {}
    pars, use = kind.pars(), next((u for u in model.effects.values() if u.type == kind.name), None)
    given = use.parameters if use else nominal_values(pars)
    for name in given:
        par, place = pars[name], place_of(name)
        if par.free_standing and kind.spring is not Effect.spring:
            continue
        letter = name if place is None else f"{declared_name(name)}_{place + 1}"
        values[name] = sympy.Symbol(letter, positive=True)
        if par.words or (par.structural and use):
            values[name] = given[name] if par.words else sympy.nsimplify(given[name])
    return as_law_sees(pars, values)


def _svg(lines: list[str]) -> bytes:
    """Return lines of TeX as SVG, cut to size; letters are paths, so that no font is needed."""
    import matplotlib as mpl

    with styled(8.0, 1.0) as figure, mpl.rc_context({"svg.fonttype": "path", "svg.hashsalt": "signlin"}):
        figure.set_layout_engine("none")
        for i, line in enumerate(lines):
            figure.text(0.0, 1.0 - i * 0.45, f"${line}$", fontsize=SIZE, va="top", math_fontfamily="cm")
        buffer = io.BytesIO()
        figure.savefig(
            buffer, format="svg", bbox_inches="tight", pad_inches=0.02, transparent=True, metadata={"Date": None}
        )
    return buffer.getvalue()


__all__ = ["formula"]
