"""What exported Python files have in common: a docstring, the numbers as a mapping, functions of recorded lines."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from signlin_ros.export.base import Array, ExportedDrive, constant_note, heading, ranges, table_of_constants
from signlin_ros.export.functions import parameters
from signlin_ros.export.lines import Dialect, number, written
from signlin_ros.model import Model


def docstring(model: Model, what: str) -> str:
    """Return the docstring of an exported file."""
    inner = "\n".join(heading(model, what)).replace("\\", "/").replace('"""', "'''")
    return f'"""{inner}\n"""'


def numbers(model: Model, smooth: bool = True) -> str:
    """Return the numbers of a model as a mapping with units, meanings and tolerances as comments, and their ranges.

    ``smooth``: with the scales of sign_j.
    """
    listed = table_of_constants(model) if smooth else [(c, constant_note(c)) for c in parameters(model)]
    rows = [f'    "{c.name}": {number(c.value)},  # {note}' for c, note in listed]
    known = [f'    "{n.replace(".", "_")}": ({low:.8g}, {high:.8g}),' for n, (low, high) in ranges(model).items()]
    lines = ["PARAMETERS = {", *rows, "}"]
    return "\n".join([*lines, "RANGES = {  # two standard deviations either way, for randomisation", *known, "}"])


def names_of(model: Model) -> str:
    """Return the names of states and inputs, and the input's delay."""
    return (
        f"STATES = {list(model.states)!r}  # {', '.join(model.units[n] for n in model.states)}\n"
        f"INPUTS = {list(model.inputs)!r}  # {', '.join(model.units[n] for n in model.inputs)}\n"
        f"DELAY = {model.delay!r}  # s from a command until it acts; not in the equations\n"
        f"INITIAL_STATE = {[float(v) for v in model.x0]!r}"
    )


def function_text(
    signature: str,
    doc: str,
    function: ca.Function,
    names: list[str],
    dialect: Dialect,
    end: str,
    begin: tuple[str, ...] = (),
) -> str:
    """Return a Python function; ``end`` is a template of the outputs, joined, as ``{values}``."""
    lines, values = written(function, names, dialect)
    inner = [f'"""{doc}"""', *begin, *lines, *end.format(values=", ".join(values)).split("\n")]
    return "\n".join([f"def {signature}:", *(f"    {line}" for line in inner)])


def loaded(path: Path) -> dict[str, Any]:
    """Return the names that an exported Python file defines."""
    return runpy.run_path(str(path))


def runge_kutta(f: Any, drive: ExportedDrive, delay: float, step: float) -> Array:
    """Return states (T, n) of x' = f(x, u) by the classical method of order 4, the inputs held."""
    late = ExportedDrive(drive.t, drive.u, drive.acts + delay, drive.x0)
    out = np.empty((drive.t.size, drive.x0.size))
    x = out[0] = drive.x0
    u = late.input_at(drive.t)
    for k, dt in enumerate(np.diff(drive.t)):
        count = max(1, int(np.ceil(dt / step)))
        h = dt / count
        for i in range(count):
            now = u[k] if not delay else late.input_at(np.array([drive.t[k] + i * h]))[0]
            k1 = f(x, now)
            k2 = f(x + h / 2 * k1, now)
            k3 = f(x + h / 2 * k2, now)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + f(x + h * k3, now))
        out[k + 1] = x
    return out


__all__ = ["docstring", "function_text", "loaded", "names_of", "numbers", "runge_kutta"]
