"""A CasADi function as a flat list of instructions.

`Tape.batch` runs it on blocks of points with NumPy, by `signlin_ros.engine.operations`; `signlin_ros.engine.native`
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

from signlin_ros.engine.operations import NUMPY

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
        elif op in NUMPY:
            rows.append((op, holds[inputs[0]], holds[inputs[-1]]))
            holds[outputs[0]] = into[-1] + len(constants) + len(rows) - 1
        else:
            raise NotImplementedError(f"CasADi operation {op} is not in signlin_ros.engine.tape.NUMPY")
    return rows, constants, picks


@functools.cache
def _array_operation(op: int) -> Callable[[Any, Any], Any]:
    """Return an operation on arrays; the text is of the table above."""
    function: Callable[[Any, Any], Any] = eval(f"lambda a, b: {NUMPY[op]}", {"np": np})
    return function
