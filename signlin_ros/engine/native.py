"""Machine code for tapes: a recorded function becomes native code in milliseconds, without a compiler.

`signlin_ros.engine.tape.Tape` is a straight line of scalar operations. `native` writes it as LLVM intermediate code
and lets the LLVM that comes with Numba translate it; compiled kernels call the result through its address
(`signlin_ros.engine.compiling`). A kernel is thus compiled once per machine and serves every model, at the speed of
code written for that model. What was translated is kept on disk and, as the addresses stay in use, in memory until the
process ends.
"""

# llvmlite carries no types.
# mypy: disable-error-code="misc"

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import secrets
import struct
import threading
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import casadi as ca
import llvmlite.binding as llvm
import numba

from signlin_ros.engine.operations import ONE, TWO
from signlin_ros.engine.tape import Tape

_LLVM_OPERATIONS = {ca.OP_ADD: "fadd", ca.OP_SUB: "fsub", ca.OP_MUL: "fmul", ca.OP_DIV: "fdiv"}
_COMPARE = {ca.OP_LT: "olt", ca.OP_LE: "ole", ca.OP_EQ: "oeq", ca.OP_NE: "une"}
_INTRINSIC = {"exp", "log", "sqrt", "sin", "cos", "floor", "ceil", "fabs", "pow", "copysign"}
"""Functions that LLVM has itself; others are called by their names in C."""


def _literal(value: float) -> str:
    return f"0x{struct.unpack('>Q', struct.pack('>d', value))[0]:016X}"


class Lines:
    """Lines of a function in LLVM's language, each result with a name of its own."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.count = 0

    def new(self, text: str) -> str:
        """Write one instruction; returns the name of its result."""
        self.count += 1
        self.lines.append(f"  %v{self.count} = {text}")
        return f"%v{self.count}"

    def place(self, pointer: str, index: int) -> str:
        """Write where a number stands."""
        return self.new(f"getelementptr double, double* {pointer}, i64 {index}")

    def number(self, pointer: str, index: int) -> str:
        """Write that a number is read."""
        return self.new(f"load double, double* {self.place(pointer, index)}")


class Writer(Lines):
    """Writes tapes as the body of a function, of two pointers by default."""

    def __init__(self, tape: Tape) -> None:
        super().__init__()
        self.tape = tape
        self.declared: set[str] = set()
        self.slots: dict[int, str] = {tape.n_in + i: _literal(float(v)) for i, v in enumerate(tape.constants)}

    def _call(self, name: str, *arguments: str) -> str:
        kinds = ", ".join(["double"] * len(arguments))
        self.declared.add(f"declare double @{name}({kinds})")
        return self.new(f"call double @{name}({', '.join(f'double {a}' for a in arguments)})")

    def _flag(self, kind: str, a: str, b: str) -> str:
        return self.new(f"fcmp {kind} double {a}, {b}")

    def _number(self, flag: str) -> str:
        return self.new(f"uitofp i1 {flag} to double")

    def _choice(self, kind: str, a: str, b: str, yes: str, no: str) -> str:
        return self.new(f"select i1 {self._flag(kind, a, b)}, double {yes}, double {no}")

    def _truth(self, op: int, a: str, b: str) -> str:
        zero = _literal(0.0)
        first = self._flag("une", a, zero)
        if op == ca.OP_NOT:
            return self._number(self._flag("oeq", a, zero))
        if op == ca.OP_IF_ELSE_ZERO:
            return self.new(f"select i1 {first}, double {b}, double {zero}")
        word = "and" if op == ca.OP_AND else "or"
        return self._number(self.new(f"{word} i1 {first}, {self._flag('une', b, zero)}"))

    def value(self, op: int, a: str, b: str) -> str:
        """Write one operation; returns the name of its result."""
        if op in _LLVM_OPERATIONS:
            return self.new(f"{_LLVM_OPERATIONS[op]} double {a}, {b}")
        if op in _COMPARE:
            return self._number(self._flag(_COMPARE[op], a, b))
        name = ONE.get(op) or TWO.get(op)
        if name:
            return self._call(f"llvm.{name}.f64" if name in _INTRINSIC else name, *((a, b) if op in TWO else (a,)))
        return self._rest(op, a, b)

    def _rest(self, op: int, a: str, b: str) -> str:
        if op == ca.OP_ASSIGN:
            return a
        if op == ca.OP_NEG:
            return self.new(f"fneg double {a}")
        if op in (ca.OP_SQ, ca.OP_TWICE):
            return self.new(f"{'fmul' if op == ca.OP_SQ else 'fadd'} double {a}, {a}")
        if op == ca.OP_INV:
            return self.new(f"fdiv double {_literal(1.0)}, {a}")
        if op in (ca.OP_FMIN, ca.OP_FMAX):  # like NumPy, nan if either is
            return self._choice("olt" if op == ca.OP_FMIN else "ogt", a, b, a, self._choice("uno", a, a, a, b))
        if op == ca.OP_SIGN:  # 0 and nan remain what they are
            one, minus, zero = _literal(1.0), _literal(-1.0), _literal(0.0)
            return self._choice("ogt", a, zero, one, self._choice("olt", a, zero, minus, a))
        if op in (ca.OP_NOT, ca.OP_AND, ca.OP_OR, ca.OP_IF_ELSE_ZERO):
            return self._truth(op, a, b)
        raise NotImplementedError(f"CasADi operation {op}")

    def _slot(self, index: int) -> str:
        if index not in self.slots:
            self.slots[index] = self.number("%in", index)
        return self.slots[index]

    def results(self, inputs: Mapping[int, str], wanted: Sequence[int]) -> list[str]:
        """Write what it takes to know the outputs ``wanted`` where some inputs have values of their own; returns them.

        What does not depend on those inputs is written once.
        """
        tape, base = self.tape, self.tape.n_in + self.tape.constants.size
        own = dict(inputs)
        needed, stack = set[int](), [int(tape.picks[i]) for i in wanted]
        while stack:
            slot = stack.pop()
            if slot >= base and slot not in needed:
                needed.add(slot)
                stack += [int(tape.a[slot - base]), int(tape.b[slot - base])]
        for slot in sorted(needed - self.slots.keys()):
            k = slot - base
            a, b = int(tape.a[k]), int(tape.b[k])
            value = self.value(int(tape.op[k]), own.get(a) or self._slot(a), own.get(b) or self._slot(b))
            (own if a in own or b in own else self.slots)[slot] = value
        return [own.get(slot) or self._slot(slot) for slot in (int(tape.picks[i]) for i in wanted)]

    def text(self, name: str, outputs: int, known: Collection[int] = ()) -> str:
        """Return the function ``name`` that stores the first ``outputs`` results, but for zeros that are ``known``."""
        zero = _literal(0.0)
        for i, value in enumerate(self.results({}, range(outputs))):
            if value == zero and i in known:
                continue
            self.lines.append(f"  store double {value}, double* {self.place('%out', i)}")
        body = "\n".join(self.lines)
        return f"define void @{name}(double* noalias %in, double* noalias %out) {{\nentry:\n{body}\n  ret void\n}}\n"


MOST_FILES = 40_000
"""Files of machine code, of some 4 kB, from which on the older half is removed."""


class _Cache:
    """Keeps machine code on disk, by the text that it came from and the processor that it is for.

    A folder that cannot be read or written only costs time; so does a file that is not whole, which LLVM would not
    survive: a file begins with the digest of the code in it. After the first that a process saves, the older half is
    removed where there are more than ``most``.
    """

    def __init__(self, folder: Path, most: int = MOST_FILES) -> None:
        self.folder, self.most, self.pruned = folder, most, False

    def _path(self, module: Any) -> Path:
        return self.folder / f"{module.name}.code"

    def save(self, module: Any, code: bytes) -> None:
        """Store what was compiled, all at once: other processes may do the same."""
        part = self.folder / f"{module.name}.{secrets.token_hex(8)}"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            part.write_bytes(hashlib.sha256(code).digest() + code)
            part.replace(self._path(module))
            if not self.pruned:
                self.pruned = True
                self._prune()
        except OSError:
            with contextlib.suppress(OSError):
                part.unlink()

    def _prune(self) -> None:
        """Remove the oldest half of the files where there are too many."""
        paths = list(self.folder.iterdir())
        if len(paths) <= self.most:
            return
        ages = []
        for path in paths:
            with contextlib.suppress(OSError):  # another process may do the same
                ages.append((path.stat().st_mtime, path))
        for _, path in sorted(ages)[: len(paths) // 2]:
            with contextlib.suppress(OSError):
                path.unlink()

    def load(self, module: Any) -> bytes | None:
        """Return the code that was compiled earlier, None without any."""
        try:
            content = self._path(module).read_bytes()
        except OSError:
            return None
        digest, code = content[:_DIGEST_SIZE], content[_DIGEST_SIZE:]
        return code if hashlib.sha256(code).digest() == digest else None


_DIGEST_SIZE = hashlib.sha256().digest_size


def _cache_folder() -> Path | None:
    """Return where machine code is kept; None without a home."""
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    try:
        return Path(base or Path.home() / ".cache") / "signlin_ros" / "native"
    except RuntimeError:
        return None


MOST_MODULES = 256
"""Modules in one of LLVM's engines: it looks through all that it has for the names in a new one."""


@functools.cache
def _engine(number: int) -> tuple[Any, str]:
    """Return an engine of LLVM by its number, with the cache of all of them, and what identifies the target."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_default_triple()
    features = llvm.get_host_cpu_features().flatten()
    machine = target.create_target_machine(cpu=llvm.get_host_cpu_name(), features=features, opt=2)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.finalize_object()  # the empty module that it begins with is not for the cache
    cache = _cache()
    if cache is not None:
        engine.set_object_cache(cache.save, cache.load)
    _keep.append(machine)
    return engine, f"{llvm.get_host_cpu_name()} {features} {llvm.llvm_version_info} {numba.__version__}"


@functools.cache
def _cache() -> _Cache | None:
    """Return the cache of this process; None where there is no folder for it."""
    folder = _cache_folder()
    return None if folder is None else _Cache(folder)


_keep: list[Any] = []
"""What must live as long as the machine code."""
_lock = threading.Lock()
"""LLVM's engine takes one module at a time, and none twice."""
_addresses: dict[str, tuple[int, ...]] = {}


def translated(text: str, names: tuple[str, ...]) -> tuple[int, ...]:
    """Return the addresses of the functions ``@tape_<name>`` of a text in LLVM's language; from any thread."""
    with _lock:
        engine, target = _engine(len(_addresses) // MOST_MODULES)
        digest = hashlib.sha256(f"{target}\n{text}".encode()).hexdigest()[:32]
        if digest not in _addresses:
            module = llvm.parse_assembly(text.replace("@tape_", f"@t{digest}_"))
            module.name = digest
            engine.add_module(module)
            engine.finalize_object()
            _addresses[digest] = tuple(int(engine.get_function_address(f"t{digest}_{name}")) for name in names)
        return _addresses[digest]


def native(tape: Tape, known: Collection[int] = ()) -> tuple[int, int]:
    """Return the addresses of two functions of (inputs, results): the whole tape, and only its head.

    ``known``: results that are not written where they are 0 whatever the inputs; who calls has them at 0.
    """
    ends = {"all": tape.n_out, "head": tape.n_head}
    if ends["head"] == ends["all"]:
        del ends["head"]
    parts = []
    declared: set[str] = set()
    for name, outputs in ends.items():
        writer = Writer(tape)
        parts.append(writer.text(f"tape_{name}", outputs, known))
        declared |= writer.declared
    addresses = translated("\n".join([*sorted(declared), *parts]), tuple(ends))
    return addresses[0], addresses[-1]


__all__ = ["MOST_FILES", "Lines", "Writer", "native", "translated"]
