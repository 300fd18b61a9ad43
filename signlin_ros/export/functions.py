"""The functions of a model that a target gets, as CasADi functions of what was recorded, and the texts of their inputs.

`functions` returns f_j, the exact right-hand side, the linearization and `friction`, all from
`signlin_ros.recording`: nothing of a law is written a second time.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca

from signlin_ros.compiled import linear_function, scales, weights
from signlin_ros.engine.symbolic import symbolic
from signlin_ros.export.lines import Dialect, number, written
from signlin_ros.model import Model
from signlin_ros.recording.smooth import SmoothForm, smooth_form
from signlin_ros.recording.trace import Trace

Drives = dict[str, tuple[str, Callable[[dict[str, Any], Any], dict[str, Any]]]]
DRIVES: Drives = {
    "dc_motor": ("J", lambda p, tau: {"current": tau / p["K_t"]}),
    "mass_spring_damper": ("m", lambda p, tau: {"force": tau}),
    "bouc_wen": ("m", lambda p, tau: {"force": tau}),
}
"""By plant: its inertia, and what a driving force tau means to its states and inputs."""


@dataclass(frozen=True)
class Constant:
    """A number of a model under a name that every language takes: a parameter, or the scale of a surface.

    ``std`` is its standard error, from the fit that the model's file tells of, else 0; ``tolerance`` what the model
    states, relative.
    """

    name: str
    public: str
    value: float
    unit: str
    doc: str
    tolerance: float = 0.0
    std: float = 0.0


def identifier(name: str) -> str:
    """Return a public name as an identifier: ``coulomb_friction.mu`` as ``coulomb_friction_mu``."""
    plain = re.sub(r"\W+", "_", name).strip("_")
    return f"_{plain}" if plain[:1].isdigit() else plain


_FITTED = re.compile(r"^\s*# (\S+): fitted, (\S+) ± ([\d.eE+-]+)", re.MULTILINE)
"""How a file that a fit wrote tells of a parameter: its value and standard error."""


def fitted_errors(model: Model) -> dict[str, float]:
    """Return the standard errors that the model's file states beside what a fit found, by parameter.

    A value that was changed afterwards has none.
    """
    path = Path(model.source)
    if not path.is_file():
        return {}
    found = {}
    for name, value, error in _FITTED.findall(path.read_text(encoding="utf-8")):
        if name in model.trace.parameters and abs(model.value(name) - float(value)) <= max(float(error), 1e-12):
            found[name] = float(error)
    return found


def parameters(model: Model) -> list[Constant]:
    """Return the parameters of a model in the order of its trace."""
    declared = {name.split(".", 1)[1]: par for name, par in model.par_declarations().items()}
    found, errors = [], fitted_errors(model)
    for name in model.trace.parameters:
        par = declared.get(name)
        unit, doc = (par.unit, par.doc) if par else ("-", "")
        tolerance = 0.0 if "." in name else model.tolerance_of(name)
        found.append(Constant(identifier(name), name, model.value(name), unit, doc, tolerance, errors.get(name, 0.0)))
    return found


def constants(model: Model) -> tuple[list[Constant], list[Constant]]:
    """Return the parameters of a model, and the scales of its surfaces; raise `ModelError` where these are unknown."""
    known = zip(model.trace.surfaces, scales(model), strict=True)
    found = [
        Constant(f"scale_{k}", f"scale {k}", float(v), "", f"scale of sign_j on {s.name}")
        for k, (s, v) in enumerate(known)
    ]
    return parameters(model), found


@symbolic
def smooth_rates(model: Model) -> ca.Function:
    """Return f_j as a function of (x, u, p, scale)."""
    form = smooth_form(model.structure, model.sign_order)
    t = form.trace
    return ca.Function("f", [t.x, t.u, t.p, form.scale], [ca.densify(ca.cse(form.smooth(t.f)))])


@symbolic
def smooth_outputs(model: Model) -> ca.Function:
    """Return the outputs beside the states, with sign_j, as a function of (x, u, p, scale)."""
    form = smooth_form(model.structure, model.sign_order)
    t = form.trace
    return ca.Function("y", [t.x, t.u, t.p, form.scale], [ca.densify(form.smooth(t.y))])


@symbolic
def exact_rates(model: Model) -> ca.Function:
    """Return the exact right-hand side, sign(0) = 0, as a function of (x, u, p)."""
    t = model.trace
    return ca.Function("exact", [t.x, t.u, t.p], [ca.densify(ca.cse(_exact(t)))])


def _exact(t: Trace) -> ca.SX:
    f = t.f
    for surface in reversed(t.surfaces):
        value = 2 * (surface.g > 0) - 1 if surface.kind == "contact" else ca.sign(surface.g)
        f = ca.substitute(f, surface.symbol, value)
    return f


@symbolic
def linear_rows(model: Model, blocks: tuple[str, ...]) -> ca.Function:
    """Return blocks of the linearization ("A", "B", "c", "valid"), stacked, as a function of (x, u, p, scale)."""
    function, rows = linear_function(model.structure, model.sign_order, model.linearization)
    x, u, p, scale, _ = function.sx_in()
    flat = function(x, u, p, scale, ca.DM(weights(model)))
    wanted = ca.vertcat(*(flat[rows[name].start : rows[name].stop] for name in blocks))
    return ca.Function("linear", [x, u, p, scale], [ca.densify(ca.cse(wanted))])


@symbolic
def friction(model: Model) -> ca.Function | None:
    """Return the force of all effects as a function of (q, dq, tau, p, scale); None where a plant has no such thing.

    Positive accelerates. Own states of an effect are those of steady sliding where the law says them (bristles), the
    position and speed of the moving mass where it is a second mass, else 0.
    """
    if model.plant.name not in DRIVES or not model.effects:
        return None
    form = smooth_form(model.structure, model.sign_order)
    t = form.trace
    q, dq, tau = ca.SX.sym("q"), ca.SX.sym("dq"), ca.SX.sym("tau")
    inertia, drive = DRIVES[model.plant.name]
    p = dict(zip(t.parameters, ca.vertsplit(t.p), strict=True))
    values: dict[str, Any] = {**dict.fromkeys((*t.states, *t.inputs), 0.0), **drive(p, tau)}
    values = {name: value for name, value in values.items() if name in t.states or name in t.inputs}
    values[model.plant.velocity] = dq
    if model.plant.position in t.states:
        values[model.plant.position] = q
    own = [name for name in t.states if "." in name]
    values |= {n: {"position": q, "velocity": dq}[n.rpartition(".")[2]] for n in own if _moves(n)}
    row = p[inertia] * (_at(form, model.plant.velocity, values, own) - _bare(model, values))
    return ca.Function("friction", [q, dq, tau, t.p, form.scale], [ca.densify(ca.cse(row))])


def _moves(name: str) -> bool:
    return name.rpartition(".")[2] in ("position", "velocity")


def _at(form: SmoothForm, state: str, values: dict[str, Any], own: list[str]) -> ca.SX:
    """Return the rate of a state at values by name, own states in steady sliding."""
    t = form.trace
    f = form.smooth(t.f)
    settled = {}
    for name in own:
        k = t.states.index(name)
        rate, z = f[k], t.x[k]
        if _moves(name) or ca.which_depends(rate, z, 2, True)[0]:
            continue
        slope = ca.jacobian(rate, z)
        start = ca.substitute(rate, z, 0)
        settled[name] = ca.if_else(slope != 0, -start / ca.if_else(slope != 0, slope, 1), 0)
    row = f[t.states.index(state)]
    for name, value in settled.items():
        row = ca.substitute(row, t.x[t.states.index(name)], value)
    return _with(t, row, values)


def _with(t: Trace, e: ca.SX, values: dict[str, Any]) -> ca.SX:
    """Return an expression with states and inputs at values by name."""
    x = ca.vertcat(*(ca.SX(values[name]) for name in t.states))
    u = ca.vertcat(*(ca.SX(values[name]) for name in t.inputs))
    return ca.substitute([e], [t.x, t.u], [x, u])[0]


def _bare(model: Model, values: dict[str, Any]) -> ca.SX:
    """Return the acceleration of the plant without its effects, in the parameters' symbols of the whole."""
    bare = model
    for key in model.effects:
        bare = without(bare, key)
    t, whole = bare.trace, model.trace
    known = dict(zip(whole.parameters, ca.vertsplit(whole.p), strict=True))
    row = _with(t, t.f[t.states.index(model.plant.velocity)], values)
    return ca.substitute(row, t.p, ca.vertcat(*(known[name] for name in t.parameters)))


def without(model: Model, key: str) -> Model:
    """Return a model without an effect, and without what its options say of that effect's own states."""
    own = {name for name in model.states if name.startswith(f"{key}.")}
    tables = ("operating_range", "initial_state", "state_weights", "signals")
    kept = {t: {n: v for n, v in getattr(model, t).items() if n not in own} for t in tables}
    return (model.with_options(**kept) if own else model).without_effect(key)


def texts(model: Model, constants_prefix: str, x: str = "x[{i}]", u: str = "u[{i}]") -> list[str]:
    """Return the texts of (x, u, p, scale) as an exported function names them."""
    pars, surfaces = constants(model)
    return [
        *(x.format(i=i) for i in range(len(model.states))),
        *(u.format(i=i) for i in range(len(model.inputs))),
        *(constants_prefix.format(name=c.name) for c in pars),
        *(constants_prefix.format(name=c.name) for c in surfaces),
    ]


def body(function: ca.Function, names: list[str], dialect: Dialect) -> tuple[list[str], list[str]]:
    """Return `lines.written`: the lines and the outputs of a function."""
    return written(function, names, dialect)


__all__ = [
    "Constant",
    "constants",
    "exact_rates",
    "friction",
    "identifier",
    "linear_rows",
    "number",
    "parameters",
    "smooth_outputs",
    "smooth_rates",
    "texts",
    "without",
]
