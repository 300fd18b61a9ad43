"""Exact (non-smooth) trajectories by brute force: tiny steps of first order, inputs held between samples.

Dry friction is Moreau's implicit clipped choice: the velocity that the other forces alone would give is
pulled towards zero by at most (step x friction level / mass), so that a stuck shaft stays at exactly zero.
The error is of the order of the step, 2e-6 s (some 1e-6 of the standard deviation of a speed).
bouc_wen has no dry friction: Runge-Kutta 4 with steps of 2e-5 s.

    python reference_simulate.py MODEL.yaml DATA.csv OUT.csv       DATA: t,voltage[,load_torque]  or  t,force
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from reference_linearize import read_model

Array = NDArray[np.float64]
MECHANICAL_STEP, BOUC_WEN_STEP = 2e-6, 2e-5

# what `mechanical` reads from its array p, in this order; what a model does not have is 0
NAMES = (
    "R_a", "L_a", "K_t", "K_m", "mass", "damping", "k", "mu", "excess", "v_s",
    "F0", "gravity.A", "q0", "cogging.A", "N", "phi", "gap", "k_s",
)  # fmt: skip
RENAMED = {
    "dc_motor": {"J": "mass", "B": "damping"},
    "mass_spring_damper": {"m": "mass", "c": "damping"},
    "viscous_friction": {"b": "damping"},
    "gravity_load": {"A": "gravity.A"},
    "cogging_torque": {"A": "cogging.A"},
}
SAME_NAMES = {"coulomb_friction", "stribeck_friction", "constant_load", "hard_stop"}


@njit
def mechanical(t, u, load, x0, p, step):  # type: ignore[no-untyped-def]
    """Rows (current, velocity, position) at the times t.  R_a = 0: the input is a force, no current.  L_a = 0: the
    current is that of the input which acts from its row on."""
    R, L, K_t, K_m, mass, damping, k, mu, excess, v_s, F0, A, q0, A_c, N, phi, gap, k_s = p
    i, v, q = x0
    out = np.empty((len(t), 3))
    out[0] = x0
    for sample in range(len(t) - 1):
        n = int(np.ceil((t[sample + 1] - t[sample]) / step))
        h = (t[sample + 1] - t[sample]) / n
        for _ in range(n):
            force = u[sample]
            if R > 0:
                if L > 0:
                    i = (i + h * (u[sample] - K_m * v) / L) / (1 + h * R / L)
                else:
                    i = (u[sample] - K_m * v) / R
                force = K_t * i
            force += F0 - load[sample] - damping * v - k * q - A * np.sin(q - q0) - A_c * np.sin(N * q + phi)
            force -= k_s * (max(q - gap, 0.0) - max(-q - gap, 0.0))
            level = mu
            if excess > 0:
                level += excess * np.exp(-((v / v_s) ** 2))
            free, most = v + h * force / mass, h * level / mass
            v = free - min(max(free, -most), most)
            q += h * v
        if R > 0 and L == 0:
            i = (u[sample + 1] - K_m * v) / R
        out[sample + 1] = i, v, q
    return out


@njit
def bouc_wen_rate(x, force, m, c, k, alpha, D, lam, beta, gamma, n):  # type: ignore[no-untyped-def]
    """(34)-(36)."""
    q, v, h = x
    restoring = alpha * k * q + (1 - alpha) * D * k * h
    loop = lam * v - beta * abs(v) * abs(h) ** (n - 1) * h - gamma * v * abs(h) ** n
    return np.array([v, (force - c * v - restoring) / m, loop / D])


@njit
def bouc_wen(t, u, x0, m, c, k, alpha, D, lam, beta, gamma, n, step):  # type: ignore[no-untyped-def]
    """Rows (displacement, velocity, hysteresis) at the times t."""
    x = x0.copy()
    out = np.empty((len(t), 3))
    out[0] = x
    p = (m, c, k, alpha, D, lam, beta, gamma, n)
    for sample in range(len(t) - 1):
        steps = int(np.ceil((t[sample + 1] - t[sample]) / step))
        h, force = (t[sample + 1] - t[sample]) / steps, u[sample]
        for _ in range(steps):
            k1 = bouc_wen_rate(x, force, *p)
            k2 = bouc_wen_rate(x + h / 2 * k1, force, *p)
            k3 = bouc_wen_rate(x + h / 2 * k2, force, *p)
            k4 = bouc_wen_rate(x + h * k3, force, *p)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        out[sample + 1] = x
    return out


def flat(content: dict[str, Any]) -> Array:
    """The array p of `mechanical`."""
    found = dict.fromkeys(NAMES, 0.0)
    found["gap"] = np.inf
    groups = [(content["plant"], content["parameters"])]
    groups += [(e.get("type", key), e) for key, e in content.get("effects", {}).items()]
    for kind, parameters in groups:
        if kind not in RENAMED and kind not in SAME_NAMES:
            raise NotImplementedError(kind)
        for name, value in parameters.items():
            slot = RENAMED.get(kind, {}).get(name, name)
            if slot != "type":
                found[slot] = found[slot] + value if slot in ("damping", "mu", "F0") else value
    return np.array([found[name] for name in NAMES])


def simulate(content: dict[str, Any], t: Array, u: dict[str, Array], step: float | None = None) -> dict[str, Array]:
    """The states (T,) by name under the inputs (T,) by name, from the model's initial_state."""
    start, plant = content.get("initial_state", {}), content["plant"]
    t, u = np.ascontiguousarray(t), {name: np.ascontiguousarray(column) for name, column in u.items()}  # one type
    if plant == "bouc_wen":
        names = ("displacement", "velocity", "hysteresis")
        order = ("m", "c", "k", "alpha", "D", "lambda", "beta", "gamma", "n")
        p = [float(content["parameters"][name]) for name in order]
        x0 = np.array([float(start.get(name, 0)) for name in names])
        out = bouc_wen(t, u["force"], x0, *p, step or BOUC_WEN_STEP)
        return dict(zip(names, out.T, strict=True))
    names = ("current", "speed", "position") if plant == "dc_motor" else ("", "velocity", "displacement")
    drive = u["voltage" if plant == "dc_motor" else "force"]
    load = u.get("load_torque", np.zeros(len(t)))
    x0 = np.array([float(start.get(name, 0)) for name in names])
    out = mechanical(t, drive, load, x0, flat(content), step or MECHANICAL_STEP)
    return {name: column for name, column in zip(names, out.T, strict=True) if name}


def write_csv(path: Path, columns: dict[str, Array]) -> None:
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, fmt="%.17g", delimiter=",", header=",".join(columns), comments="")


def read_csv(path: Path) -> dict[str, Array]:
    table = np.genfromtxt(path, delimiter=",", names=True, deletechars="")
    return {name: table[name] for name in table.dtype.names}


if __name__ == "__main__":
    model, data, out = map(Path, sys.argv[1:])
    columns = read_csv(data)
    inputs = {name: column for name, column in columns.items() if name != "t"}
    write_csv(out, {"t": columns["t"], **inputs, **simulate(read_model(model), columns["t"], inputs)})
