"""Machine code for tapes: a recorded function becomes native code in milliseconds, without a compiler.

`signlin_ros.tape.Tape` is a straight line of scalar operations. `native` writes it as LLVM intermediate code and lets
the LLVM that comes with Numba translate it; compiled kernels call the result through its address (`call`). A kernel
is thus compiled once per machine and serves every model, at the speed of code written for that model.
"""

# Numba and llvmlite carry no types.
# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="misc"

from __future__ import annotations

import functools
import hashlib
import os
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi as ca
import llvmlite.binding as llvm
import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from signlin_ros.tape import Tape

_PLAIN = {ca.OP_ADD: "fadd", ca.OP_SUB: "fsub", ca.OP_MUL: "fmul", ca.OP_DIV: "fdiv"}
_COMPARE = {ca.OP_LT: "olt", ca.OP_LE: "ole", ca.OP_EQ: "oeq", ca.OP_NE: "une"}
_INTRINSIC = {
    ca.OP_EXP: "exp",
    ca.OP_LOG: "log",
    ca.OP_SQRT: "sqrt",
    ca.OP_SIN: "sin",
    ca.OP_COS: "cos",
    ca.OP_FLOOR: "floor",
    ca.OP_CEIL: "ceil",
    ca.OP_FABS: "fabs",
    ca.OP_POW: "pow",
    ca.OP_CONSTPOW: "pow",
    ca.OP_COPYSIGN: "copysign",
    ca.OP_FMIN: "minnum",
    ca.OP_FMAX: "maxnum",
}
_LIBRARY = {
    ca.OP_TAN: "tan",
    ca.OP_ASIN: "asin",
    ca.OP_ACOS: "acos",
    ca.OP_ATAN: "atan",
    ca.OP_ATAN2: "atan2",
    ca.OP_SINH: "sinh",
    ca.OP_COSH: "cosh",
    ca.OP_TANH: "tanh",
    ca.OP_ASINH: "asinh",
    ca.OP_ACOSH: "acosh",
    ca.OP_ATANH: "atanh",
    ca.OP_FMOD: "fmod",
    ca.OP_LOG1P: "log1p",
    ca.OP_EXPM1: "expm1",
    ca.OP_HYPOT: "hypot",
}
_TWO = {ca.OP_POW, ca.OP_CONSTPOW, ca.OP_COPYSIGN, ca.OP_FMIN, ca.OP_FMAX, ca.OP_ATAN2, ca.OP_FMOD, ca.OP_HYPOT}


def _literal(value: float) -> str:
    return f"0x{struct.unpack('>Q', struct.pack('>d', value))[0]:016X}"


class _Writer:
    """Writes one tape as the body of a function of two pointers."""

    def __init__(self, tape: Tape) -> None:
        self.tape = tape
        self.lines: list[str] = []
        self.declared: set[str] = set()
        self.count = 0
        self.slots: dict[int, str] = {tape.n_in + i: _literal(float(v)) for i, v in enumerate(tape.constants)}

    def _new(self, text: str) -> str:
        self.count += 1
        self.lines.append(f"  %v{self.count} = {text}")
        return f"%v{self.count}"

    def _call(self, name: str, *arguments: str) -> str:
        kinds = ", ".join(["double"] * len(arguments))
        self.declared.add(f"declare double @{name}({kinds})")
        return self._new(f"call double @{name}({', '.join(f'double {a}' for a in arguments)})")

    def _flag(self, kind: str, a: str, b: str) -> str:
        return self._new(f"fcmp {kind} double {a}, {b}")

    def _number(self, flag: str) -> str:
        return self._new(f"uitofp i1 {flag} to double")

    def _truth(self, op: int, a: str, b: str) -> str:
        zero = _literal(0.0)
        first = self._flag("une", a, zero)
        if op == ca.OP_NOT:
            return self._number(self._flag("oeq", a, zero))
        if op == ca.OP_IF_ELSE_ZERO:
            return self._new(f"select i1 {first}, double {b}, double {zero}")
        word = "and" if op == ca.OP_AND else "or"
        return self._number(self._new(f"{word} i1 {first}, {self._flag('une', b, zero)}"))

    def value(self, op: int, a: str, b: str) -> str:
        """Write one operation; returns the name of its result."""
        if op in _PLAIN:
            return self._new(f"{_PLAIN[op]} double {a}, {b}")
        if op in _COMPARE:
            return self._number(self._flag(_COMPARE[op], a, b))
        if op in _INTRINSIC:
            return self._call(f"llvm.{_INTRINSIC[op]}.f64", *((a, b) if op in _TWO else (a,)))
        if op in _LIBRARY:
            return self._call(_LIBRARY[op], *((a, b) if op in _TWO else (a,)))
        return self._rest(op, a, b)

    def _rest(self, op: int, a: str, b: str) -> str:
        if op == ca.OP_ASSIGN:
            return a
        if op == ca.OP_NEG:
            return self._new(f"fneg double {a}")
        if op in (ca.OP_SQ, ca.OP_TWICE):
            return self._new(f"{'fmul' if op == ca.OP_SQ else 'fadd'} double {a}, {a}")
        if op == ca.OP_INV:
            return self._new(f"fdiv double {_literal(1.0)}, {a}")
        if op == ca.OP_SIGN:
            up, down = self._flag("ogt", a, _literal(0.0)), self._flag("olt", a, _literal(0.0))
            return self._new(f"fsub double {self._number(up)}, {self._number(down)}")
        if op in (ca.OP_NOT, ca.OP_AND, ca.OP_OR, ca.OP_IF_ELSE_ZERO):
            return self._truth(op, a, b)
        raise NotImplementedError(f"CasADi operation {op}")

    def _slot(self, index: int) -> str:
        if index not in self.slots:
            place = self._new(f"getelementptr double, double* %in, i64 {index}")
            self.slots[index] = self._new(f"load double, double* {place}")
        return self.slots[index]

    def text(self, name: str, steps: int, outputs: int) -> str:
        """Return the function ``name`` that runs the first ``steps`` instructions and stores ``outputs`` results."""
        tape, base = self.tape, self.tape.n_in + self.tape.constants.size
        for k in range(steps):
            self.slots[base + k] = self.value(int(tape.op[k]), self._slot(int(tape.a[k])), self._slot(int(tape.b[k])))
        for i in range(outputs):
            value = self._slot(int(tape.picks[i]))
            place = self._new(f"getelementptr double, double* %out, i64 {i}")
            self.lines.append(f"  store double {value}, double* {place}")
        body = "\n".join(self.lines)
        return f"define void @{name}(double* noalias %in, double* noalias %out) {{\nentry:\n{body}\n  ret void\n}}\n"


class _Cache:
    """Keeps machine code on disk, by the text that it came from and the processor that it is for."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def _path(self, module: Any) -> Path:
        return self.folder / f"{module.name}.o"

    def save(self, module: Any, code: bytes) -> None:
        """Store what was compiled; a folder that cannot be written only costs time."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            part = self._path(module).with_suffix(f".{os.getpid()}")
            part.write_bytes(code)
            part.replace(self._path(module))
        except OSError:
            return

    def load(self, module: Any) -> bytes | None:
        """Return what was compiled earlier, if anything."""
        try:
            return self._path(module).read_bytes()
        except OSError:
            return None


def _cache_folder() -> Path:
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "signlin_ros" / "native"


@functools.cache
def _engine() -> tuple[Any, str]:
    """Return LLVM's engine with its cache, and what identifies the target."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_default_triple()
    features = llvm.get_host_cpu_features().flatten()
    machine = target.create_target_machine(cpu=llvm.get_host_cpu_name(), features=features, opt=2)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    cache = _Cache(_cache_folder())
    engine.set_object_cache(cache.save, cache.load)
    _keep.append((machine, cache))
    return engine, f"{llvm.get_host_cpu_name()} {features} {llvm.llvm_version_info} {numba.__version__}"


_keep: list[Any] = []
"""What must live as long as the machine code."""


@functools.lru_cache(maxsize=1024)
def _compiled(text: str, names: tuple[str, ...]) -> tuple[int, ...]:
    engine, target = _engine()
    digest = hashlib.sha256(f"{target}\n{text}".encode()).hexdigest()[:32]
    unique = text.replace("@tape_", f"@t{digest}_")
    module = llvm.parse_assembly(unique)
    module.name = digest
    engine.add_module(module)
    engine.finalize_object()
    return tuple(int(engine.get_function_address(f"t{digest}_{name}")) for name in names)


def native(tape: Tape) -> tuple[int, int]:
    """Return the addresses of two functions of (inputs, results): the whole tape, and only its head."""
    parts = []
    declared: set[str] = set()
    for name, steps, outputs in (("all", tape.op.size, tape.n_out), ("head", tape.k_head, tape.n_head)):
        writer = _Writer(tape)
        parts.append(writer.text(f"tape_{name}", steps, outputs))
        declared |= writer.declared
    text = "\n".join([*sorted(declared), *parts])
    whole, head = _compiled(text, ("all", "head"))
    return whole, head


@intrinsic
def call(typing_context: Any, address: Any, inputs: Any, results: Any) -> Any:
    """Call the native function at ``address`` with the data of two contiguous arrays of float64."""
    signature = types.void(types.intp, inputs, results)

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        pointer = ir.DoubleType().as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [pointer, pointer])
        target = builder.inttoptr(arguments[0], kind.as_pointer())
        data = [
            builder.bitcast(context.make_array(sig.args[i])(context, builder, arguments[i]).data, pointer)
            for i in (1, 2)
        ]
        builder.call(target, data)
        return context.get_dummy_value()

    return signature, generate


def caller(address: int) -> Callable[[np.ndarray, np.ndarray], None]:
    """Return a Python function that fills ``results`` from ``inputs``; for tests."""
    return lambda inputs, results: _call_once(address, inputs, results)


@numba.njit(cache=True)
def _call_once(address, inputs, results):
    call(address, inputs, results)


__all__ = ["call", "caller", "native"]
