"""A CasADi function as a flat list of instructions, and what each instruction means.

One table of operations serves three uses: blocks of points with NumPy (`Tape.batch`), scalar evaluation inside
compiled kernels (`signlin_ros.kernels`), and generated source. Instruction and work layout follow CasADi's virtual
machine, see ``Function.instruction_id``.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

OPERATIONS: dict[int, str] = {
    ca.OP_ASSIGN: "a",
    ca.OP_ADD: "a + b",
    ca.OP_SUB: "a - b",
    ca.OP_MUL: "a * b",
    ca.OP_DIV: "a / b",
    ca.OP_NEG: "-a",
    ca.OP_EXP: "np.exp(a)",
    ca.OP_LOG: "np.log(a)",
    ca.OP_POW: "np.power(a, b)",
    ca.OP_CONSTPOW: "np.power(a, b)",
    ca.OP_SQRT: "np.sqrt(a)",
    ca.OP_SQ: "a * a",
    ca.OP_TWICE: "a + a",
    ca.OP_SIN: "np.sin(a)",
    ca.OP_COS: "np.cos(a)",
    ca.OP_TAN: "np.tan(a)",
    ca.OP_ASIN: "np.arcsin(a)",
    ca.OP_ACOS: "np.arccos(a)",
    ca.OP_ATAN: "np.arctan(a)",
    ca.OP_ATAN2: "np.arctan2(a, b)",
    ca.OP_SINH: "np.sinh(a)",
    ca.OP_COSH: "np.cosh(a)",
    ca.OP_TANH: "np.tanh(a)",
    ca.OP_ASINH: "np.arcsinh(a)",
    ca.OP_ACOSH: "np.arccosh(a)",
    ca.OP_ATANH: "np.arctanh(a)",
    ca.OP_LT: "1.0 * (a < b)",
    ca.OP_LE: "1.0 * (a <= b)",
    ca.OP_EQ: "1.0 * (a == b)",
    ca.OP_NE: "1.0 * (a != b)",
    ca.OP_NOT: "1.0 * (a == 0.0)",
    ca.OP_AND: "1.0 * ((a != 0.0) & (b != 0.0))",
    ca.OP_OR: "1.0 * ((a != 0.0) | (b != 0.0))",
    ca.OP_FLOOR: "np.floor(a)",
    ca.OP_CEIL: "np.ceil(a)",
    ca.OP_FABS: "np.abs(a)",
    ca.OP_SIGN: "np.sign(a)",
    ca.OP_COPYSIGN: "np.copysign(a, b)",
    ca.OP_IF_ELSE_ZERO: "np.where(a != 0.0, b, 0.0)",
    ca.OP_FMIN: "np.minimum(a, b)",
    ca.OP_FMAX: "np.maximum(a, b)",
    ca.OP_FMOD: "np.fmod(a, b)",
    ca.OP_INV: "1.0 / a",
    ca.OP_LOG1P: "np.log1p(a)",
    ca.OP_EXPM1: "np.expm1(a)",
    ca.OP_HYPOT: "np.hypot(a, b)",
}
"""Every operation as a NumPy expression of its arguments a and b; Numba compiles the same text for scalars."""

BLOCK = 512
"""Points evaluated at a time: the work of a block stays in the processor's cache."""


@dataclass(frozen=True)
class Tape:
    """Instructions (K,) of a function of one input vector with one output vector.

    ``op``, ``a``, ``b``, ``out``: operation and work indices; ``constant``: the value of OP_CONST.
    For OP_INPUT ``a`` is the index in the input, for OP_OUTPUT ``out`` the index in the output.
    """

    op: NDArray[np.int64]
    a: NDArray[np.int64]
    b: NDArray[np.int64]
    out: NDArray[np.int64]
    constant: NDArray[np.float64]
    n_work: int
    n_in: int
    n_out: int

    @classmethod
    def of(cls, function: ca.Function) -> Tape:
        """Read the instructions of an SX function with dense arguments; several are stacked in order."""
        offsets_in = np.concatenate([[0], np.cumsum([function.numel_in(i) for i in range(function.n_in())])])
        offsets_out = np.concatenate([[0], np.cumsum([function.numel_out(i) for i in range(function.n_out())])])
        rows = [_instruction(function, k, offsets_in, offsets_out) for k in range(function.n_instructions())]
        op, a, b, out, constant = zip(*rows, strict=True)
        index = functools.partial(np.array, dtype=np.int64)
        sizes = (function.sz_w(), int(offsets_in[-1]), int(offsets_out[-1]))
        return cls(index(op), index(a), index(b), index(out), np.array(constant, dtype=float), *sizes)

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """What a compiled kernel needs."""
        return self.op, self.a, self.b, self.out, self.constant

    def batch(self, columns: list[Any]) -> NDArray[np.float64]:
        """Evaluate at many points: ``columns`` (n_in) of scalars or arrays (T,); returns (n_out, T)."""
        total = max((np.size(c) for c in columns), default=1)
        result = np.empty((self.n_out, total))
        with np.errstate(all="ignore"):
            for start in range(0, total, BLOCK):
                part = [c if np.ndim(c) == 0 else c[start : start + BLOCK] for c in columns]
                self._run(part, result[:, start : start + BLOCK])
        return result

    def _run(self, inputs: list[Any], result: NDArray[np.float64]) -> None:
        work: list[Any] = [0.0] * self.n_work
        for call, kind, a, b, out, constant in self._program:
            if kind == ca.OP_INPUT:
                work[out] = inputs[a]
            elif kind == ca.OP_CONST:
                work[out] = constant
            elif kind == ca.OP_OUTPUT:
                result[out] = work[a]
            else:
                work[out] = call(work[a], work[b])

    @functools.cached_property
    def _program(self) -> list[tuple[Any, ...]]:
        rows = zip(self.op, self.a, self.b, self.out, self.constant, strict=True)
        return [(_array_operation(int(o)), int(o), int(a), int(b), int(t), np.float64(c)) for o, a, b, t, c in rows]


def _instruction(
    function: ca.Function, k: int, offsets_in: NDArray[Any], offsets_out: NDArray[Any]
) -> tuple[int, int, int, int, float]:
    op = function.instruction_id(k)
    inputs, outputs = function.instruction_input(k), function.instruction_output(k)
    if op == ca.OP_CONST:
        return op, 0, 0, outputs[0], function.instruction_constant(k)
    if op == ca.OP_INPUT:
        return op, int(offsets_in[inputs[0]]) + inputs[1], 0, outputs[0], 0.0
    if op == ca.OP_OUTPUT:
        return op, inputs[0], 0, int(offsets_out[outputs[0]]) + outputs[1], 0.0
    if op not in OPERATIONS:
        raise NotImplementedError(f"CasADi operation {op} is not in signlin_ros.tape.OPERATIONS")
    return op, inputs[0], inputs[-1], outputs[0], 0.0


@functools.cache
def _array_operation(op: int) -> Callable[[Any, Any], Any] | None:
    text = OPERATIONS.get(op)
    return eval(f"lambda a, b: {text}", {"np": np}) if text else None
