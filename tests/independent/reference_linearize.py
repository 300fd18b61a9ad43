"""Linear models in 60 digits, written from the contract's formulas alone: what the product is compared with.

Nothing is shared with the product: no code, no tracing, no automatic differentiation.  For every effect the
additive terms of its force, *and the states that each term depends on*, are written out by hand.

    python reference_linearize.py MODEL.yaml --at speed=20,current=0.4 --input voltage=2 --method termwise

Order of reading: `sign_j`, `split` (the method: contract section 2, "Linearization at (x_k, u_k)"),
then the plants and the effects, one short function per row of the contract's table.
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import yaml
from mpmath import exp, mp, mpf, sin
from scipy.integrate import solve_ivp

mp.dps = 60
STEP = mpf(10) ** -20  # of the central differences: error about STEP^2 f''' = 1e-40 f'''

Point = dict[str, Any]  # name -> mpf: a state vector x, or an input vector u
Value = Callable[[Point, Point], Any]  # value(x, u) -> mpf


class Term(NamedTuple):
    """What `value(x, u)` adds to the derivative of `row`; it depends on the states `over` and no others."""

    row: str
    over: tuple[str, ...]
    value: Value


@dataclass
class Linear:
    """x' = A x + B u + c, nested lists of mpf in the order of the model's states and inputs."""

    A: list[list[Any]]
    B: list[list[Any]]
    c: list[Any]
    f: list[Any]
    x: list[Any]
    u: list[Any]
    in_valid_range: bool


def sign_j(z: Any, j: int) -> Any:
    """The approximated scalar sign function, as the paper writes it."""
    up, down = (1 + z) ** j, (1 - z) ** j
    return (up - down) / (up + down)


def derivative(value: Callable[[Point], Any], at: Point, name: str) -> Any:
    up, down = ({**at, name: at[name] + step} for step in (STEP, -STEP))
    return (value(up) - value(down)) / (2 * STEP)


def split(value: Callable[[Point], Any], over: tuple[str, ...], x: Point, weight: dict[str, Any]) -> tuple[Point, Any]:
    """Optimal linearization of one scalar: the row a and the constant c with a x + c = value(x).

    c = f(0), f~ = f - c, a = J + (f~ - J x) x^T W / (x^T W x), all over the coordinates `over` only.
    Where x^T W x = 0 there is no direction for the remainder: a = J, and the remainder goes into c.
    """
    J = {name: derivative(value, x, name) for name in over}
    c = value({**x, **dict.fromkeys(over, mpf(0))})
    rest = value(x) - c - sum(J[name] * x[name] for name in over)
    norm = sum(weight[name] * x[name] ** 2 for name in over)
    if norm == 0:
        return J, c + rest
    return {name: J[name] + rest * weight[name] * x[name] / norm for name in over}, c


class Reference:
    """One model file: its states, its inputs and the list of its terms."""

    def __init__(self, content: dict[str, Any]) -> None:
        self.content = content
        self.plant: str = content["plant"]
        self.p = numbers(content["parameters"])
        self.j = int(content.get("sign_order", 50))
        self.scale = mpf(content.get("sign_scale", 1.0))
        self.range = content.get("operating_range", {})
        self.surfaces: list[Any] = []  # every z = g / scale that was evaluated
        # (key, type, parameters) in the file's order
        self.effects = [(key, e.get("type", key), numbers(e)) for key, e in content.get("effects", {}).items()]
        self.terms: list[Term] = []
        PLANTS[self.plant](self)
        for key, kind, p in self.effects:
            EFFECTS[kind](self, p, key)
        weights = content.get("state_weights", {})
        self.weight = {name: mpf(weights.get(name, 1.0)) for name in self.states}
        self.affine = self.is_affine_in_input()

    # --- what plants and effects are written with

    def find(self, kind: str) -> tuple[str, Any] | None:
        """(key, parameters) of the model's effect of that kind, or None."""
        return next(((key, p) for key, found, p in self.effects if found == kind), None)

    def add(self, row: str, over: tuple[str, ...], value: Value) -> None:
        self.terms.append(Term(row, tuple(dict.fromkeys(over)), value))

    def force(self, over: tuple[str, ...], value: Value) -> None:
        """A force on the moving mass (of a force_element, whose motion is imposed: no state feels it)."""
        if self.row:
            self.add(self.row, over, lambda x, u: value(x, u) / self.mass)

    def reach(self, name: str) -> Any:
        return mpf(self.range.get(name, 0))

    def sign(self, g: Any, largest: Any) -> Any:
        """sign(g) -> sign_j(g / scale).  `largest`: of |g| in the operating range, for sign_scale 0.0."""
        z = g / (self.scale or 3 * largest / self.j)
        self.surfaces.append(z)
        return sign_j(z, self.j)

    def max0(self, g: Any, largest: Any) -> Any:
        return g * (1 + self.sign(g, largest)) / 2

    def sv(self, x: Point, u: Point) -> Any:
        """sign(v)."""
        return self.sign(self.v(x, u), self.reach(self.v_name))

    def first_input(self, u: Point) -> Any:
        """The first input behind dead zone and saturation, in the file's order."""
        value, name = u[self.inputs[0]], self.inputs[0]
        for _, kind, p in self.effects:
            if kind == "input_deadzone":
                far = self.reach(name) + p.d
                value = self.max0(value - p.d, far) - self.max0(-value - p.d, far)
            if kind == "input_saturation":  # clip(u) = u - max(u - u_max, 0) + max(-u - u_max, 0)
                far = self.reach(name) + p.u_max
                value = value - self.max0(value - p.u_max, far) + self.max0(-value - p.u_max, far)
        return value

    # --- f_j and its linear models

    def f(self, x: Point, u: Point) -> Point:
        """f_j: the right-hand side F(x, u) with every sign replaced by sign_j."""
        total = dict.fromkeys(self.states, mpf(0))
        for term in self.terms:
            total[term.row] += term.value(x, u)
        return total

    def is_affine_in_input(self) -> bool:
        """Second differences of F in u vanish (in 60 digits, at a point in general position)."""
        x = {name: mpf(3 + i) / 7 for i, name in enumerate(self.states)}
        u0, u1, u2 = ({name: mpf(2 + i) / 5 + k for i, name in enumerate(self.inputs)} for k in (0, 1, 2))
        low, mid, high = self.f(x, u0), self.f(x, u1), self.f(x, u2)
        return all(abs(low[s] - 2 * mid[s] + high[s]) < mpf(10) ** -50 for s in self.states)

    def linearize(self, at: dict[str, float], inputs: dict[str, float], method: str | None = None) -> Linear:
        """The linear model at a state and an input; what is not named is 0."""
        u = {name: mpf(inputs.get(name, 0)) for name in self.inputs}
        x = {name: mpf(at.get(name, 0)) for name in self.states}
        if self.content.get("operating_point", "start") == "midpoint":
            x = self.midpoint(x, u)
        method = method or self.default_method()
        self.surfaces.clear()
        f = self.f(x, u)
        in_valid_range = all(self.is_valid(z) for z in self.surfaces)
        A = {row: dict.fromkeys(self.states, mpf(0)) for row in self.states}
        B = {row: dict.fromkeys(self.inputs, mpf(0)) for row in self.states}
        c = dict.fromkeys(self.states, mpf(0))
        for row, over, value in self.parts(method):
            b = {name: derivative(lambda w, g=value: g(x, w), u, name) for name in self.inputs}
            for name in self.inputs:
                B[row][name] += b[name]
            # f(x) = F(x, 0) where F is affine in u, else F(x, u_k) - B u_k with B as it is at x_k
            held, shift = (dict.fromkeys(u, mpf(0)), 0) if self.affine else (u, sum(b[n] * u[n] for n in u))
            # no weight at all: A = J, c = f - J x
            weight = dict.fromkeys(self.states, mpf(0)) if method == "jacobian" else self.weight
            a, constant = split(lambda y, g=value, w=held: g(y, w), over, x, weight)
            c[row] += constant - shift
            for name, entry in a.items():
                A[row][name] += entry
        return Linear(
            [[A[r][s] for s in self.states] for r in self.states],
            [[B[r][i] for i in self.inputs] for r in self.states],
            *([vector[s] for s in self.states] for vector in (c, f, x)),
            [u[i] for i in self.inputs],
            in_valid_range,
        )

    def parts(self, method: str) -> list[Term]:
        """What `split` is applied to: each term, or each row of F over all states."""
        if method == "termwise":
            return self.terms
        return [Term(s, tuple(self.states), lambda x, u, s=s: self.f(x, u)[s]) for s in self.states]

    def default_method(self) -> str:
        default = "optimal" if self.plant == "bouc_wen" else "termwise"
        return str(self.content.get("linearization", default))

    def is_valid(self, z: Any) -> bool:
        near, settled = abs(z) <= 1, self.j < 8 and abs(1 - abs(sign_j(z, self.j))) <= mpf("0.005")
        return bool(abs(z) <= mpf(self.j) / 3 or settled or near)

    def midpoint(self, x: Point, u: Point) -> Point:
        """The state after half an update period under f_j with the input held."""

        def rate(_: float, y: Any) -> list[float]:
            with mp.workdps(20):
                f = self.f({name: mpf(value) for name, value in zip(self.states, y, strict=True)}, u)
                return [float(f[name]) for name in self.states]

        half = float(self.content.get("update_period", 0.2)) / 2
        start = [float(x[name]) for name in self.states]
        run = solve_ivp(rate, (0.0, half), start, method="DOP853", rtol=1e-12, atol=1e-14)
        return {name: mpf(value) for name, value in zip(self.states, run.y[:, -1], strict=True)}


# --- plants

NEEDS_POSITION = {
    "gravity_load", "cogging_torque", "linear_stiffness", "cubic_stiffness", "asymmetric_stiffness", "hard_stop",
    "bouc_wen_hysteresis", "compliant_load", "backlash",
}  # fmt: skip


def dc_motor(M: Reference) -> None:
    """(28): L_a i' = u - R i - K_m v;  J v' = K_t i - B v - T_L + effects.  L_a = 0: i = (u - K_m v) / R."""
    p, quasi_static = M.p, M.p.L_a == 0
    M.states = ["speed"] if quasi_static else ["current", "speed"]
    M.inputs = ["voltage", "load_torque"] if M.content.get("with_load_torque") else ["voltage"]
    M.row, M.mass, M.q, M.v_name, M.spring = "speed", p.J, "position", "speed", mpf(0)
    M.V, M.v = ("speed",), lambda x, u: x["speed"]
    if M.content.get("with_position") or any(kind in NEEDS_POSITION for _, kind, _ in M.effects):
        M.states.append("position")
        M.add("position", M.V, M.v)
    M.force(M.V, lambda x, u: -p.B * x["speed"])
    if "load_torque" in M.inputs:
        M.force((), lambda x, u: -u["load_torque"])

    hot, saturated = M.find("thermal_resistance"), M.find("torque_constant_saturation")
    theta, a = (f"{hot[0]}.temperature_rise", hot[1].a) if hot else ("", mpf(0))
    TH = (theta,) if hot else ()

    def R(x: Point) -> Any:  # R_a (1 + a Theta)
        return p.R_a * (1 + a * x[theta]) if hot else p.R_a

    def i(x: Point, u: Point) -> Any:
        return (M.first_input(u) - p.K_m * x["speed"]) / R(x) if quasi_static else x["current"]

    def K_t(x: Point, u: Point) -> Any:
        return p.K_t / (1 + saturated[1].kappa * i(x, u) ** 2) if saturated else p.K_t

    M.DRIVE, M.drive = ("speed", *TH) if quasi_static else ("current",), lambda x, u: K_t(x, u) * i(x, u)
    if quasi_static and not saturated:  # K_t (u - K_m v) / R(Theta), multiplied out
        M.force(TH, lambda x, u: p.K_t * M.first_input(u) / R(x))
        M.force(("speed", *TH), lambda x, u: -p.K_t * p.K_m * x["speed"] / R(x))
    else:
        M.force(M.DRIVE, M.drive)
    if not quasi_static:  # R_a (1 + a Theta) i, multiplied out
        M.add("current", (), lambda x, u: M.first_input(u) / p.L_a)
        M.add("current", ("speed",), lambda x, u: -p.K_m * x["speed"] / p.L_a)
        M.add("current", ("current",), lambda x, u: -p.R_a * x["current"] / p.L_a)
        if hot:
            M.add("current", ("current", theta), lambda x, u: -p.R_a * a * x[theta] * x["current"] / p.L_a)
    if not hot:
        return
    C, R_th = hot[1].C, hot[1].R_th  # C Theta' = R i^2 - Theta / R_th
    M.add(theta, TH, lambda x, u: -x[theta] / (C * R_th))
    if quasi_static:  # R i^2 = (u^2 - 2 u K_m v + K_m^2 v^2) / R(Theta)
        M.add(theta, TH, lambda x, u: M.first_input(u) ** 2 / R(x) / C)
        M.add(theta, ("speed", theta), lambda x, u: -2 * M.first_input(u) * p.K_m * x["speed"] / R(x) / C)
        M.add(theta, ("speed", theta), lambda x, u: (p.K_m * x["speed"]) ** 2 / R(x) / C)
    else:
        M.add(theta, ("current",), lambda x, u: p.R_a * x["current"] ** 2 / C)
        M.add(theta, ("current", theta), lambda x, u: p.R_a * a * x[theta] * x["current"] ** 2 / C)


def mass_spring_damper(M: Reference) -> None:
    """m q'' + c q' + k q = u + effects.  With bouc_wen_hysteresis the spring belongs to that effect."""
    p = M.p
    M.states, M.inputs = ["displacement", "velocity"], ["force"]
    M.row, M.mass, M.q, M.v_name, M.spring = "velocity", p.m, "displacement", "velocity", p.k
    M.V, M.v = ("velocity",), lambda x, u: x["velocity"]
    M.DRIVE, M.drive = (), lambda x, u: M.first_input(u)
    M.add("displacement", M.V, M.v)
    M.force((), M.drive)
    M.force(M.V, lambda x, u: -p.c * x["velocity"])
    if not M.find("bouc_wen_hysteresis"):
        M.force(("displacement",), lambda x, u: -p.k * x["displacement"])


def bouc_wen(M: Reference) -> None:
    """(34)-(36): mass_spring_damper with bouc_wen_hysteresis, whose h is called `hysteresis`."""
    M.effects.insert(0, ("", "bouc_wen_hysteresis", M.p))
    mass_spring_damper(M)


def force_element(M: Reference) -> None:
    """q' = u: the motion is imposed; the forces are the output and enter no derivative."""
    M.states, M.inputs = ["displacement"], ["velocity"]
    M.row, M.mass, M.q, M.v_name, M.spring = "", mpf(1), "displacement", "velocity", M.p.k
    M.V, M.v = (), lambda x, u: M.first_input(u)
    M.DRIVE, M.drive = (), lambda x, u: mpf(0)
    M.add("displacement", (), M.v)


PLANTS = {f.__name__: f for f in (dc_motor, mass_spring_damper, bouc_wen, force_element)}


# --- effects: one function per row of the contract's table


def viscous_friction(M: Reference, p: Any, key: str) -> None:
    M.force(M.V, lambda x, u: -p.b * M.v(x, u))


def coulomb_friction(M: Reference, p: Any, key: str) -> None:
    M.force(M.V, lambda x, u: -p.mu * M.sv(x, u))


def stribeck_friction(M: Reference, p: Any, key: str) -> None:
    M.force(M.V, lambda x, u: -(p.mu + p.excess * exp(-((M.v(x, u) / p.v_s) ** 2))) * M.sv(x, u))


def asymmetric_viscous_friction(M: Reference, p: Any, key: str) -> None:
    """-b_p max(v, 0) + b_n max(-v, 0)."""

    def value(x: Point, u: Point) -> Any:
        v, far = M.v(x, u), M.reach(M.v_name)
        return -p.b_p * M.max0(v, far) + p.b_n * M.max0(-v, far)

    M.force(M.V, value)


def quadratic_drag(M: Reference, p: Any, key: str) -> None:
    M.force(M.V, lambda x, u: -p.c2 * M.v(x, u) ** 2 * M.sv(x, u))


def load_dependent_friction(M: Reference, p: Any, key: str) -> None:
    """Two terms: one over what F_drive and v depend on, one over what F_ext and v depend on."""
    loads = [(kind, e) for _, kind, e in M.effects if kind in EXTERNAL]
    EXT = (M.q,) if M.spring != 0 or any(kind != "constant_load" for kind, _ in loads) else ()

    def external(q: Any) -> Any:
        return -M.spring * q + sum(EXTERNAL[kind](e, q) for kind, e in loads)

    def largest_external() -> Any:
        r = M.reach(M.q)
        return max(abs(external(r * k / 1000)) for k in range(-1000, 1001)) if M.scale == 0 else 0

    far_external, far_drive = largest_external(), getattr(M.p, "K_t", 1) * M.reach("current")

    def absolute(g: Any, far: Any) -> Any:
        return g * M.sign(g, far)

    M.force((*M.DRIVE, *M.V), lambda x, u: -p.kappa_d * absolute(M.drive(x, u), far_drive) * M.sv(x, u))
    if loads or M.spring != 0:
        M.force(
            (*EXT, *M.V),
            lambda x, u: -p.kappa_e * absolute(external(x.get(M.q, mpf(0))), far_external) * M.sv(x, u),
        )


EXTERNAL: dict[str, Callable[[Any, Any], Any]] = {
    "constant_load": lambda p, q: p.F0,
    "gravity_load": lambda p, q: -p.A * sin(q - getattr(p, "q0", 0)),
    "linear_stiffness": lambda p, q: -p.k * q,
    "cubic_stiffness": lambda p, q: -p.k3 * q**3,
    "asymmetric_stiffness": lambda p, q: -p.k2 * q**2 - p.k3 * q**3,
}


def constant_load(M: Reference, p: Any, key: str) -> None:
    M.force((), lambda x, u: p.F0)


def gravity_load(M: Reference, p: Any, key: str) -> None:
    M.force((M.q,), lambda x, u: EXTERNAL["gravity_load"](p, x[M.q]))


def linear_stiffness(M: Reference, p: Any, key: str) -> None:
    M.force((M.q,), lambda x, u: EXTERNAL["linear_stiffness"](p, x[M.q]))


def cubic_stiffness(M: Reference, p: Any, key: str) -> None:
    M.force((M.q,), lambda x, u: EXTERNAL["cubic_stiffness"](p, x[M.q]))


def asymmetric_stiffness(M: Reference, p: Any, key: str) -> None:
    M.force((M.q,), lambda x, u: EXTERNAL["asymmetric_stiffness"](p, x[M.q]))


def cogging_torque(M: Reference, p: Any, key: str) -> None:
    M.force((M.q,), lambda x, u: -p.A * sin(p.N * x[M.q] + p.phi))


def hard_stop(M: Reference, p: Any, key: str) -> None:
    far = M.reach(M.q) + p.gap
    M.force((M.q,), lambda x, u: -p.k_s * (M.max0(x[M.q] - p.gap, far) - M.max0(-x[M.q] - p.gap, far)))


def dahl_presliding(M: Reference, p: Any, key: str) -> None:
    z = f"{key}.z"
    M.states.append(z)
    M.force((z,), lambda x, u: -p.sigma * x[z])
    M.add(z, M.V, M.v)
    M.add(z, (*M.V, z), lambda x, u: -p.sigma * M.v(x, u) * M.sv(x, u) * x[z] / p.F_c)


def lugre_friction(M: Reference, p: Any, key: str) -> None:
    z = f"{key}.z"

    def recovery(x: Point, u: Point) -> Any:  # sigma0 |v| z / g(v)
        v = M.v(x, u)
        return p.sigma0 * v * M.sv(x, u) * x[z] / (p.F_c + (p.F_s - p.F_c) * exp(-((v / p.v_s) ** 2)))

    M.states.append(z)
    M.force((z,), lambda x, u: -p.sigma0 * x[z])
    M.force(M.V, lambda x, u: -(p.sigma1 + p.sigma2) * M.v(x, u))
    M.force((*M.V, z), lambda x, u: p.sigma1 * recovery(x, u))
    M.add(z, M.V, M.v)
    M.add(z, (*M.V, z), lambda x, u: -recovery(x, u))


def bouc_wen_hysteresis(M: Reference, p: Any, key: str) -> None:
    """Force -alpha k q - (1 - alpha) D k h;  (36): D h' = lambda v - beta |v| |h|^(n-1) h - gamma v |h|^n."""
    h, n = f"{key}.h" if key else "hysteresis", p.n
    k = M.spring if M.spring != 0 else p.k
    even, whole = n % 2 == 0, n == int(n)

    def power(x: Point) -> Any:  # |h|^n
        y, s = x[h], M.sign(x[h], M.reach(h))
        return (y**n if even else y**n * s) if whole else (y * s) ** n

    def signed_power(x: Point) -> Any:  # |h|^(n-1) h
        y, s = x[h], M.sign(x[h], M.reach(h))
        return (y**n * s if even else y**n) if whole else (y * s) ** (n - 1) * y

    M.states.append(h)
    M.force((M.q,), lambda x, u: -p.alpha * k * x[M.q])
    M.force((h,), lambda x, u: -(1 - p.alpha) * p.D * k * x[h])
    M.add(h, M.V, lambda x, u: p.lambda_ * M.v(x, u) / p.D)
    M.add(h, (*M.V, h), lambda x, u: -p.beta * M.v(x, u) * M.sv(x, u) * signed_power(x) / p.D)
    M.add(h, (*M.V, h), lambda x, u: -p.gamma * M.v(x, u) * power(x) / p.D)


def load_on_a_spring(M: Reference, p: Any, key: str) -> tuple[str, str, Callable[..., None]]:
    """The states of a second mass and how a term of the transmitted T acts: -T on the motor, J v2' = T."""
    q2, v2 = f"{key}.position", f"{key}.velocity"
    M.states += [q2, v2]
    M.add(q2, (v2,), lambda x, u: x[v2])

    def transmit(over: tuple[str, ...], T: Value) -> None:
        M.force(over, lambda x, u: -T(x, u))
        M.add(v2, over, lambda x, u: T(x, u) / p.J)

    return q2, v2, transmit


def compliant_load(M: Reference, p: Any, key: str) -> None:
    q2, v2, transmit = load_on_a_spring(M, p, key)
    transmit((M.q, q2), lambda x, u: p.k * (x[M.q] - x[q2]))
    transmit((*M.V, v2), lambda x, u: p.c * (M.v(x, u) - x[v2]))


def backlash(M: Reference, p: Any, key: str) -> None:
    """T = k dz(d) + c (v - v2) gate, with d = q - q2, multiplied out.

    gate = [1 + sign(d - gap)] / 2 + [1 + sign(-d - gap)] / 2 = 1 + signs: 1 in contact, 0 in the gap.
    """
    q2, v2, transmit = load_on_a_spring(M, p, key)
    far = M.reach(M.q) + M.reach(q2) + p.gap

    def dead_zone(x: Point) -> Any:
        d = x[M.q] - x[q2]
        return M.max0(d - p.gap, far) - M.max0(-d - p.gap, far)

    def signs(x: Point) -> Any:
        d = x[M.q] - x[q2]
        return (M.sign(d - p.gap, far) + M.sign(-d - p.gap, far)) / 2

    transmit((M.q, q2), lambda x, u: p.k * dead_zone(x))
    transmit((*M.V, v2), lambda x, u: p.c * (M.v(x, u) - x[v2]))
    transmit((M.q, q2, *M.V), lambda x, u: p.c * M.v(x, u) * signs(x))
    transmit((M.q, q2, v2), lambda x, u: -p.c * x[v2] * signs(x))


def thermal_resistance(M: Reference, p: Any, key: str) -> None:
    M.states.append(f"{key}.temperature_rise")  # its terms are multiplied out with the current's, in dc_motor


def inside_the_plant(M: Reference, p: Any, key: str) -> None:
    """Nothing to add: `first_input` or dc_motor has it; a delay is reported beside A and B."""


EFFECTS: dict[str, Callable[[Reference, Any, str], None]] = {
    **{
        f.__name__: f
        for f in (
            viscous_friction, coulomb_friction, stribeck_friction, asymmetric_viscous_friction,
            quadratic_drag, load_dependent_friction, constant_load, gravity_load, cogging_torque,
            linear_stiffness, cubic_stiffness, asymmetric_stiffness, hard_stop, dahl_presliding, lugre_friction,
            bouc_wen_hysteresis, compliant_load, backlash, thermal_resistance,
        )
    },
    **dict.fromkeys(
        ("input_deadzone", "input_saturation", "input_delay", "torque_constant_saturation"), inside_the_plant
    ),
}  # fmt: skip


# --- reading


def numbers(mapping: dict[str, Any]) -> Any:
    """Attributes of mpf; `lambda` becomes `lambda_`."""
    values = {k: mpf(float(v)) for k, v in mapping.items() if k != "type"}
    return SimpleNamespace(**{"lambda_" if k == "lambda" else k: v for k, v in values.items()})


def read_model(path: Path) -> dict[str, Any]:
    """The content below ros__parameters."""
    ((_, node),) = yaml.safe_load(path.read_text()).items()
    return dict(node["ros__parameters"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("--at", default="")
    parser.add_argument("--input", default="")
    parser.add_argument("--method", choices=["optimal", "termwise", "jacobian"])
    args = parser.parse_args()
    at, inputs = (
        {name: float(value) for name, value in (item.split("=") for item in text.split(",") if item)}
        for text in (args.at, args.input)
    )
    reference = Reference(read_model(args.model))
    result = reference.linearize(at, inputs, args.method)
    print("states", reference.states, "inputs", reference.inputs)
    for name in ("A", "B", "c", "f", "x", "u"):
        print(name, np.array(getattr(result, name), dtype=float).tolist())
    print("in_valid_range", result.in_valid_range)


if __name__ == "__main__":
    main()
