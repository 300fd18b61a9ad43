"""A Python file for python-control: the nonlinear system, and its linearization at a point."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from signlin_ros.export.base import Array, Exported, ExportedDrive, NotRunError, Target, refuse_imposed, refuse_sensors
from signlin_ros.export.functions import linear_rows, smooth_rates, texts
from signlin_ros.export.lines import NUMPY_DIALECT
from signlin_ros.export.python_text import docstring, function_text, loaded, names_of, numbers
from signlin_ros.model import Model

_QUIET = '@np.errstate(divide="ignore", invalid="ignore", over="ignore")  # of branches that are not taken'
_CONTROL_TAIL = '''_PLAIN = [name.replace(".", "_") for name in STATES]
_IN = [name.replace(".", "_") for name in INPUTS]
NAMES = {"states": _PLAIN, "inputs": _IN, "outputs": _PLAIN}


def linear_system(x=None, u=None):
    """Return x' = A x + B u at the operating point (x, u) as a StateSpace, and the constant c beside it."""
    A, B, c = linearize(INITIAL_STATE if x is None else x, [0.0] * len(INPUTS) if u is None else u)
    return ct.ss(A, B, np.eye(len(STATES)), 0, **NAMES), c


system = ct.nlsys(rates, None, name="model", **NAMES)
'''


class PythonControl(Target):
    """A file that defines ``system`` (NonlinearIOSystem) and ``linear_system(x, u)``."""

    name, suffix, engine, smooth = "python-control", ".py", "control", True

    def write(self, model: Model, out: Path, drive: ExportedDrive) -> Exported:
        """Write the file."""
        refuse_imposed(model, self.name)
        n, m = len(model.states), len(model.inputs)
        names = texts(model, 'p["{name}"]')
        what = "A model for python-control: `system` is nonlinear, `linear_system(x, u)` is A, B there."
        begin = (
            "p = {**PARAMETERS, **params}",
            "x, u = np.asarray(x, dtype=float), np.asarray(u, dtype=float)",
        )
        rates = function_text(
            "rates(t, x, u, params)",
            "Return x' = f_j(x, u) (n,).",
            smooth_rates(model),
            names,
            NUMPY_DIALECT,
            "return np.array([{values}], dtype=float)",
            begin,
        )
        a, b = n * n, n * n + n * m
        linear = function_text(
            "linearize(x, u, params={})",
            f"Return A (n, n), B (n, m) and c (n,) of x' = A x + B u + c at (x, u): {model.linearization}.",
            linear_rows(model, ("A", "B", "c")),
            names,
            NUMPY_DIALECT,
            "flat = np.array([{values}], dtype=float)\n"
            f"return flat[:{a}].reshape({n}, {n}), flat[{a}:{b}].reshape({n}, {m}), flat[{b}:]",
            begin,
        )
        parts = [docstring(model, what), "import control as ct\nimport numpy as np", numbers(model), names_of(model)]
        out.write_text(
            "\n\n".join([*parts, f"{_QUIET}\n{rates}", f"{_QUIET}\n{linear}", _CONTROL_TAIL]), encoding="utf-8"
        )
        lost = list(refuse_sensors(model))
        if model.trace.surfaces:
            lost.append("sign: sign_j stands for it; a stuck shaft creeps")
        if model.delay:
            lost.append(f"input_delay: {model.delay:g} s are beside the equations, as DELAY")
        return Exported((out,), ("f_j, A, B and c as recorded",), tuple(lost))

    def run(self, exported: Exported, model: Model, drive: ExportedDrive) -> dict[str, Array]:
        """Run it with `control.input_output_response`, inputs held."""
        try:
            import control
        except ImportError as error:
            raise NotRunError('control is not installed (pip install "signlin_ros[export]")') from error
        system = loaded(exported.files[0])["system"]
        breaks = np.unique(np.concatenate([drive.t, drive.acts + model.delay]))
        breaks = breaks[(breaks >= drive.t[0]) & (breaks <= drive.t[-1])]
        just_before = breaks[1:] - 1e-9 * np.diff(breaks)
        times = np.sort(np.concatenate([breaks, just_before]))
        late = ExportedDrive(drive.t, drive.u, drive.acts + model.delay, drive.x0)
        held = np.empty((times.size, drive.u.shape[1]))
        held[0::2] = late.input_at(breaks)
        held[1::2] = late.input_at(breaks[:-1])
        found = control.input_output_response(
            system,
            times,
            held.T,
            drive.x0,
            solve_ivp_method="LSODA",
            solve_ivp_kwargs={"rtol": 1e-5, "atol": 1e-7, "max_step": float(np.diff(breaks).max())},
        )
        rows = np.searchsorted(times, drive.t)
        return {name: np.asarray(found.states[i][rows]) for i, name in enumerate(model.states)}


TARGET = PythonControl()

__all__ = ["TARGET", "PythonControl"]
