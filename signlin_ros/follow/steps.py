"""Machine code of what `signlin_ros.follow.loop` does in a step, written out for one structure.

Runge and Kutta's method of order 4 with the model's equations in it, free or stuck to the surface; how fast the motion
is; and the trapezoidal rule for sensitivities, for one pattern of zeros:
(I - diag(late) J1) S1 = S0 + diag(early) (J0 S0 + P0) + diag(late) P1 is solved by Gauss' elimination without pivots
(late J1 is small), of which only what the patterns of J and P leave is written: four columns at a time, as vectors.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from signlin_ros.engine.native import Lines, Writer
from signlin_ros.engine.tape import Tape

Pattern = NDArray[np.bool_]

LANES = 4
"""Columns that are carried together."""
_VECTOR = f"<{LANES} x double>"
_SIGNATURE = "double* noalias %first, double* noalias %last, double* noalias %S, double* noalias %step"


def padded(count: int) -> int:
    """Return how many columns hold ``count``: a multiple of `LANES`."""
    return -(-count // LANES) * LANES


class _Vectors(Lines):
    """Writes the body of a function that works on vectors too."""

    def columns(self, pointer: str, index: int) -> str:
        place = self.new(f"bitcast double* {self.place(pointer, index)} to {_VECTOR}*")
        return self.new(f"load {_VECTOR}, {_VECTOR}* {place}, align 8")

    def store(self, value: str, pointer: str, index: int) -> None:
        place = self.new(f"bitcast double* {self.place(pointer, index)} to {_VECTOR}*")
        self.lines.append(f"  store {_VECTOR} {value}, {_VECTOR}* {place}, align 8")

    def times(self, a: str, b: str) -> str:
        return self.new(f"fmul double {a}, {b}")

    def sum(self, a: str, b: str) -> str:
        return self.new(f"fadd double {a}, {b}") if a else b

    def negated(self, a: str) -> str:
        return self.new(f"fneg double {a}")

    def everywhere(self, a: str) -> str:
        one = self.new(f"insertelement {_VECTOR} undef, double {a}, i32 0")
        return self.new(f"shufflevector {_VECTOR} {one}, {_VECTOR} undef, <{LANES} x i32> zeroinitializer")

    def scaled(self, a: str, b: str) -> str:
        return self.new(f"fmul {_VECTOR} {a}, {b}")

    def summed(self, a: str, b: str, total: str) -> str:
        three = f"{_VECTOR} {a}, {_VECTOR} {b}, {_VECTOR} {total}"
        return self.new(f"call {_VECTOR} @llvm.fmuladd.v{LANES}f64({three})")

    def text(self, name: str) -> str:
        body = "\n".join(self.lines)
        return f"define void @{name}({_SIGNATURE}) {{\nentry:\n{body}\n  ret void\n}}\n"


DECLARED = (
    f"declare {_VECTOR} @llvm.fmuladd.v{LANES}f64({_VECTOR}, {_VECTOR}, {_VECTOR})",
    "declare double @llvm.fabs.f64(double)",
)
"""What the functions of this module call."""


def carrier(name: str, J: Pattern, P: Pattern) -> str:
    """Return the function ``name`` of (first, last, S, step) that carries S (n, width) over a step, in place.

    ``first`` and ``last`` hold dF/dx (n, n), then dF/dp (n, width), of the step's two ends, which are 0 where J (n, n)
    and P (n, width) are False; ``step`` (2, n): the parts of the step that count for the first and for the last.
    """
    w, (n, width) = _Vectors(), P.shape
    early, late = ([w.number("%step", i + k * n) for i in range(n)] for k in (0, 1))
    lower, upper, inverse = _eliminated(w, J, late)
    led = {(i, j): w.everywhere(w.times(early[i], w.number("%first", i * n + j))) for i, j in np.argwhere(J).tolist()}
    parts = [w.everywhere(e) for e in early], [w.everywhere(e) for e in late]
    for b in range(0, width, LANES):
        S = [w.columns("%S", i * width + b) for i in range(n)]
        R = list(S)
        for i in range(n):
            if P[i, b : b + LANES].any():
                for part, source in zip(parts, ("%first", "%last"), strict=True):
                    R[i] = w.summed(part[i], w.columns(source, n * n + i * width + b), R[i])
            for j in range(n):
                if J[i, j]:
                    R[i] = w.summed(led[i, j], S[j], R[i])
            for k in range(i):
                if (i, k) in lower:
                    R[i] = w.summed(lower[i, k], R[k], R[i])
        for i in range(n - 1, -1, -1):
            for j in range(i + 1, n):
                if (i, j) in upper:
                    R[i] = w.summed(upper[i, j], R[j], R[i])
            if i in inverse:
                R[i] = w.scaled(inverse[i], R[i])
            w.store(R[i], "%S", i * width + b)
    return w.text(name)


def _eliminated(
    w: _Vectors, J: Pattern, late: list[str]
) -> tuple[dict[tuple[int, int], str], dict[tuple[int, int], str], dict[int, str]]:
    """Factor I - diag(late) J: negated factors below and above the diagonal, and the inverse of what is on it if not 1.

    Each as a vector of one number.
    """
    n, M = J.shape[0], dict[tuple[int, int], str]()
    for i, j in np.argwhere(J).tolist():
        M[i, j] = w.negated(w.times(late[i], w.number("%last", i * n + j)))
    for i in range(n):
        if (i, i) in M:
            M[i, i] = w.new(f"fadd double {M[i, i]}, 1.0")
    lower, inverse = dict[tuple[int, int], str](), dict[int, str]()
    for k in range(n):
        if (k, k) in M:
            inverse[k] = w.new(f"fdiv double 1.0, {M[k, k]}")
        for i in range(k + 1, n):
            if (i, k) not in M:
                continue
            factor = w.negated(w.times(M[i, k], inverse[k]) if k in inverse else M[i, k])
            lower[i, k] = factor
            for j in range(k + 1, n):
                if (k, j) in M:
                    change = w.times(factor, M[k, j])
                    known = M.get((i, j), "1.0" if i == j else "")
                    M[i, j] = w.new(f"fadd double {known}, {change}") if known else change
    upper = {(i, j): w.everywhere(w.negated(M[i, j])) for i, j in M if j > i}
    return {at: w.everywhere(f) for at, f in lower.items()}, upper, {k: w.everywhere(v) for k, v in inverse.items()}


def seen(name: str, H: Pattern, P: Pattern, at: tuple[int, int]) -> str:
    """Return the function ``name`` of (out, D, S, _) that fills D (ny, width) with -(dh/dp + dh/dx S).

    dh/dx (ny, n) and dh/dp (ny, width) stand in ``out`` from ``at`` on; they are 0 where H and P are False.
    """
    w = _Vectors()
    n, width, blocks = H.shape[1], P.shape[1], range(0, P.shape[1], LANES)
    rows = {i: [w.columns("%S", i * width + b) for b in blocks] for i in np.flatnonzero(H.any(axis=0))}
    for c, (shown, known) in enumerate(zip(H, P, strict=True)):
        led = {i: w.everywhere(w.negated(w.number("%first", at[0] + c * n + i))) for i in np.flatnonzero(shown)}
        for k, b in enumerate(blocks):
            row = f"<{', '.join(['double 0.0'] * LANES)}>"
            if known[b : b + LANES].any():
                row = w.new(f"fneg {_VECTOR} {w.columns('%first', at[1] + c * width + b)}")
            for i, factor in led.items():
                row = w.summed(factor, rows[i][k], row)
            w.store(row, "%last", c * width + b)
    return w.text(name)


def corrected(name: str, n: int, ny: int, width: int) -> str:
    """Return the function ``name`` of (K, D, S, _) that adds K D to S (n, width), K being (n, ny)."""
    w = _Vectors()
    gains = [[w.everywhere(w.number("%first", i * ny + c)) for c in range(ny)] for i in range(n)]
    for b in range(0, width, LANES):
        rows = [w.columns("%last", c * width + b) for c in range(ny)]
        for i in range(n):
            total = w.columns("%S", i * width + b)
            for gain, row in zip(gains[i], rows, strict=True):
                total = w.summed(gain, row, total)
            w.store(total, "%S", i * width + b)
    return w.text(name)


def pace(name: str, J: Pattern, lasting: Sequence[int]) -> str:
    """Return the function ``name`` of (J, ratio, result, _): the largest row sum of |J^2| times ratio (n, n).

    result (2): that of J (n, n), and that of what it has of the states ``lasting``.
    """
    w, n = _Vectors(), J.shape[0]
    entries = {(i, j): w.number("%first", i * n + j) for i, j in np.argwhere(J).tolist()}
    ratios = {(i, j): w.number("%last", i * n + j) for i in range(n) for j in range(n)}
    for place, states in enumerate((range(n), lasting)):
        worst = "0.0"
        for i in states:
            row = ""
            for j in states:
                square = ""
                for k in states:
                    if (i, k) in entries and (k, j) in entries:
                        square = w.sum(square, w.times(entries[i, k], entries[k, j]))
                if square:
                    size = w.new(f"call double @llvm.fabs.f64(double {square})")
                    row = w.sum(row, w.times(size, ratios[i, j]))
            if row:
                more = w.new(f"fcmp ogt double {row}, {worst}")
                worst = w.new(f"select i1 {more}, double {row}, double {worst}")
        w.lines.append(f"  store double {worst}, double* {w.place('%S', place)}")
    return w.text(name)


def runge_kutta(name: str, tape: Tape, n: int, stuck: bool) -> tuple[str, set[str]]:
    """Return the function ``name`` of (z, x, k, step) that leaves in z the state x (n) a step later, and what it calls.

    z holds the inputs of the model's equations ``tape``, k (n) the slope at x, step[0] how long the step is. ``stuck``:
    the sign of the surface is at each stage what holds the motion to it.
    """
    w = Writer(tape)

    def two(kind: str, a: str, b: str) -> str:
        return w.new(f"{kind} double {a}, {b}")

    x, k, h = [w.number("%last", i) for i in range(n)], [w.number("%S", i) for i in range(n)], w.number("%step", 0)
    half, sixth = two("fmul", h, "0.5"), two("fdiv", h, "6.0")
    last = tape.n_in - 1
    slopes = [k]
    for part in (half, half, h):
        z = {i: two("fadd", x[i], two("fmul", part, f)) for i, f in enumerate(slopes[-1])}
        if not stuck:
            slopes.append(w.results(z, range(n)))
            continue
        held = w.results({**z, last: "0.0"}, range(2 * n + 3))
        s = two("fdiv", w.new(f"fneg double {held[n + 1]}"), held[2 * n + 2])
        slopes.append([two("fadd", held[i], two("fmul", held[n + 2 + i], s)) for i in range(n)])
    for i, (a, b, c, d) in enumerate(zip(*slopes, strict=True)):
        total = two("fadd", a, two("fmul", "2.0", b))
        total = two("fadd", two("fadd", total, two("fmul", "2.0", c)), d)
        place = w.place("%first", i)
        w.lines.append(f"  store double {two('fadd', x[i], two('fmul', sixth, total))}, double* {place}")
    body = "\n".join(w.lines).replace("double* %in,", "double* %first,")
    return f"define void @{name}({_SIGNATURE}) {{\nentry:\n{body}\n  ret void\n}}\n", w.declared


__all__ = ["DECLARED", "LANES", "carrier", "corrected", "pace", "padded", "runge_kutta", "seen"]
