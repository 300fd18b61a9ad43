"""C99 without malloc: f_j, a step, sign_j, A_k, B_k, c and the friction alone, from the recorded equations."""

from __future__ import annotations

import contextlib
import ctypes
import re
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path

import casadi as ca
import numpy as np

from signlin_ros.export.base import (
    Array,
    Exported,
    ExportedDrive,
    NotRunError,
    Target,
    heading,
    ranges,
    refuse_imposed,
    refuse_sensors,
    table_of_constants,
)
from signlin_ros.export.compiler import build
from signlin_ros.export.functions import friction, identifier, linear_rows, smooth_rates, texts
from signlin_ros.export.lines import C, number, written
from signlin_ros.export.longest import ACCURATE, STEPS_TRIED, longest_step
from signlin_ros.model import Model
from signlin_ros.sign import sign_j_expression
from signlin_ros.simulation import simulate

_RK4 = """void {name}_step(double x[{N}], const double u[{M}], double dt)
{{
    double k[4][{N}], z[{N}];
    int i;
    {name}_f(x, u, k[0]);
    for (i = 0; i < {N}; i++) z[i] = x[i] + 0.5 * dt * k[0][i];
    {name}_f(z, u, k[1]);
    for (i = 0; i < {N}; i++) z[i] = x[i] + 0.5 * dt * k[1][i];
    {name}_f(z, u, k[2]);
    for (i = 0; i < {N}; i++) z[i] = x[i] + dt * k[2][i];
    {name}_f(z, u, k[3]);
    for (i = 0; i < {N}; i++) x[i] += dt / 6.0 * (k[0][i] + 2.0 * k[1][i] + 2.0 * k[2][i] + k[3][i]);
}}"""

_HARNESS = """#include "{header}"
void run(long count, long substeps, const double *dt, const double *u, double *x);
void run(long count, long substeps, const double *dt, const double *u, double *x)
{{
    long k, s;
    int i;
    double z[{N}];
    for (i = 0; i < {N}; i++) z[i] = x[i];
    for (k = 0; k < count; k++) {{
        for (s = 0; s < substeps; s++) {name}_step(z, u + k * {M}, dt[k] / (double)substeps);
        for (i = 0; i < {N}; i++) x[(k + 1) * {N} + i] = z[i];
    }}
}}
"""


def prefix_of(model: Model, out: Path) -> str:
    """Return the prefix of every name in an exported file: its stem."""
    return identifier(out.stem) or identifier(model.plant.name)


def _comment(lines: Iterable[str]) -> str:
    inner = "\n".join(f" * {line}".rstrip() for line in lines)
    return f"/*\n{inner.replace('*/', '* /')}\n */"


def _function(signature: str, function: ca.Function, names: list[str], stores: list[str], ends: str = "") -> str:
    """Return a C function that stores each output; ``stores`` are templates of one value."""
    lines, values = written(function, names, C)
    used = _words(" ".join([*lines, *values]))
    quiet = [f"(void){n};" for n in _ARGUMENTS.findall(signature) if n not in used]
    rows = [store.format(value=value) for store, value in zip(stores, values, strict=True)]
    inner = "\n".join(f"    {line}" for line in (*lines, *quiet, *rows, *([ends] if ends else [])))
    return f"{signature}\n{{\n{inner}\n}}"


_ARGUMENTS = re.compile(r"(?:const double|[(,] ?double) (x|u|q|dq|tau|z)\b")


def _words(text: str) -> set[str]:
    return set("".join(c if c.isalnum() or c == "_" else " " for c in text).split())


class CSource(Target):
    """C99 source and header of a model."""

    name, suffix, engine, smooth = "c", ".c", "the C compiler of this machine", True

    def write(self, model: Model, out: Path, drive: ExportedDrive) -> Exported:
        """Write ``out`` and its header; the longest step of `step` is measured on ``drive``."""
        refuse_imposed(model, self.name)
        name, header = prefix_of(model, out), out.with_suffix(".h")
        own = friction(model)
        step = longest_step(model, drive)
        out.write_text(_source(model, name, header.name, own), encoding="utf-8")
        header.write_text(_header(model, name, own is not None, step), encoding="utf-8")
        with contextlib.suppress(NotRunError):
            step = _accurate(model, out, drive, step)
        header.write_text(_header(model, name, own is not None, step), encoding="utf-8")
        lost = list(refuse_sensors(model))
        if model.trace.surfaces:
            lost.append("sign: sign_j stands for it; a stuck shaft creeps")
        if model.delay:
            lost.append(f"input_delay: {model.delay:g} s are for the caller to wait; {name}_DELAY says it")
        holds = ("f_j, A_k, B_k, c, sign_j as recorded", *(("friction(q, dq, tau)",) if own is not None else ()))
        return Exported((out, header), holds, tuple(lost), {"longest step in s": f"{step:g}"})

    def run(self, exported: Exported, model: Model, drive: ExportedDrive) -> dict[str, Array]:
        """Compile and step it with at most the longest step."""
        step = float(exported.settings["longest step in s"])
        found = _stepper(model, exported.files[0])(drive, step)
        return {state: found[:, i] for i, state in enumerate(model.states)}


def _accurate(model: Model, out: Path, drive: ExportedDrive, step: float) -> float:
    """Return the longest of `STEPS_TRIED`, from a first guess on, whose compiled run is our smooth run to
    `ACCURATE`.
    """
    ours = simulate(model, drive.t, drive.u, drive.x0, kind="smooth", rtol=1e-9, acts=drive.acts)
    size = np.sqrt(np.mean(ours.x**2, axis=0)) + 1e-300
    stepper = _stepper(model, out)
    for tried in (s for s in STEPS_TRIED if s <= step):
        with np.errstate(all="ignore"):
            error = np.sqrt(np.mean((stepper(drive, tried) - ours.x) ** 2, axis=0)) / size
        if np.isfinite(error).all() and error.max() <= ACCURATE:
            return tried
    return STEPS_TRIED[-1]


def _stepper(model: Model, out: Path) -> Callable[[ExportedDrive, float], Array]:
    """Return a function that runs the compiled file along a drive by steps of at most so many s: states (T, n).

    Raises `NotRunError` without a compiler.
    """
    n, m, name = len(model.states), len(model.inputs), prefix_of(model, out)
    with tempfile.TemporaryDirectory() as folder:
        harness, library = Path(folder) / "harness.c", Path(folder) / "model.so"
        header = out.with_suffix(".h").resolve()
        harness.write_text(_HARNESS.format(header=header, name=name, N=n, M=m), encoding="utf-8")
        build([out.resolve(), harness], library)
        run = ctypes.CDLL(str(library)).run
    pointer = ctypes.POINTER(ctypes.c_double)

    def steps(drive: ExportedDrive, step: float) -> Array:
        times, rows = _grid(drive, model.delay)
        dt, u, x = np.diff(times), np.ascontiguousarray(drive.u[rows[:-1]]), np.zeros((times.size, n))
        x[0] = drive.x0
        substeps = max(1, int(np.ceil(dt.max() / step - 1e-9)))
        run(
            ctypes.c_long(dt.size),
            ctypes.c_long(substeps),
            *(array.ctypes.data_as(pointer) for array in (dt, u, x)),
        )
        return x[np.searchsorted(times, drive.t)]

    return steps


def _grid(drive: ExportedDrive, delay: float) -> tuple[Array, np.ndarray]:
    """Return all times at which a sample is wanted or an input changes (K,), and the row of the input from each on."""
    breaks = drive.acts + delay
    inside = breaks[(breaks > drive.t[0]) & (breaks < drive.t[-1])]
    times = np.unique(np.concatenate([drive.t, inside]))
    rows = np.clip(np.searchsorted(breaks, times, side="right") - 1, 0, len(drive.u) - 1)
    return times, rows


def _header(model: Model, name: str, has_friction: bool, step: float) -> str:
    N, M = f"{name}_N", f"{name}_M"
    about = heading(model, f"{name}: x' = f_j(x, u), its linearization and its friction, in C99 without malloc.")
    known = [f"{n}: {low:.6g} to {high:.6g}" for n, (low, high) in ranges(model).items()]
    if known:
        about += ["ranges for randomisation (two standard deviations either way):", *(f"  {line}" for line in known)]
    parts = [_comment(about), f"#ifndef {name}_H\n#define {name}_H"]
    parts.append(f"#define {N} {len(model.states)} /* states: {', '.join(model.states)} */")
    parts.append(f"#define {M} {len(model.inputs)} /* inputs: {', '.join(model.inputs)} */")
    parts.append(
        f"#define {name}_LONGEST_STEP {step!r} /* s; measured: a longer dt of {name}_step errs by more than 0.1 % */"
    )
    if model.delay:
        parts.append(f"#define {name}_DELAY {model.delay!r} /* s from a command until it acts: the caller's to wait */")
    for constant, note in table_of_constants(model):
        parts.append(f"#define {name}_P_{constant.name} {number(constant.value)} /* {note} */")
    parts.append('#ifdef __cplusplus\nextern "C" {\n#endif')
    args = f"const double x[{N}], const double u[{M}]"
    said = [
        (f"double {name}_sign(double z);", f"sign_j(z) of order {model.sign_order}, z = g / scale"),
        (f"void {name}_f({args}, double f[{N}]);", "f = f_j(x, u)"),
        (
            f"void {name}_step(double x[{N}], const double u[{M}], double dt);",
            "carry x on by dt s, u held (Runge-Kutta, order 4)",
        ),
        (
            f"int {name}_linearize({args}, double A[{N} * {N}], double B[{N} * {M}], double c[{N}]);",
            f"x' = A x + B u + c at (x, u), row-major, {model.linearization}; 1 inside the valid range of sign_j",
        ),
        (f"void {name}_A({args}, double A[{N} * {N}]);", "A alone"),
        (f"void {name}_B({args}, double B[{N} * {M}]);", "B alone"),
    ]
    if has_friction:
        force = model.unit_of(model.plant.force_unit)
        said.append(
            (
                f"double {name}_friction(double q, double dq, double tau);",
                f"force of all effects in {force} at position q, speed dq, driving force tau; bristles as in sliding",
            )
        )
    parts += [f"/* {doc} */\n{declared}" for declared, doc in said]
    parts.append("#ifdef __cplusplus\n}\n#endif\n#endif\n")
    return "\n\n".join(parts)


def _source(model: Model, name: str, header: str, own: ca.Function | None) -> str:
    n, m = len(model.states), len(model.inputs)
    N, M = f"{name}_N", f"{name}_M"
    names = texts(model, f"{name}_P_{{name}}")
    constants = names[n + m :]
    args = f"const double x[{N}], const double u[{M}]"
    z = ca.SX.sym("z")
    sign = ca.Function("sign", [z], [sign_j_expression(z, model.sign_order)[0]])
    cells = {"A": n * n, "B": n * m, "c": n}
    parts = [
        f'#include <math.h>\n#include "{header}"',
        _function(f"double {name}_sign(double z)", sign, ["z"], ["return {value};"]),
        _function(
            f"void {name}_f({args}, double f[{N}])",
            smooth_rates(model),
            names,
            [f"f[{i}] = {{value}};" for i in range(n)],
        ),
        _RK4.format(name=name, N=N, M=M),
        _function(
            f"int {name}_linearize({args}, double A[{N} * {N}], double B[{N} * {M}], double c[{N}])",
            linear_rows(model, ("A", "B", "c", "valid")),
            names,
            [f"{b}[{i}] = {{value}};" for b, count in cells.items() for i in range(count)] + ["return {value} != 0.0;"],
        ),
    ]
    parts += [
        _function(
            f"void {name}_{block}({args}, double {block}[{N} * {N if block == 'A' else M}])",
            linear_rows(model, (block,)),
            names,
            [f"{block}[{i}] = {{value}};" for i in range(cells[block])],
        )
        for block in ("A", "B")
    ]
    if own is not None:
        signature = f"double {name}_friction(double q, double dq, double tau)"
        parts.append(_function(signature, own, ["q", "dq", "tau", *constants], ["return {value};"]))
    return "\n\n".join(parts) + "\n"


TARGET = CSource()

__all__ = ["TARGET", "CSource", "prefix_of"]
