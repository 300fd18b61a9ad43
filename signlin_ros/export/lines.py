"""A recorded function as lines of a language: C, Python, CasADi's Python or SymPy's, all from the same tape.

Nothing of a law is written here: `signlin_ros.engine.tape.Tape` holds the operations that were recorded, and a
`Dialect` says how each is spelt.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import casadi as ca

from signlin_ros.engine.tape import Tape

_INFIX = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
_COMPARISONS = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!="}
_CALLED = {
    ca.OP_EXP: "exp",
    ca.OP_LOG: "log",
    ca.OP_SQRT: "sqrt",
    ca.OP_SIN: "sin",
    ca.OP_COS: "cos",
    ca.OP_TAN: "tan",
    ca.OP_ASIN: "asin",
    ca.OP_ACOS: "acos",
    ca.OP_ATAN: "atan",
    ca.OP_SINH: "sinh",
    ca.OP_COSH: "cosh",
    ca.OP_TANH: "tanh",
    ca.OP_ASINH: "asinh",
    ca.OP_ACOSH: "acosh",
    ca.OP_ATANH: "atanh",
    ca.OP_FLOOR: "floor",
    ca.OP_CEIL: "ceil",
    ca.OP_LOG1P: "log1p",
    ca.OP_EXPM1: "expm1",
}
MAX_INLINE_LENGTH = 60
"""An expression that is used once is written where it is used, if it is no longer than so many letters."""


@dataclass(frozen=True)
class Dialect:
    """How a language spells the operations.

    ``prefix`` of functions of one argument, ``own`` templates of ``{a}`` and ``{b}`` for what is spelt in another
    way, ``line`` the template of an assignment.
    """

    prefix: str
    line: str
    own: Mapping[int, str] = field(default_factory=dict)

    def spelt(self, op: int, a: str, b: str) -> str:
        """Return one operation on two texts."""
        if op in self.own:
            return self.own[op].format(a=a, b=b)
        if op in _INFIX:
            return f"({a} {_INFIX[op]} {b})"
        if op in _CALLED:
            return f"{self.prefix}{_CALLED[op]}({a})"
        if op in _COMPARISONS:
            return f"({a} {_COMPARISONS[op]} {b})"
        plain = {ca.OP_ASSIGN: a, ca.OP_NEG: f"(-{a})", ca.OP_SQ: f"({a} * {a})", ca.OP_TWICE: f"(2.0 * {a})"}
        if op in plain:
            return plain[op]
        if op == ca.OP_INV:
            return f"(1.0 / {a})"
        raise NotImplementedError(f"CasADi operation {op}")


_C = {op: f"({{a}} {sign} {{b}} ? 1.0 : 0.0)" for op, sign in _COMPARISONS.items()}
C = Dialect(
    "",
    "const double {name} = {value};",
    _C
    | {
        ca.OP_NOT: "({a} == 0.0 ? 1.0 : 0.0)",
        ca.OP_AND: "({a} != 0.0 && {b} != 0.0 ? 1.0 : 0.0)",
        ca.OP_OR: "({a} != 0.0 || {b} != 0.0 ? 1.0 : 0.0)",
        ca.OP_IF_ELSE_ZERO: "({a} != 0.0 ? {b} : 0.0)",
        ca.OP_FABS: "fabs({a})",
        ca.OP_SIGN: "(({a} > 0.0) - ({a} < 0.0))",
        ca.OP_POW: "pow({a}, {b})",
        ca.OP_CONSTPOW: "pow({a}, {b})",
        ca.OP_FMIN: "({a} < {b} ? {a} : {b})",
        ca.OP_FMAX: "({a} > {b} ? {a} : {b})",
        ca.OP_FMOD: "fmod({a}, {b})",
        ca.OP_ATAN2: "atan2({a}, {b})",
        ca.OP_COPYSIGN: "copysign({a}, {b})",
        ca.OP_HYPOT: "hypot({a}, {b})",
    },
)
_ARRAY_COMPARISONS = {op: f"1.0 * ({{a}} {sign} {{b}})" for op, sign in _COMPARISONS.items()}
_BINARY_OPERATIONS = {
    ca.OP_POW: "({a} ** {b})",
    ca.OP_CONSTPOW: "({a} ** {b})",
    ca.OP_FABS: "abs({a})",
}
NUMPY = Dialect(
    "np.",
    "{name} = {value}",
    {op: f"({text})" for op, text in _ARRAY_COMPARISONS.items()}
    | _BINARY_OPERATIONS
    | {
        ca.OP_ASIN: "np.arcsin({a})",
        ca.OP_ACOS: "np.arccos({a})",
        ca.OP_ATAN: "np.arctan({a})",
        ca.OP_ASINH: "np.arcsinh({a})",
        ca.OP_ACOSH: "np.arccosh({a})",
        ca.OP_ATANH: "np.arctanh({a})",
        ca.OP_NOT: "(1.0 * ({a} == 0.0))",
        ca.OP_AND: "(1.0 * (({a} != 0.0) & ({b} != 0.0)))",
        ca.OP_OR: "(1.0 * (({a} != 0.0) | ({b} != 0.0)))",
        ca.OP_IF_ELSE_ZERO: "np.where({a} != 0.0, {b}, 0.0)",
        ca.OP_SIGN: "np.sign({a})",
        ca.OP_FMIN: "np.minimum({a}, {b})",
        ca.OP_FMAX: "np.maximum({a}, {b})",
        ca.OP_FMOD: "np.fmod({a}, {b})",
        ca.OP_ATAN2: "np.arctan2({a}, {b})",
        ca.OP_COPYSIGN: "np.copysign({a}, {b})",
        ca.OP_HYPOT: "np.hypot({a}, {b})",
    },
)
CASADI = Dialect(
    "ca.",
    "{name} = {value}",
    _BINARY_OPERATIONS
    | {
        ca.OP_NOT: "ca.logic_not({a})",
        ca.OP_AND: "ca.logic_and({a}, {b})",
        ca.OP_OR: "ca.logic_or({a}, {b})",
        ca.OP_IF_ELSE_ZERO: "ca.if_else({a}, {b}, 0)",
        ca.OP_FABS: "ca.fabs({a})",
        ca.OP_SIGN: "ca.sign({a})",
        ca.OP_FMIN: "ca.fmin({a}, {b})",
        ca.OP_FMAX: "ca.fmax({a}, {b})",
        ca.OP_FMOD: "ca.fmod({a}, {b})",
        ca.OP_ATAN2: "ca.atan2({a}, {b})",
        ca.OP_COPYSIGN: "ca.copysign({a}, {b})",
        ca.OP_HYPOT: "ca.hypot({a}, {b})",
    },
)
SYMPY = Dialect(
    "sp.",
    "{name} = {value}",
    {
        ca.OP_LT: "_holds({a} < {b})",
        ca.OP_LE: "_holds({a} <= {b})",
        ca.OP_EQ: "_holds(sp.Eq({a}, {b}))",
        ca.OP_NE: "_holds(sp.Ne({a}, {b}))",
        ca.OP_NOT: "_holds(sp.Eq({a}, 0))",
        ca.OP_IF_ELSE_ZERO: "sp.Piecewise(({b}, sp.Ne({a}, 0)), (0, True))",
        ca.OP_FABS: "sp.Abs({a})",
        ca.OP_SIGN: "sp.sign({a})",
        ca.OP_POW: "({a} ** {b})",
        ca.OP_CONSTPOW: "({a} ** {b})",
        ca.OP_FMIN: "sp.Min({a}, {b})",
        ca.OP_FMAX: "sp.Max({a}, {b})",
        ca.OP_LOG1P: "sp.log(1 + {a})",
        ca.OP_CEIL: "sp.ceiling({a})",
    },
)


def number(value: float) -> str:
    """Return a number as every dialect reads it back without loss."""
    text = repr(float(value))
    return text if value >= 0 else f"({text})"


def written(function: ca.Function, names: Sequence[str], dialect: Dialect) -> tuple[list[str], list[str]]:
    """Return the lines that compute a function, and its outputs as texts.

    ``names`` (n_in,) are the texts of all inputs, stacked in order.
    """
    tape = Tape.of(function)
    used = Counter(int(slot) for slot in (*_operands(tape), *tape.picks))
    texts = [*names, *(number(c) for c in tape.constants)]
    base, lines = len(texts), []
    for k, (op, a, b) in enumerate(zip(tape.op, tape.a, tape.b, strict=True)):
        if not used[base + k]:
            texts.append("")
            continue
        text = dialect.spelt(int(op), texts[a], texts[b])
        if used[base + k] > 1 or len(text) > MAX_INLINE_LENGTH:
            name = f"w{k}"
            lines.append(dialect.line.format(name=name, value=text))
            text = name
        texts.append(text)
    return lines, [texts[i] for i in tape.picks]


def _operands(tape: Tape) -> list[int]:
    """Return every slot that an instruction reads; an operation that spells an operand twice counts it twice."""
    twice = {ca.OP_SQ, ca.OP_SIGN, ca.OP_FMIN, ca.OP_FMAX}
    found: list[int] = []
    for op, a, b in zip(tape.op, tape.a, tape.b, strict=True):
        found += [int(a), int(b)] if a != b else [int(a)]
        if int(op) in twice:
            found += [int(a), int(b)]
    return found


__all__ = ["CASADI", "NUMPY", "SYMPY", "C", "Dialect", "number", "written"]
