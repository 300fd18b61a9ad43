"""A Python file for do-mpc: a continuous model with states, inputs and parameters, ready for a controller."""

from __future__ import annotations

import importlib.util
import warnings
from typing import Any

import casadi as ca

from signlin_ros.export.base import Array, Exported, ExportedDrive, NotRunError
from signlin_ros.export.casadi_model import CasadiModel, integrated
from signlin_ros.export.python_text import loaded
from signlin_ros.model import Model

_DO_MPC_TAIL = '''def model():
    """Return the do_mpc model; states and inputs have their names with underscores for dots."""
    found = do_mpc.model.Model("continuous")
    x = [found.set_variable("_x", name.replace(".", "_")) for name in STATES]
    u = [found.set_variable("_u", name.replace(".", "_")) for name in INPUTS]
    for name, rate in zip(STATES, ca.vertsplit(rates(x, u, PARAMETERS))):
        found.set_rhs(name.replace(".", "_"), rate)
    found.setup()
    return found
'''


class DoMpcModel(CasadiModel):
    """A file that defines ``model()``, a set up `do_mpc.model.Model`, around the function that CasADi's has."""

    name, engine = "do-mpc", "do-mpc's right-hand side and CVODES"
    said = "A model for do-mpc: `model()` is continuous, with the numbers of PARAMETERS in it."
    imports, tail = "import casadi as ca\nimport do_mpc", _DO_MPC_TAIL

    def run(self, exported: Exported, model: Model, drive: ExportedDrive) -> dict[str, Array]:
        """Integrate the right-hand side that do-mpc has made of it."""
        if importlib.util.find_spec("do_mpc") is None:
            raise NotRunError("do-mpc is not installed (pip install do-mpc)")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            made = loaded(exported.files[0])["model"]()
        rhs = made._rhs_fun
        n, m = len(model.states), len(model.inputs)
        empty = [rhs.mx_in(i).numel() for i in range(2, rhs.n_in())]

        def f(x: ca.SX, u: ca.SX) -> Any:
            return rhs(x[:n], u[:m], *(ca.DM.zeros(k) for k in empty))

        found = integrated(f, drive, model.delay)
        return {name: found[:, i] for i, name in enumerate(model.states)}


TARGET = DoMpcModel()

__all__ = ["TARGET", "DoMpcModel"]
