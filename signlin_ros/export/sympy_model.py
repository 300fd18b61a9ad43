"""A Python file for SymPy: the exact equations, sign and all, as a matrix of expressions."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np

from signlin_ros.export.base import Array, Exported, ExportedDrive, NotRunError, Target, refuse_imposed, refuse_sensors
from signlin_ros.export.functions import exact_rates, identifier
from signlin_ros.export.lines import SYMPY
from signlin_ros.export.python_text import docstring, function_text, loaded, names_of, numbers, runge_kutta
from signlin_ros.model import Model

_TOOLS = """def _holds(condition):
    return sp.Piecewise((1, condition), (0, True))
"""
SYMPY_STEP = 5e-4
"""Longest step in s of the run."""


class SympyModel(Target):
    """A file that defines ``x``, ``u``, ``p`` (symbols) and ``xdot``, a matrix of them."""

    name, suffix, engine = "sympy", ".py", "SymPy's lambdify and Runge-Kutta steps"

    def write(self, model: Model, out: Path, drive: ExportedDrive) -> Exported:
        """Write the file."""
        refuse_imposed(model, self.name)
        what = "The exact equations for SymPy: xdot is a matrix in the symbols x, u and p."
        pars = {c: c for c in (identifier(n) for n in model.trace.parameters)}
        names = [f"x[{i}]" for i in range(len(model.states))] + [f"u[{i}]" for i in range(len(model.inputs))]
        names += [f'p["{name}"]' for name in pars]
        body = function_text(
            "rates(x, u, p)", "Return x' (n, 1).", exact_rates(model), names, SYMPY, "return sp.Matrix([{values}])"
        )
        tail = [
            f"x = sp.symbols({' '.join(identifier(n) for n in model.states)!r}, real=True, seq=True)",
            f"u = sp.symbols({' '.join(identifier(n) for n in model.inputs)!r}, real=True, seq=True)",
            f"p = {{name: sp.Symbol(name, real=True) for name in {list(pars)!r}}}",
            "xdot = rates(x, u, p)",
            "values = {p[name]: PARAMETERS[name] for name in p}",
        ]
        parts = [
            docstring(model, what),
            "import sympy as sp",
            numbers(model, smooth=False),
            names_of(model),
            _TOOLS,
            body,
        ]
        out.write_text("\n\n".join([*parts, "\n".join(tail)]) + "\n", encoding="utf-8")
        lost = list(refuse_sensors(model))
        if any(s.kind == "switch" for s in model.trace.surfaces):
            lost.append("sticking: SymPy's sign(0) is 0; what holds a stuck shaft is for the solver")
        if model.delay:
            lost.append(f"input_delay: {model.delay:g} s are beside the equations, as DELAY")
        return Exported((out,), ("the exact right-hand side as recorded",), tuple(lost))

    def run(self, exported: Exported, model: Model, drive: ExportedDrive) -> dict[str, Array]:
        """Make a function of it with lambdify and carry it on by steps of at most `SYMPY_STEP`."""
        if importlib.util.find_spec("sympy") is None:
            raise NotRunError('sympy is not installed (pip install "signlin_ros[symbolic]")')
        import sympy

        file = loaded(exported.files[0])
        function: Any = sympy.lambdify(
            [*file["x"], *file["u"]], list(file["xdot"].subs(file["values"])), "math", cse=True
        )
        found = runge_kutta(lambda x, u: np.array(function(*x.tolist(), *u.tolist())), drive, model.delay, SYMPY_STEP)
        return {name: found[:, i] for i, name in enumerate(model.states)}


TARGET = SympyModel()

__all__ = ["TARGET", "SympyModel"]
