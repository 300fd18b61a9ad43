"""The reference checked against mathematics, exact solutions and published figures, without the product."""

import cases
import numpy as np
import pytest
from cases import CASES, METHODS, MOTOR, OSCILLATOR, case, sampled
from mpmath import atanh, mp, mpf, tanh
from reference_linearize import Reference, derivative, sign_j
from reference_simulate import simulate
from scipy.linalg import expm

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("reference")]  # whose kernels are compiled once


def floats(nested):
    return np.array(nested, dtype=float)


# --- sign_j


def test_sign_1_is_the_identity_and_sign_j_is_tanh_of_j_artanh():
    for z in (mpf("-0.93"), mpf("1e-14"), mpf("0.4")):
        assert abs(sign_j(z, 1) - z) < mpf(10) ** -55
        assert abs(sign_j(z, 50) - tanh(50 * atanh(z))) < mpf(10) ** -50
    assert abs(derivative(lambda x: sign_j(x["z"], 50), {"z": mpf(0)}, "z") - 50) < mpf(10) ** -30


@pytest.mark.parametrize(
    ("j", "z", "published"),
    [(50, "20.9", 0.983), (50, "50", 0.76), (50, "100", 0.46), (50, "500", 0.10), (51, "20.9", 1.015)],
)
def test_sign_j_has_the_published_values(j, z, published):
    digits = 3 if published > 0.9 else 2
    assert round(float(sign_j(mpf(z), j)), digits) == published


def test_the_papers_motor_leaves_the_valid_range_at_16_67_rad_s():
    motor = Reference(CASES["motor"])
    assert motor.linearize({"speed": 16.66}, {}).in_valid_range
    assert not motor.linearize({"speed": 16.68}, {}).in_valid_range


# --- linearization


@pytest.mark.parametrize("name", CASES)
def test_every_method_meets_f_at_the_point(name):
    reference = Reference(CASES[name])
    for x, u in list(cases.points(name))[::2]:
        for method in METHODS:
            m = reference.linearize(x, u, method)
            for row, b, c, f in zip(m.A, m.B, m.c, m.f, strict=True):
                model = mp.fdot(row, m.x) + mp.fdot(b, m.u) + c
                assert abs(model - f) <= mpf(10) ** -30 * max(1, abs(f), *(abs(a) for a in row))


@pytest.mark.parametrize("name", CASES)
def test_no_term_depends_on_a_state_outside_its_set(name):
    reference = Reference(CASES[name])
    x, u = next(cases.points(name))
    x, u = {n: mpf(x[n]) for n in reference.states}, {n: mpf(u[n]) for n in reference.inputs}
    for term in reference.terms:
        moved = {n: v if n in term.over else v + mpf("0.37") for n, v in x.items()}
        assert term.value(x, u) == term.value(moved, u)
        for n in term.over if term.value(x, u) else ():  # B = 0: a term that is not there
            assert any(term.value({**x, n: x[n] * k}, u) != term.value(x, u) for k in (mpf("0.5"), -1))


def sgn(g):
    return (g > 0) - (g < 0)


def max0(g):
    return max(g, 0)


# the contract's table with its signs left sharp: the force at (v, q), for the parameters in `cases`
LAWS = {
    "viscous_friction": (lambda v, q, b: -b * v, {"b": 2e-4}),
    "coulomb_friction": (lambda v, q, mu: -mu * sgn(v), {"mu": 0.033}),
    "stribeck_friction": (
        lambda v, q, mu, excess, v_s: -(mu + excess * np.exp(-((v / v_s) ** 2))) * sgn(v),
        {"mu": 0.025, "excess": 0.03, "v_s": 2.5},
    ),
    "asymmetric_viscous_friction": (
        lambda v, q, b_p, b_n: -b_p * v if v > 0 else -b_n * v,
        {"b_p": 2e-4, "b_n": 3e-4},
    ),
    "quadratic_drag": (lambda v, q, c2: -c2 * abs(v) * v, {"c2": 6e-5}),
    "constant_load": (lambda v, q, F0: F0, {"F0": 0.02}),
    "gravity_load": (lambda v, q, A, q0: -A * np.sin(q - q0), {"A": 0.08, "q0": 0.3}),
    "cogging_torque": (lambda v, q, A, N, phi: -A * np.sin(N * q + phi), {"A": 0.01, "N": 5.0, "phi": 0.6}),
    "linear_stiffness": (lambda v, q, k: -k * q, {"k": 0.05}),
    "cubic_stiffness": (lambda v, q, k3: -k3 * q**3, {"k3": 0.004}),
    "asymmetric_stiffness": (lambda v, q, k2, k3: -k2 * q**2 - k3 * q**3, {"k2": 0.01, "k3": 0.004}),
    "hard_stop": (lambda v, q, gap, k_s: -k_s * (max0(q - gap) - max0(-q - gap)), {"gap": 0.8, "k_s": 2.0}),
    "load_dependent_friction": (  # at i = 0.7, without any F_ext
        lambda v, q, kappa_d, kappa_e: -kappa_d * abs(0.0805 * 0.7) * sgn(v),
        {"kappa_d": 0.1, "kappa_e": 0.2},
    ),
}


@pytest.mark.parametrize("effect", LAWS)
def test_f_j_tends_to_the_table_with_sharp_signs(effect):
    law, p = LAWS[effect]
    sharp = {"with_position": True, "sign_order": 401, "sign_scale": 0.5}
    with_it, without = (
        Reference(case("dc_motor", MOTOR, {effect: p}, **sharp)),
        Reference(case("dc_motor", MOTOR, **sharp)),
    )
    u = {"voltage": mpf(1)}
    for v, q in ((3.0, 1.3), (-1.5, 0.3), (2.0, -1.1)):
        x = {"current": mpf(0.7), "speed": mpf(v), "position": mpf(q)}
        force = MOTOR["J"] * float(with_it.f(x, u)["speed"] - without.f(x, u)["speed"])
        assert force == pytest.approx(law(v, q, **p), rel=1e-9, abs=1e-15)


def test_the_effects_with_states_of_their_own_rest_where_they_must():
    sharp = {"sign_order": 401, "sign_scale": 0.5}
    u = {"voltage": mpf(0)}

    def f(effects, **x):
        reference = Reference(case("dc_motor", MOTOR, effects, **sharp))
        return reference.f({name: mpf(x.get(name.rsplit(".", 1)[-1], 0)) for name in reference.states}, u)

    dahl, lugre, loop = cases.DAHL, cases.LUGRE["lugre_friction"], cases.LOOP
    at = f(dahl, speed=-2, z=-0.033 / 2)  # z = -F_c / sigma: the force is +F_c
    assert float(at["dahl_presliding.z"]) == pytest.approx(0, abs=1e-12)
    assert float(at["speed"]) == pytest.approx(0.033 / MOTOR["J"])
    g = 0.03 + 0.02 * np.exp(-((2 / 1.5) ** 2))
    at = f(cases.LUGRE, speed=2, z=g / lugre["sigma0"])  # z = g / sigma0: the force is -(g + sigma2 v)
    assert float(at["lugre_friction.z"]) == pytest.approx(0, abs=1e-12)
    assert float(at["speed"]) == pytest.approx(-(g + 2e-4) / MOTOR["J"])
    for n in (1.0, 2.0, 3.0, 2.5):  # |h|^n = lambda / (beta + gamma) while v > 0; symmetric for v < 0
        h = (1 / 0.95) ** (1 / n)
        for way in (1, -1):
            at = f({"bouc_wen_hysteresis": {**loop, "n": n, "k": 0.5}}, speed=way, h=way * h)
            assert float(at["bouc_wen_hysteresis.h"]) == pytest.approx(0, abs=1e-12)
            assert float(at["speed"]) == pytest.approx(-way * 0.6 * 0.08 * 0.5 * h / MOTOR["J"])


@pytest.mark.parametrize(("q", "T"), [(0.4, 0.0), (-0.3, 0.0), (0.7, 0.2 * 0.6 + 3e-3), (-0.7, -0.2 * 0.6 + 3e-3)])
def test_backlash_transmits_in_contact_only(q, T):
    """Half width 0.5, k = 0.6, c = 0.001, at v - v2 = 3: the damping is gated like the spring."""
    effects = {"backlash": {**cases.COMPLIANT, "gap": 0.5}}
    reference = Reference(case("dc_motor", MOTOR, effects, sign_order=401, sign_scale=0.5))
    x = dict.fromkeys(reference.states, mpf(0)) | {"speed": mpf(3), "position": mpf(q)}
    f = reference.f(x, {"voltage": mpf(0)})
    assert float(f["backlash.velocity"]) == pytest.approx(T / 0.001, abs=1e-9)
    assert float(f["speed"]) == pytest.approx(-T / MOTOR["J"], abs=1e-9)


def test_dead_zone_and_saturation_act_on_the_input():
    for effects, table in (
        ({"input_deadzone": {"d": 0.9}}, {-2.0: -1.1, -0.5: 0.0, 0.3: 0.0, 1.5: 0.6}),
        ({"input_saturation": {"u_max": 1.5}}, {-2.0: -1.5, -0.5: -0.5, 1.2: 1.2, 4.0: 1.5}),
    ):
        reference = Reference(case("dc_motor", MOTOR, effects, sign_order=401, sign_scale=0.5))
        for u, expected in table.items():
            assert float(reference.first_input({"voltage": mpf(u)})) == pytest.approx(expected, abs=1e-9)
        assert not reference.affine


def test_the_published_entries_of_the_optimal_method():
    """Design, section 4: at 2 rad/s the damping entry is -7.2 at q = 0 and -0.003 at q = 100 rad."""
    motor = Reference(CASES["motor_with_position"])
    at = {"current": 0.4, "speed": 2.0}
    assert round(float(motor.linearize(at, {}, "optimal").A[1][1]), 1) == -7.2
    assert round(float(motor.linearize({**at, "position": 100.0}, {}, "optimal").A[1][1]), 3) == -0.003
    # (33): the friction alone, K_f = mu sign_j(w) / w, in the speed's own entry, and mu j / J at rest
    assert abs(motor.linearize(at, {}, "termwise").A[1][1] + mpf(0.033) * sign_j(mpf(2), 50) / 2 / mpf(0.0022)) < 1e-20
    assert abs(motor.linearize({}, {}, "termwise").A[1][1] + mpf(0.033) * 50 / mpf(0.0022)) < 1e-20


def test_midpoint_of_a_linear_model_is_its_matrix_exponential():
    motor = Reference(case("dc_motor", MOTOR, operating_point="midpoint"))
    m = motor.linearize({"current": 0.3, "speed": 5.0}, {"voltage": 2.0})
    A, b = floats(m.A), floats(m.B)[:, 0] * 2.0
    rest = -np.linalg.solve(A, b)
    np.testing.assert_allclose(floats(m.x), rest + expm(0.1 * A) @ ([0.3, 5.0] - rest), rtol=1e-11)


# --- simulation


def test_a_sliding_block_stops_where_it_must_and_stays():
    """m v' = -mu sign(v), k = c = 0: stops at t = m v0 / mu after m v0^2 / (2 mu)."""
    block = case(
        "mass_spring_damper",
        {"m": 2.0, "c": 0.0, "k": 0.0},
        {"coulomb_friction": {"mu": 3.0}},
        initial_state={"velocity": 1.2},
    )
    t = sampled(2.0)
    run = simulate(block, t, {"force": np.zeros(len(t))})
    assert np.all(run["velocity"][t >= 0.8 + 1e-5] == 0.0)
    np.testing.assert_allclose(run["velocity"], np.maximum(1.2 - 1.5 * t, 0), atol=1e-5)
    assert run["displacement"][-1] == pytest.approx(0.48, abs=1e-5)


def test_a_block_breaks_away_at_the_level_on_the_surface():
    """Stribeck: holds exactly below mu + excess, and moves above it."""
    effects = {"stribeck_friction": {"mu": 1.0, "excess": 0.5, "v_s": 0.1}}
    t = sampled(1.0)
    for force, moves in ((1.499, False), (1.501, True)):
        run = simulate(case("mass_spring_damper", {"m": 1.0, "c": 0.0, "k": 0.0}, effects), t, {"force": force + 0 * t})
        assert bool(run["velocity"].any()) is moves


def test_an_oscillator_with_dry_friction_loses_the_exact_amplitude_in_each_half_swing():
    """m q'' + k q = -mu sign(v): each half swing takes pi sqrt(m/k) and 2 mu / k, until |q| <= mu / k."""
    swing = case(
        "mass_spring_damper",
        {"m": 1.0, "c": 0.0, "k": 40.0},
        {"coulomb_friction": {"mu": 1.2}},
        initial_state={"displacement": 0.2},
    )
    t = np.arange(6) * np.pi / np.sqrt(40.0)
    run = simulate(swing, t, {"force": np.zeros(6)})
    np.testing.assert_allclose(run["displacement"], [0.2, -0.14, 0.08, -0.02, -0.02, -0.02], atol=2e-5)
    assert run["velocity"][-1] == 0.0


def test_both_programs_have_the_same_forces():
    """One step of 1e-7 s from a moving state against f_j at a high order."""
    effects = cases.STRIBECK | cases.LOAD | cases.GRAVITY | cases.STOP
    effects |= {"viscous_friction": {"b": 2e-4}, "cogging_torque": {"A": 0.01, "N": 5.0, "phi": 0.6}}
    for x in ((0.5, 3.0, 1.2), (-0.8, -2.0, -1.1)):
        start = dict(zip(("current", "speed", "position"), x, strict=True))
        content = case("dc_motor", MOTOR, effects, initial_state=start, sign_order=400, with_load_torque=True)
        run = simulate(content, np.array([0, 1e-7]), {"voltage": np.ones(2), "load_torque": np.full(2, 0.01)})
        f = Reference(content).f({n: mpf(v) for n, v in start.items()}, {"voltage": mpf(1), "load_torque": mpf(0.01)})
        for name, rate in f.items():
            assert (run[name][1] - run[name][0]) / 1e-7 == pytest.approx(float(rate), rel=1e-4)


def test_a_linear_motor_is_its_matrix_exponential():
    motor = case("dc_motor", MOTOR)
    t = sampled(0.5)
    run = simulate(motor, t, {"voltage": np.full(len(t), 2.0)})
    m = Reference(motor).linearize({}, {})
    A, b = floats(m.A), floats(m.B)[:, 0] * 2.0
    rest = -np.linalg.solve(A, b)
    exact = np.array([rest - expm(A * s) @ rest for s in t])
    np.testing.assert_allclose(np.column_stack([run["current"], run["speed"]]), exact, atol=5e-3)


def test_bouc_wen_saturates_where_it_must():
    """Pulled one way, h settles at (lambda / (beta + gamma))^(1/n)."""
    element = case("bouc_wen", OSCILLATOR | cases.LOOP, initial_state={"velocity": 1.0})
    run = simulate(element, sampled(2.0), {"force": 200.0 + 0 * sampled(2.0)})
    assert run["hysteresis"].max() == pytest.approx((1 / 0.95) ** 0.5, rel=1e-6)


def square(t):
    """+2 V for 3 s, then -2 V."""
    return np.where(t < 3.0 - 1e-9, 2.0, -2.0)


def piecewise(content, t):
    """The speed at the times t when each 0.2 s interval follows the model linearized on its own state."""
    reference, x, speed = Reference(content), np.zeros(2), [0.0]
    per_update = round(0.2 / (t[1] - t[0]))
    for k in range((len(t) - 1) // per_update):
        u = float(square(t[k * per_update]))
        m = reference.linearize({"current": x[0], "speed": x[1]}, {"voltage": u})
        extended = np.zeros((3, 3))
        extended[:2] = np.column_stack([floats(m.A), floats(m.B)[:, 0] * u + floats(m.c)])
        step = expm(extended * (t[1] - t[0]))
        for _ in range(per_update):
            x = (step @ [*x, 1.0])[:2]
            speed.append(x[1])
    return np.array(speed)


def test_figure_4_has_the_published_numbers():
    """Design, section 4: both programs together, and the midpoint that the contract defines."""
    t = sampled(6.0)
    exact = simulate(CASES["motor"], t, {"voltage": square(t)})["speed"]
    free = simulate(case("dc_motor", MOTOR), t, {"voltage": square(t)})["speed"]
    start = piecewise(CASES["motor"], t)
    middle = piecewise({**CASES["motor"], "operating_point": "midpoint"}, t)

    def rmse(speed):
        return np.sqrt(np.mean((speed - exact) ** 2))

    assert [s[600] for s in (start, exact, free)] == pytest.approx([21.015, 20.954, 24.844], abs=1e-3)
    assert rmse(start) == pytest.approx(4.60, abs=0.01)
    assert rmse(free) == pytest.approx(3.59, abs=0.01)
    assert rmse(middle) == pytest.approx(0.26, abs=0.01)
