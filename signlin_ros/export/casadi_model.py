"""A Python file for CasADi: f_j as a `casadi.Function` of states, inputs and parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from signlin_ros.export.base import Array, Exported, ExportedDrive, Target, refuse_imposed, refuse_sensors
from signlin_ros.export.functions import smooth_rates, texts
from signlin_ros.export.lines import CASADI
from signlin_ros.export.python_text import docstring, function_text, loaded, names_of, numbers
from signlin_ros.model import Model

_CASADI_TAIL = '''def dynamics():
    """Return the function (x, u, p) -> x'; p (np,) in the order of PARAMETERS."""
    x, u = ca.SX.sym("x", len(STATES)), ca.SX.sym("u", len(INPUTS))
    p = ca.SX.sym("p", len(PARAMETERS))
    known = dict(zip(PARAMETERS, ca.vertsplit(p)))
    return ca.Function("f", [x, u, p], [rates(x, u, known)], ["x", "u", "p"], ["xdot"])


NOMINAL = list(PARAMETERS.values())
'''


def rates_text(model: Model) -> str:
    """Return the function of f_j in CasADi's words."""
    return function_text(
        "rates(x, u, p)",
        "Return x' = f_j(x, u) (n,); p: parameters by name.",
        smooth_rates(model),
        texts(model, 'p["{name}"]'),
        CASADI,
        "return ca.vertcat({values})",
    )


def said_lost(model: Model) -> tuple[str, ...]:
    """Return the losses of every target of f_j."""
    lost = list(refuse_sensors(model))
    if model.trace.surfaces:
        lost.append("sign: sign_j stands for it; a stuck shaft creeps")
    if model.delay:
        lost.append(f"input_delay: {model.delay:g} s are beside the equations, as DELAY")
    return tuple(lost)


def integrated(f: Any, drive: ExportedDrive, delay: float) -> Array:
    """Return states (T, n) of x' = f(x, u), a CasADi function, by CVODES, inputs held."""
    n, m = drive.x0.size, drive.u.shape[1]
    late = ExportedDrive(drive.t, drive.u, drive.acts + delay, drive.x0)
    breaks = np.unique(np.concatenate([drive.t, drive.acts + delay]))
    breaks = breaks[(breaks >= drive.t[0]) & (breaks <= drive.t[-1])]
    x, q = ca.SX.sym("x", n), ca.SX.sym("q", m + 1)
    options = {"reltol": 1e-7, "abstol": 1e-9, "max_num_steps": 100000}
    step = ca.integrator("F", "cvodes", {"x": x, "p": q, "ode": q[m] * f(x, q[:m])}, 0.0, 1.0, options)
    spans = np.diff(breaks)
    whole = step.mapaccum(spans.size)
    found = np.array(whole(x0=drive.x0, p=np.column_stack([late.input_at(breaks[:-1]), spans]).T)["xf"])
    return np.vstack([drive.x0, found.T])[np.searchsorted(breaks, drive.t)]


class CasadiModel(Target):
    """A file that defines ``dynamics()``, a `casadi.Function`."""

    name, suffix, engine, smooth = "casadi", ".py", "CasADi's CVODES", True
    said = "A model for CasADi: `dynamics()` is the function (x, u, p) -> x'; NOMINAL are its parameters."
    imports, tail = "import casadi as ca", _CASADI_TAIL

    def write(self, model: Model, out: Path, drive: ExportedDrive) -> Exported:
        """Write the file."""
        refuse_imposed(model, self.name)
        parts = [docstring(model, self.said), self.imports, numbers(model), names_of(model)]
        out.write_text("\n\n".join([*parts, rates_text(model), self.tail]), encoding="utf-8")
        return Exported((out,), ("f_j as recorded",), said_lost(model))

    def run(self, exported: Exported, model: Model, drive: ExportedDrive) -> dict[str, Array]:
        """Integrate it with CVODES."""
        file = loaded(exported.files[0])
        function, nominal = file["dynamics"](), file["NOMINAL"]
        found = integrated(lambda x, u: function(x, u, ca.DM(nominal)), drive, model.delay)
        return {name: found[:, i] for i, name in enumerate(model.states)}


TARGET = CasadiModel()

__all__ = ["TARGET", "CasadiModel", "integrated", "rates_text", "said_lost"]
