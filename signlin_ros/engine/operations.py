"""The operations that CasADi records, each spelt once: signs between two operands, and functions by their names in C.

What interprets a recorded function (`signlin_ros.engine.tape`), translates it (`signlin_ros.engine.native`) or writes
it down in a language (`signlin_ros.export.lines`) takes them from here, and says itself only where it differs.
"""

from __future__ import annotations

import casadi as ca

INFIX = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
"""Signs between two numbers."""
COMPARISONS = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!="}
"""Signs between two numbers, whose result is 1 or 0."""
ONE = {
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
    ca.OP_FABS: "fabs",
    ca.OP_LOG1P: "log1p",
    ca.OP_EXPM1: "expm1",
}
"""Functions of one argument, by their names in C's math.h."""
TWO = {
    ca.OP_POW: "pow",
    ca.OP_CONSTPOW: "pow",
    ca.OP_ATAN2: "atan2",
    ca.OP_FMOD: "fmod",
    ca.OP_COPYSIGN: "copysign",
    ca.OP_HYPOT: "hypot",
}
"""Functions of two."""
_NUMPY_NAMES = {
    **{f"a{name}{h}": f"arc{name}{h}" for name in ("sin", "cos", "tan") for h in ("", "h")},
    "atan2": "arctan2",
    "pow": "power",
    "fabs": "abs",
}
NUMPY = {
    ca.OP_ASSIGN: "a",
    ca.OP_NEG: "-a",
    ca.OP_SQ: "a * a",
    ca.OP_TWICE: "a + a",
    ca.OP_INV: "1.0 / a",
    **{op: f"a {sign} b" for op, sign in INFIX.items()},
    **{op: f"1.0 * (a {sign} b)" for op, sign in COMPARISONS.items()},
    **{op: f"np.{_NUMPY_NAMES.get(name, name)}(a)" for op, name in ONE.items()},
    **{op: f"np.{_NUMPY_NAMES.get(name, name)}(a, b)" for op, name in TWO.items()},
    ca.OP_NOT: "1.0 * (a == 0.0)",
    ca.OP_AND: "1.0 * ((a != 0.0) & (b != 0.0))",
    ca.OP_OR: "1.0 * ((a != 0.0) | (b != 0.0))",
    ca.OP_SIGN: "np.sign(a)",
    ca.OP_IF_ELSE_ZERO: "np.where(a != 0.0, b, 0.0)",
    ca.OP_FMIN: "np.minimum(a, b)",
    ca.OP_FMAX: "np.maximum(a, b)",
}
"""Every operation as a NumPy expression of its arguments a and b: what it means."""

__all__ = ["COMPARISONS", "INFIX", "NUMPY", "ONE", "TWO"]
