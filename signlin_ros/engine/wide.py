"""Machine code that evaluates a tape at many points, four at a time in the processor's vector registers.

What depends on constants alone is worked out once, before the loop. The lines are those of `signlin_ros.engine.native`,
with vectors of four numbers for numbers; a function for which processors have no instruction is called four times.
"""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from signlin_ros.engine.native import Writer, translated
from signlin_ros.engine.tape import Tape

Array = NDArray[np.float64]
LANES = 4
_VECTOR, _FLAGS = f"<{LANES} x double>", f"<{LANES} x i1>"
_LITERAL = re.compile(r"0x[0-9A-F]{16}")
_CALL = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4, ctypes.c_int64)


def _varying(tape: Tape, count: int) -> NDArray[np.bool_]:
    """Tell which slots depend on the first ``count`` inputs."""
    base = tape.n_in + tape.constants.size
    found = np.zeros(base + tape.op.size, dtype=bool)
    found[:count] = True
    for k, (a, b) in enumerate(zip(tape.a, tape.b, strict=True)):
        found[base + k] = found[a] or found[b]
    return found


class _Once(Writer):
    """Writes what stands before the loop, in numbers."""

    def __init__(self, tape: Tape, count: int) -> None:
        super().__init__(tape)
        self.first = count

    def number(self, pointer: str, index: int) -> str:
        return super().number("%constants", index - self.first)


class WideWriter(Writer):
    """Writes a tape as a loop over points: ``count`` inputs come from x and u, the others are the same everywhere."""

    def __init__(self, tape: Tape, widths: tuple[int, int]) -> None:
        super().__init__(tape)
        self.widths = widths
        self.once = _Once(tape, sum(widths))
        self.varying = _varying(tape, sum(widths))
        self.spread: dict[str, str] = {}

    # ---------------------------------------------------------------- the lines

    def new(self, text: str) -> str:
        """Write one instruction for all lanes; returns the name of its result."""
        text = re.sub(r"\bi1\b", _FLAGS, re.sub(r"\bdouble\b", _VECTOR, text))
        return self.plain(_LITERAL.sub(lambda found: f"<{', '.join([f'double {found[0]}'] * LANES)}>", text))

    def plain(self, text: str) -> str:
        """Write one instruction as it stands; returns the name of its result."""
        self.count += 1
        self.lines.append(f"  %w{self.count} = {text}")
        return f"%w{self.count}"

    def _call(self, name: str, *arguments: str) -> str:
        if name.startswith("llvm."):
            wide = f"{name.removesuffix('.f64')}.v{LANES}f64"
            self.declared.add(f"declare {_VECTOR} @{wide}({', '.join([_VECTOR] * len(arguments))})")
            return self.new(f"call double @{wide}({', '.join(f'double {a}' for a in arguments)})")
        self.declared.add(f"declare double @{name}({', '.join(['double'] * len(arguments))})")
        lanes = []
        for lane in range(LANES):
            given = ", ".join(f"double {self._lane(a, lane)}" for a in arguments)
            lanes.append(self.plain(f"call double @{name}({given})"))
        return self._joined(lanes)

    def _lane(self, value: str, lane: int) -> str:
        return value if value.startswith("0x") else self.plain(f"extractelement {_VECTOR} {value}, i32 {lane}")

    def _joined(self, lanes: list[str]) -> str:
        vector = "undef"
        for lane, value in enumerate(lanes):
            vector = self.plain(f"insertelement {_VECTOR} {vector}, double {value}, i32 {lane}")
        return vector

    # ---------------------------------------------------------------- slots

    def _slot(self, index: int) -> str:
        if not self.varying[index]:
            return self._spread(self.once._slot(index))
        if index not in self.slots:
            self.slots[index] = self._joined(self._loaded(index))
        return self.slots[index]

    def _loaded(self, index: int) -> list[str]:
        n, m = self.widths
        pointer, at, width = ("%x", index, n) if index < n else ("%u", index - n, m)
        places = [f"getelementptr double, double* {pointer}k, i64 {lane * width + at}" for lane in range(LANES)]
        return [self.plain(f"load double, double* {self.plain(place)}") for place in places]

    def _spread(self, value: str) -> str:
        """Return the vector of a number from before the loop."""
        if value.startswith("0x"):
            return value
        if value not in self.spread:
            one = self.once.new(f"insertelement {_VECTOR} undef, double {value}, i32 0")
            zeros = f"<{LANES} x i32> zeroinitializer"
            self.spread[value] = self.once.new(f"shufflevector {_VECTOR} {one}, {_VECTOR} undef, {zeros}")
        return self.spread[value]

    # ---------------------------------------------------------------- the function

    def loop(self, name: str) -> str:
        """Return the function ``name`` of (x, u, constants, results, blocks of four points), all row-major."""
        base = self.tape.n_in + self.tape.constants.size
        for k, (op, a, b) in enumerate(zip(self.tape.op, self.tape.a, self.tape.b, strict=True)):
            place = self if self.varying[base + k] else self.once
            place.slots[base + k] = place.value(int(op), place._slot(int(a)), place._slot(int(b)))
        self._store()
        n, m = self.widths
        sizes = (("x", n), ("u", m), ("out", self.tape.n_out))
        steps = [f"  %{p}k = getelementptr double, double* %{p}, i64 %{p}a" for p, _ in sizes]
        steps = [f"  %{p}a = mul i64 %k, {LANES * size}" for p, size in sizes] + steps
        lines = [
            f"define void @{name}(double* %x, double* %u, double* %constants, double* noalias %out, i64 %blocks) {{",
            *("entry:", *self.once.lines, "  br label %loop"),
            *("loop:", "  %k = phi i64 [ 0, %entry ], [ %next, %loop ]", *steps, *self.lines),
            *("  %next = add i64 %k, 1", "  %more = icmp slt i64 %next, %blocks"),
            *("  br i1 %more, label %loop, label %end", "end:", "  ret void", "}"),
        ]
        return "\n".join([*sorted(self.declared | self.once.declared), *lines]) + "\n"

    def _store(self) -> None:
        for i, slot in enumerate(int(slot) for slot in self.tape.picks):
            value = self._slot(slot) if self.varying[slot] else self.once._slot(slot)
            for lane in range(LANES):
                number = self._lane(value, lane) if self.varying[slot] else value
                place = self.plain(f"getelementptr double, double* %outk, i64 {lane * self.tape.n_out + i}")
                self.lines.append(f"  store double {number}, double* {place}")


def at_points(tape: Tape, widths: tuple[int, int], constants: Array) -> Callable[[Array, Array, Array], None]:
    """Return a function that fills results (T, n_out) of a tape of x (n), u (m) and constants, from x (T, n), u (T, m).

    ``widths`` are n and m; the arrays must be contiguous.
    """
    (address,) = translated(WideWriter(tape, widths).loop("tape_many"), ("many",))
    function = _CALL(address)

    def run(x: Array, u: Array, results: Array) -> None:
        whole = len(x) - len(x) % LANES
        if whole:
            function(x.ctypes.data, u.ctypes.data, constants.ctypes.data, results.ctypes.data, whole // LANES)
        if whole < len(x):
            rest = slice(whole, None)
            last = [np.zeros((LANES, array.shape[1])) for array in (x, u, results)]
            for part, array in zip(last[:2], (x, u), strict=True):
                part[: len(x) - whole] = array[rest]
            function(*(a.ctypes.data for a in (*last[:2], constants, last[2])), 1)
            results[rest] = last[2][: len(x) - whole]

    return run
