"""Equations of motion of two plants with every effect at once, and their integration with dry friction located.

One state vector serves both plants: y = (current, velocity, position, bristle z, hysteresis h, load position, load
velocity, temperature rise, lagged input). A record's parameters are one row of `DTYPE`; an effect whose parameters are
all zero is absent. Forces accelerate when positive. SI units; a rotary plant has rad, N·m and kg·m² for m, N and kg.

Method: Runge and Kutta's of fourth order between events. Dry friction is set-valued: it slips with a fixed sign until
the velocity crosses zero (the time is bisected), then sticks while the other forces stay within its level, until they
leave it (bisected likewise) [Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, II.6]. A step in
which a stop or a coupling gains or loses contact is repeated in `REFINE` parts.
"""

# mypy: disable-error-code="no-any-return"
# A row of DTYPE has no static type, so what is computed from its fields has none either.

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

I, V, Q, Z, H, Q2, V2, HEAT, LAG, SIZE = range(10)  # noqa: E741
REFINE = 128
STEP = 1e-4
"""Longest step, s."""

PLANT = ("motor", "R", "L", "K_t", "K_m", "c", "m", "k")  # c, m: B and J of a motor
CATALOGUE = {
    "viscous_friction": ("b",),
    "coulomb_friction": ("mu",),
    "stribeck_friction": ("mu", "excess", "v_s"),
    "asymmetric_viscous_friction": ("b_p", "b_n"),
    "cubic_viscous_friction": ("b", "b3"),
    "quadratic_drag": ("c2",),
    "load_dependent_friction": ("kappa_d", "kappa_e"),
    "load_dependent_stribeck": ("kappa_d", "kappa_e", "excess", "v_s"),
    "constant_load": ("F0",),
    "gravity_load": ("A", "q0"),
    "cogging_torque": ("A", "N", "phi"),
    "torque_ripple": ("A", "N", "phi", "A_2", "N_2", "phi_2"),
    "linear_stiffness": ("k",),
    "cubic_stiffness": ("k3",),
    "asymmetric_stiffness": ("k2", "k3"),
    "hard_stop": ("gap", "k_s"),
    "dahl_presliding": ("F_c", "sigma"),
    "play_friction": ("F_c", "sigma", "gap"),
    "lugre_friction": ("sigma0", "sigma1", "sigma2", "F_c", "F_s", "v_s"),
    "bouc_wen_hysteresis": ("alpha", "D", "lambda", "beta", "gamma", "n", "k"),
    "pinching_hysteresis": ("F_c", "sigma", "zeta", "z_p"),
    "maxwell_element": ("k", "tau"),
    "compliant_load": ("k", "c", "J"),
    "backlash": ("gap", "k", "c", "J"),
    "input_deadzone": ("d",),
    "input_saturation": ("u_max",),
    "input_delay": ("T",),
    "torque_constant_saturation": ("kappa",),
    "thermal_resistance": ("a", "C", "R_th"),
}
UNLISTED = {
    "position_viscosity": ("b", "N", "phi"),
    "drifting_coulomb": ("mu",),
    "root_friction": ("c",),
    "parametric_stiffness": ("k", "w"),
    "position_velocity_product": ("p", "q"),
    "patterned_coulomb": ("mu", "a", "N", "phi"),
    "wandering_ripple": ("A", "N"),
    "burst_load": ("F0",),
    "negative_resistance": ("b", "v0"),
    "varying_inertia": ("a", "N", "phi"),
    "vibration": ("F0", "w"),
    "saturating_spring": ("F", "q"),
    "detent": ("F", "q"),
    "even_drag": ("c2",),
    "step_load": ("F0",),
    "random_load": ("F0",),
}
SIMILAR = {
    "tanh_friction": ("mu", "v0"),
    "hyperbolic_stribeck": ("mu", "excess", "v_s"),
    "power_drag": ("c", "n"),
    "harmonic_cogging": ("A", "N", "phi", "second"),
    "quintic_stiffness": ("k5",),
    "damped_stop": ("gap", "k_s", "c_s"),
    "curved_dahl": ("F_c", "sigma", "n"),
    "input_lag": ("T",),
    "linear_current_saturation": ("kappa",),
}


def field(effect: str, parameter: str) -> str:
    """Return the name of an effect's parameter in `DTYPE`."""
    return f"{effect}_{parameter}"


NAMES = (*PLANT, *(field(e, p) for laws in (CATALOGUE, UNLISTED, SIMILAR) for e, ps in laws.items() for p in ps))
DTYPE = np.dtype([(name, np.float64) for name in NAMES])


@njit(cache=True)
def zone(x: float, half: float) -> float:
    """Return what of x lies outside [-half, half]."""
    return max(x - half, 0.0) - max(-x - half, 0.0)


@njit(cache=True)
def drive_force(y: Array, u: float, p: Any) -> float:
    """Return K_t i of a motor, else the input (after a lag, where there is one)."""
    if p.motor == 0.0:
        return y[LAG] if p.input_lag_T > 0.0 else u
    i = y[I]
    losses = 1.0 + p.torque_constant_saturation_kappa * i * i + p.linear_current_saturation_kappa * abs(i)
    return p.K_t * i / losses


@njit(cache=True)
def external_force(y: Array, p: Any) -> float:
    """Return gravity, constant load and stiffness."""
    q = y[Q]
    k = p.linear_stiffness_k + (p.k if p.bouc_wen_hysteresis_D == 0.0 or p.k == 0.0 else 0.0)
    return p.constant_load_F0 - p.gravity_load_A * math.sin(q - p.gravity_load_q0) - k * q


@njit(cache=True)
def hysteretic_spring(y: Array, p: Any) -> float:
    """Return the force of the spring with hysteresis: the plant's own spring where it has one."""
    D = p.bouc_wen_hysteresis_D
    if D == 0.0:
        return 0.0
    k = p.k if p.k > 0.0 else p.bouc_wen_hysteresis_k
    a = p.bouc_wen_hysteresis_alpha
    return -a * k * y[Q] - (1.0 - a) * D * k * y[H]


@njit(cache=True)
def damping_force(y: Array, p: Any) -> float:
    """Return what depends smoothly on the velocity (and the position)."""
    v, q = y[V], y[Q]
    b = p.c + p.viscous_friction_b
    b += p.asymmetric_viscous_friction_b_p if v > 0.0 else p.asymmetric_viscous_friction_b_n
    b += p.quadratic_drag_c2 * abs(v) + p.cubic_viscous_friction_b + p.cubic_viscous_friction_b3 * v * v
    b += p.position_viscosity_b * (1.0 + math.sin(p.position_viscosity_N * q + p.position_viscosity_phi))
    if p.position_velocity_product_p != 0.0:
        b += p.position_velocity_product_p * math.tanh(q / p.position_velocity_product_q)
    if p.negative_resistance_b != 0.0:
        b += p.negative_resistance_b * ((v / p.negative_resistance_v0) ** 2 - 1.0)
    force = -b * v - p.even_drag_c2 * v * v
    if p.power_drag_c != 0.0:
        force -= p.power_drag_c * abs(v) ** p.power_drag_n * np.sign(v)
    if p.tanh_friction_mu != 0.0:
        force -= p.tanh_friction_mu * math.tanh(v / p.tanh_friction_v0)
    return force


@njit(cache=True)
def position_force(t: float, y: Array, aux: float, p: Any) -> float:
    """Return what depends on the position or the time: cogging, stops, springs, vibration."""
    q = y[Q]
    force = -p.cogging_torque_A * math.sin(p.cogging_torque_N * q + p.cogging_torque_phi)
    force -= p.torque_ripple_A * math.sin(p.torque_ripple_N * q + p.torque_ripple_phi)
    force -= p.torque_ripple_A_2 * math.sin(p.torque_ripple_N_2 * q + p.torque_ripple_phi_2)
    if p.harmonic_cogging_A != 0.0:
        angle = p.harmonic_cogging_N * q + p.harmonic_cogging_phi
        force -= p.harmonic_cogging_A * (math.sin(angle) + p.harmonic_cogging_second * math.sin(2.0 * angle))
    force -= p.cubic_stiffness_k3 * q**3 + p.quintic_stiffness_k5 * q**5
    force -= p.asymmetric_stiffness_k2 * q**2 + p.asymmetric_stiffness_k3 * q**3
    force -= p.hard_stop_k_s * zone(q, p.hard_stop_gap)
    beyond = zone(q, p.damped_stop_gap)
    if p.damped_stop_k_s > 0.0 and beyond != 0.0:
        reaction = p.damped_stop_k_s * beyond + p.damped_stop_c_s * y[V]
        force -= max(reaction, 0.0) if beyond > 0.0 else min(reaction, 0.0)  # a stop does not pull
    if p.saturating_spring_F != 0.0:
        force -= p.saturating_spring_F * math.tanh(q / p.saturating_spring_q)
    if p.detent_F != 0.0:
        force -= p.detent_F * (q / p.detent_q) * math.exp(0.5 - 0.5 * (q / p.detent_q) ** 2)
    force -= p.wandering_ripple_A * math.sin(p.wandering_ripple_N * q + aux)
    force -= p.parametric_stiffness_k * math.sin(p.parametric_stiffness_w * t) * q
    loads = p.burst_load_F0 + p.step_load_F0 + p.random_load_F0
    return force + loads * aux + p.vibration_F0 * math.sin(p.vibration_w * t)


@njit(cache=True)
def coupling_force(y: Array, p: Any) -> float:
    """Return the force T through an elastic coupling, with or without play."""
    twist, slip = y[Q] - y[Q2], y[V] - y[V2]
    force = p.compliant_load_k * twist + p.compliant_load_c * slip
    if p.backlash_J > 0.0 and abs(twist) > p.backlash_gap:
        force += p.backlash_k * zone(twist, p.backlash_gap) + p.backlash_c * slip
    return force


@njit(cache=True)
def bristle_rate(y: Array, p: Any) -> float:
    """Return z' of Dahl's or LuGre's bristle, behind a play, pinched; curved: z' = v (1 - sigma z sign(v) / F_c)^n;
    of a spring in series with a damper.
    """
    v, z = y[V], y[Z]
    if p.play_friction_sigma > 0.0:
        return v - p.play_friction_sigma * abs(v) * zone(z, p.play_friction_gap) / p.play_friction_F_c
    if p.pinching_hysteresis_sigma > 0.0:
        stays = 1.0 - p.pinching_hysteresis_zeta * math.exp(-((z / p.pinching_hysteresis_z_p) ** 2))
        return stays * (v - p.pinching_hysteresis_sigma * abs(v) * z / p.pinching_hysteresis_F_c)
    if p.dahl_presliding_sigma > 0.0:
        return v - p.dahl_presliding_sigma * abs(v) * z / p.dahl_presliding_F_c
    if p.curved_dahl_sigma > 0.0:
        rest = 1.0 - p.curved_dahl_sigma * z * np.sign(v) / p.curved_dahl_F_c
        return v * np.sign(rest) * abs(rest) ** p.curved_dahl_n
    if p.lugre_friction_sigma0 > 0.0:
        F_c = p.lugre_friction_F_c
        g = F_c + (p.lugre_friction_F_s - F_c) * math.exp(-((v / p.lugre_friction_v_s) ** 2))
        return v - p.lugre_friction_sigma0 * abs(v) * z / g
    if p.maxwell_element_k > 0.0:
        return v - z / p.maxwell_element_tau
    return 0.0


@njit(cache=True)
def bristle_force(y: Array, p: Any) -> float:
    """Return the force of the bristles."""
    force = -(p.dahl_presliding_sigma + p.curved_dahl_sigma + p.pinching_hysteresis_sigma) * y[Z]
    force -= p.play_friction_sigma * zone(y[Z], p.play_friction_gap) + p.maxwell_element_k * y[Z]
    if p.lugre_friction_sigma0 > 0.0:
        force -= p.lugre_friction_sigma0 * y[Z] + p.lugre_friction_sigma1 * bristle_rate(y, p)
        force -= p.lugre_friction_sigma2 * y[V]
    return force


@njit(cache=True)
def other_force(t: float, y: Array, u: float, aux: float, p: Any) -> float:
    """Return every force but dry friction."""
    force = drive_force(y, u, p) + external_force(y, p) + hysteretic_spring(y, p)
    force += damping_force(y, p) + position_force(t, y, aux, p) + bristle_force(y, p)
    return force - coupling_force(y, p)


@njit(cache=True)
def friction_level(y: Array, u: float, aux: float, p: Any) -> float:
    """Return the level of dry friction."""
    v, q = abs(y[V]), y[Q]
    level = p.coulomb_friction_mu + p.drifting_coulomb_mu * aux + p.root_friction_c * math.sqrt(v)
    if p.stribeck_friction_v_s > 0.0:
        level += p.stribeck_friction_mu
        level += p.stribeck_friction_excess * math.exp(-((v / p.stribeck_friction_v_s) ** 2))
    if p.hyperbolic_stribeck_v_s > 0.0:
        level += p.hyperbolic_stribeck_mu + p.hyperbolic_stribeck_excess / (1.0 + v / p.hyperbolic_stribeck_v_s)
    drive, external = abs(drive_force(y, u, p)), abs(external_force(y, p))
    level += p.load_dependent_friction_kappa_d * drive + p.load_dependent_friction_kappa_e * external
    if p.load_dependent_stribeck_v_s > 0.0:
        load = p.load_dependent_stribeck_kappa_d * drive + p.load_dependent_stribeck_kappa_e * external
        level += load * (1.0 + p.load_dependent_stribeck_excess * math.exp(-((v / p.load_dependent_stribeck_v_s) ** 2)))
    pattern = p.patterned_coulomb_a * math.sin(p.patterned_coulomb_N * q + p.patterned_coulomb_phi)
    return level + p.patterned_coulomb_mu * (1.0 + pattern)


@njit(cache=True)
def hidden_rates(y: Array, p: Any, out: Array) -> None:
    """Write the rates of the states that are nobody's measurement."""
    out[Z] = bristle_rate(y, p)
    out[H] = out[Q2] = out[V2] = 0.0
    if p.bouc_wen_hysteresis_D > 0.0:
        n, h, v = p.bouc_wen_hysteresis_n, y[H], y[V]
        loop = p.bouc_wen_hysteresis_beta * abs(v) * abs(h) ** n * np.sign(h)
        loop += p.bouc_wen_hysteresis_gamma * v * abs(h) ** n
        out[H] = (p.bouc_wen_hysteresis_lambda * v - loop) / p.bouc_wen_hysteresis_D
    J = p.compliant_load_J + p.backlash_J
    if J > 0.0:
        out[Q2] = y[V2]
        out[V2] = coupling_force(y, p) / J


@njit(cache=True)
def rates(t: float, y: Array, s: float, stuck: bool, u: float, aux: float, p: Any, out: Array) -> None:
    """Write y' for dry friction of sign s, or of whatever holds a stuck mass."""
    hidden_rates(y, p, out)
    out[I] = out[HEAT] = out[LAG] = 0.0
    if p.input_lag_T > 0.0:
        out[LAG] = (u - y[LAG]) / p.input_lag_T
    if p.motor != 0.0:
        R = p.R * (1.0 + p.thermal_resistance_a * y[HEAT])
        voltage = y[LAG] if p.input_lag_T > 0.0 else u
        out[I] = (voltage - R * y[I] - p.K_m * y[V]) / p.L
        if p.thermal_resistance_C > 0.0:
            out[HEAT] = (R * y[I] ** 2 - y[HEAT] / p.thermal_resistance_R_th) / p.thermal_resistance_C
    if stuck:
        out[V] = out[Q] = 0.0
        return
    inertia = p.m * (1.0 + p.varying_inertia_a * math.sin(p.varying_inertia_N * y[Q] + p.varying_inertia_phi))
    out[Q] = y[V]
    out[V] = (other_force(t, y, u, aux, p) - friction_level(y, u, aux, p) * s) / inertia


@njit(cache=True)
def runge_kutta(t: float, y: Array, h: float, s: float, u: float, aux: float, p: Any, w: Array, out: Array) -> None:
    """Write y(t + h); s = 0 is stuck. ``w``: five rows of work space."""
    stuck = s == 0.0
    rates(t, y, s, stuck, u, aux, p, w[0])
    for j in range(SIZE):
        w[4, j] = y[j] + 0.5 * h * w[0, j]
    rates(t + 0.5 * h, w[4], s, stuck, u, aux, p, w[1])
    for j in range(SIZE):
        w[4, j] = y[j] + 0.5 * h * w[1, j]
    rates(t + 0.5 * h, w[4], s, stuck, u, aux, p, w[2])
    for j in range(SIZE):
        w[4, j] = y[j] + h * w[2, j]
    rates(t + h, w[4], s, stuck, u, aux, p, w[3])
    for j in range(SIZE):
        out[j] = y[j] + h / 6.0 * (w[0, j] + 2.0 * w[1, j] + 2.0 * w[2, j] + w[3, j])


@njit(cache=True)
def over(t: float, y: Array, s: float, u: float, aux: float, p: Any) -> bool:
    """Tell whether the phase has ended: a slipping mass has turned, a stuck one has broken away."""
    if s != 0.0:
        return y[V] * s < 0.0
    return abs(other_force(t, y, u, aux, p)) > friction_level(y, u, aux, p)


@njit(cache=True)
def advance(t: float, y: Array, h: float, s: float, u: float, aux: float, p: Any, w: Array) -> float:
    """Advance y in place by h through stick and slip; return the new sign of slipping, 0 if stuck."""
    left = h
    out = w[5]
    for _ in range(12):
        runge_kutta(t, y, left, s, u, aux, p, w, out)
        if not over(t + left, out, s, u, aux, p):
            y[:] = out
            return s
        low, high = 0.0, left
        for _ in range(40):
            middle = 0.5 * (low + high)
            runge_kutta(t, y, middle, s, u, aux, p, w, out)
            if over(t + middle, out, s, u, aux, p):
                high = middle
            else:
                low = middle
        runge_kutta(t, y, high, s, u, aux, p, w, out)
        y[:] = out
        y[V] = 0.0
        t, left = t + high, left - high
        force = other_force(t, y, u, aux, p)
        s = 0.0 if abs(force) <= friction_level(y, u, aux, p) else float(np.sign(force))
        if left <= 1e-15:
            return s
    runge_kutta(t, y, left, 0.0, u, aux, p, w, out)  # a chatter of breakaways: let it rest for this step
    y[:] = out
    return 0.0


@njit(cache=True)
def held(t: float, y: Array, u: float, aux: float, p: Any) -> float:
    """Return which share of its level the friction needs to hold a stuck mass, in [-1, 1]."""
    level = friction_level(y, u, aux, p)
    return min(max(other_force(t, y, u, aux, p) / level, -1.0), 1.0) if level > 0.0 else 0.0


@njit(cache=True)
def contacts(y: Array, p: Any) -> int:
    """Return a number that changes where a stop or a coupling gains or loses contact."""
    n = 0
    if p.hard_stop_k_s > 0.0:
        n += int(np.sign(zone(y[Q], p.hard_stop_gap))) + 1
    if p.damped_stop_k_s > 0.0:
        n += 3 * (int(np.sign(zone(y[Q], p.damped_stop_gap))) + 1)
    if p.backlash_J > 0.0:
        n += 9 * (int(np.sign(zone(y[Q] - y[Q2], p.backlash_gap))) + 1)
    return n


@njit(cache=True)
def stride(t: float, y: Array, h: float, s: float, u: float, aux: float, p: Any, w: Array) -> float:
    """Advance by h, in parts where a contact changes."""
    if h <= 0.0:
        return s
    w[6, :] = y
    before, s0 = contacts(y, p), s
    s = advance(t, y, h, s, u, aux, p, w)
    if contacts(y, p) == before:
        return s
    y[:] = w[6]
    s = s0
    for j in range(REFINE):
        s = advance(t + j * h / REFINE, y, h / REFINE, s, u, aux, p, w)
    return s


@njit(cache=True)
def integrate(p: Any, u: Array, aux: Array, dt: float, parts: int, delay: float, y: Array, dense: Array) -> bool:
    """Integrate over held inputs u (T,) into ``dense`` (T * parts + 1, 4).

    Columns: current, velocity, position, dry friction as a share of its level (the velocity's sign, or `held`).

    ``y``: the start, overwritten. ``delay``: s, of the input, which was 0 before. Return whether all stayed finite.
    """
    w = np.zeros((7, SIZE))
    late = int(delay // dt)
    rest = delay - late * dt
    h = dt / parts
    s = float(np.sign(y[V]))
    for k in range(len(u)):
        new = u[k - late] if k >= late else 0.0
        old = u[k - late - 1] if k > late else 0.0
        for j in range(parts):
            row, t = k * parts + j, k * dt + j * h
            dense[row, 0], dense[row, 1], dense[row, 2] = y[I], y[V], y[Q]
            dense[row, 3] = s if s != 0.0 else held(t, y, old, aux[k], p)
            first = min(max(rest - j * h, 0.0), h)
            s = stride(t, y, first, s, old, aux[k], p, w)
            s = stride(t + first, y, h - first, s, new, aux[k], p, w)
        if not (abs(y[V]) < 1e6 and abs(y[Q]) < 1e6 and abs(y[I]) < 1e6):
            return False
    dense[-1, 0], dense[-1, 1], dense[-1, 2], dense[-1, 3] = y[I], y[V], y[Q], s
    return True


def trajectory(
    p: Any, u: Array, aux: Array, dt: float, delay: float = 0.0, step: float = STEP
) -> tuple[Array, int] | None:
    """Return what `integrate` writes, from rest at 0, and the steps per sample; None where it diverges."""
    parts = max(1, round(np.ceil(dt / step)))
    dense = np.zeros((len(u) * parts + 1, 4))
    start = np.zeros(SIZE)
    return (dense, parts) if integrate(p, u, aux, dt, parts, delay, start, dense) else None
