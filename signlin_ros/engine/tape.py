"""A CasADi function as a flat list of instructions, and what each instruction means.

`Tape.batch` runs it on blocks of points with NumPy, by the table of operations in here; `signlin_ros.engine.native`
turns it into machine code for compiled kernels (`signlin_ros.engine.exact` and others). Instructions are read from
CasADi's virtual machine, see ``Function.instruction_id``.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterable
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
"""Every operation as a NumPy expression of its arguments a and b: what it means."""

POINTS_PER_BLOCK = 1024
"""Points evaluated at a time: the work of a block stays in the processor's cache."""


@dataclass(frozen=True)
class Tape:
    """Instructions of a function of one input vector with one output vector, in single-assignment form.

    A work slot is written once: first come the inputs, then the constants, then one result for each instruction,
    ``op``, ``a``, ``b`` (K,) being the operation and its two slots. ``picks`` (n_out,) says which slots are the
    outputs; the first ``n_head`` of them are wanted alone, too.
    """

    op: NDArray[np.int64]
    a: NDArray[np.int64]
    b: NDArray[np.int64]
    constants: NDArray[np.float64]
    picks: NDArray[np.int64]
    n_in: int
    n_head: int

    @classmethod
    def of(cls, function: ca.Function, n_head: int | None = None) -> Tape:
        """Read the instructions of an SX function with dense arguments; several are stacked in order."""
        rows, constants, picks = _read(function)
        n_in = sum(function.numel_in(i) for i in range(function.n_in()))
        op, a, b = np.array(rows, dtype=np.int64).reshape(-1, 3).T.copy()
        head = len(picks) if n_head is None else n_head
        return cls(op, a, b, np.array(constants, dtype=float), np.array(picks, dtype=np.int64), n_in, head)

    @property
    def n_out(self) -> int:
        """Number of outputs."""
        return self.picks.size

    def batch(self, columns: list[Any]) -> NDArray[np.float64]:
        """Evaluate at many points: ``columns`` (n_in) of scalars or arrays (T,); returns (n_out, T)."""
        sizes = [np.size(c) for c in columns]
        total = max(sizes, default=1)
        result = np.empty((self.n_out, total))
        with np.errstate(all="ignore"):
            for start in range(0, total, POINTS_PER_BLOCK):
                part = [
                    c if n == 1 else c[start : start + POINTS_PER_BLOCK] for c, n in zip(columns, sizes, strict=True)
                ]
                self._run(part, result[:, start : start + POINTS_PER_BLOCK])
        return result

    def _run(self, inputs: list[Any], result: NDArray[np.float64]) -> None:
        work = [*inputs, *self.constants]
        for call, a, b, done in self._program:
            work.append(call(work[a], work[b]))
            for slot in done:  # memory still in the cache is used again at once
                work[slot] = None
        for row, slot in enumerate(self.picks):
            result[row] = work[slot]

    @functools.cached_property
    def _program(self) -> list[tuple[Callable[[Any, Any], Any], int, int, list[int]]]:
        """Return the instructions with the slots that nothing needs after each."""
        last = {int(slot): k for k in range(self.op.size) for slot in (self.a[k], self.b[k])}
        done: list[list[int]] = [[] for _ in range(self.op.size)]
        for slot, k in last.items():
            if slot not in self.picks:
                done[k].append(slot)
        rows = zip(self.op, self.a, self.b, done, strict=True)
        return [(_array_operation(int(op)), int(a), int(b), slots) for op, a, b, slots in rows]


def _offsets(sizes: Iterable[int]) -> list[int]:
    return [0, *itertools.accumulate(sizes)]


def _read(function: ca.Function) -> tuple[list[tuple[int, int, int]], list[float], list[int]]:
    """Return instructions (op, slot, slot), constants and the outputs' slots, renaming CasADi's re-used work.

    Slots: inputs, then constants, then one for each instruction.
    """
    into = _offsets(function.numel_in(i) for i in range(function.n_in()))
    out = _offsets(function.numel_out(i) for i in range(function.n_out()))
    count = range(function.n_instructions())
    constants = [function.instruction_constant(k) for k in count if function.instruction_id(k) == ca.OP_CONST]
    holds, rows, picks, seen = {}, [], [0] * out[-1], 0
    for k in count:
        op, inputs, outputs = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        if op == ca.OP_INPUT:
            holds[outputs[0]] = into[inputs[0]] + inputs[1]
        elif op == ca.OP_CONST:
            holds[outputs[0]] = into[-1] + seen
            seen += 1
        elif op == ca.OP_OUTPUT:
            picks[out[outputs[0]] + outputs[1]] = holds[inputs[0]]
        elif op in OPERATIONS:
            rows.append((op, holds[inputs[0]], holds[inputs[-1]]))
            holds[outputs[0]] = into[-1] + len(constants) + len(rows) - 1
        else:
            raise NotImplementedError(f"CasADi operation {op} is not in signlin_ros.engine.tape.OPERATIONS")
    return rows, constants, picks


@functools.cache
def _array_operation(op: int) -> Callable[[Any, Any], Any]:
    """Return an operation on arrays; the text is of the table above."""
    function: Callable[[Any, Any], Any] = eval(f"lambda a, b: {OPERATIONS[op]}", {"np": np})
    return function
