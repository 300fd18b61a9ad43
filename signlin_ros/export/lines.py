"""A recorded function as lines of a language: C, Python, CasADi's Python or SymPy's, all from the same tape.

Nothing of a law is written here: `signlin_ros.engine.tape.Tape` holds the operations that were recorded, and a
`Dialect` says how each is spelt.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import casadi as ca

from signlin_ros.engine.operations import COMPARISONS, INFIX, ONE, TWO
from signlin_ros.engine.operations import NUMPY as OPERATIONS
from signlin_ros.engine.tape import Tape

MAX_INLINE_LENGTH = 60
"""An expression that is used once is written where it is used, if it is no longer than so many letters."""


@dataclass(frozen=True)
class Dialect:
    """How a language spells the operations.

    ``prefix`` of functions, ``own`` templates of ``{a}`` and ``{b}`` for what is spelt in another
    way, ``line`` the template of an assignment.
    """

    prefix: str
    line: str
    own: Mapping[int, str] = field(default_factory=dict)

    def spelt(self, op: int, a: str, b: str) -> str:
        """Return one operation on two texts."""
        if op in self.own:
            return self.own[op].format(a=a, b=b)
        if op in INFIX:
            return f"({a} {INFIX[op]} {b})"
        if op in ONE:
            return f"{self.prefix}{ONE[op]}({a})"
        if op in TWO:
            return f"{self.prefix}{TWO[op]}({a}, {b})"
        if op in COMPARISONS:
            return f"({a} {COMPARISONS[op]} {b})"
        plain = {ca.OP_ASSIGN: a, ca.OP_NEG: f"(-{a})", ca.OP_SQ: f"({a} * {a})", ca.OP_TWICE: f"(2.0 * {a})"}
        if op in plain:
            return plain[op]
        if op == ca.OP_INV:
            return f"(1.0 / {a})"
        raise NotImplementedError(f"CasADi operation {op}")


C = Dialect(
    "",
    "const double {name} = {value};",
    {op: f"({{a}} {sign} {{b}} ? 1.0 : 0.0)" for op, sign in COMPARISONS.items()}
    | {
        ca.OP_NOT: "({a} == 0.0 ? 1.0 : 0.0)",
        ca.OP_AND: "({a} != 0.0 && {b} != 0.0 ? 1.0 : 0.0)",
        ca.OP_OR: "({a} != 0.0 || {b} != 0.0 ? 1.0 : 0.0)",
        ca.OP_IF_ELSE_ZERO: "({a} != 0.0 ? {b} : 0.0)",
        ca.OP_SIGN: "(({a} > 0.0) - ({a} < 0.0))",
        ca.OP_FMIN: "({a} < {b} ? {a} : {b})",
        ca.OP_FMAX: "({a} > {b} ? {a} : {b})",
    },
)


def _template(text: str) -> str:
    """Return an expression of NumPy's as a template of ``{a}`` and ``{b}``."""
    return re.sub(r"\b([ab])\b", r"{\1}", text if text.startswith("np.") else f"({text})")


_POWERS = dict.fromkeys((ca.OP_POW, ca.OP_CONSTPOW), "({a} ** {b})")
NUMPY_DIALECT = Dialect(
    "np.",
    "{name} = {value}",
    {op: _template(text) for op, text in OPERATIONS.items()} | _POWERS,
)
CASADI = Dialect(
    "ca.",
    "{name} = {value}",
    _POWERS
    | {
        ca.OP_NOT: "ca.logic_not({a})",
        ca.OP_AND: "ca.logic_and({a}, {b})",
        ca.OP_OR: "ca.logic_or({a}, {b})",
        ca.OP_IF_ELSE_ZERO: "ca.if_else({a}, {b}, 0)",
        ca.OP_SIGN: "ca.sign({a})",
        ca.OP_FMIN: "ca.fmin({a}, {b})",
        ca.OP_FMAX: "ca.fmax({a}, {b})",
    },
)
SYMPY = Dialect(
    "sp.",
    "{name} = {value}",
    _POWERS
    | {
        ca.OP_LT: "_holds({a} < {b})",
        ca.OP_LE: "_holds({a} <= {b})",
        ca.OP_EQ: "_holds(sp.Eq({a}, {b}))",
        ca.OP_NE: "_holds(sp.Ne({a}, {b}))",
        ca.OP_NOT: "_holds(sp.Eq({a}, 0))",
        ca.OP_IF_ELSE_ZERO: "sp.Piecewise(({b}, sp.Ne({a}, 0)), (0, True))",
        ca.OP_FABS: "sp.Abs({a})",
        ca.OP_SIGN: "sp.sign({a})",
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


__all__ = ["CASADI", "NUMPY_DIALECT", "SYMPY", "C", "Dialect", "number", "written"]
