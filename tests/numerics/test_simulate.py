"""Simulation against theory: exact solutions, orders, invariants. No number here is copied from a run."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from signlin_ros.effects import EFFECTS, Effect, register
from signlin_ros.errors import InputError, SimulationError
from signlin_ros.model import Model
from signlin_ros.par import Par
from signlin_ros.simulation import SmoothFlow, Stepper, simulate

MOTOR = {"R_a": 0.764, "L_a": 0.0026, "K_t": 0.0805, "K_m": 0.0805, "B": 0.0, "J": 0.0022}


def motor(**options: Any) -> Model:
    return Model.from_dict({"plant": "dc_motor", "parameters": MOTOR, **options})


def mass(m: float = 1.0, c: float = 0.0, k: float = 0.0, **options: Any) -> Model:
    return Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": m, "c": c, "k": k}, **options})


def slow_excitation(t: np.ndarray) -> np.ndarray:
    return (1.3 * np.sin(2 * np.pi * 0.2 * t) + 0.4 * np.sin(2 * np.pi * 1.1 * t))[:, None]


def stick_slip() -> Model:
    return motor(effects={"stribeck_friction": {"mu": 0.025, "excess": 0.03, "v_s": 2.5}})


def test_sliding_block_stops_where_and_when_it_should() -> None:
    mu, v0 = 0.7, 3.1
    model = mass(m=2.0, effects={"coulomb_friction": {"mu": mu}})
    t = np.array([0.0, 1.0, 20.0])
    run = simulate(model, t, np.zeros((3, 1)), [0.0, v0], rtol=1e-10)
    assert run["velocity"][-1] == 0.0
    assert run["displacement"][-1] == pytest.approx(2.0 * v0**2 / (2 * mu), rel=1e-9)
    stops = [when for when, _, what in run.events if what == "stuck"]
    assert stops == [pytest.approx(2.0 * v0 / mu, rel=1e-9)]


def test_coulomb_oscillator_loses_the_same_travel_every_half_cycle() -> None:
    mu, k = 0.5, 40.0
    model = mass(k=k, effects={"coulomb_friction": {"mu": mu}})
    half = np.pi / np.sqrt(k)
    t = np.arange(0, 9) * half
    q = simulate(model, t, np.zeros((9, 1)), [0.1, 0.0], rtol=1e-11)["displacement"]
    turning = [0.1]
    while abs(turning[-1]) > mu / k:
        turning.append(-np.sign(turning[-1]) * (abs(turning[-1]) - 2 * mu / k))
    assert q[: len(turning)] == pytest.approx(turning, abs=1e-9)
    assert np.all(q[len(turning) :] == q[-1])


def test_a_stuck_shaft_stands_exactly_still() -> None:
    model = motor(
        effects={
            "coulomb_friction": {"mu": 0.033},
            "constant_load": {"F0": 0.03},
            "gravity_load": {"A": 0.002},
        }
    )
    t = np.linspace(0, 20, 4001)
    run = simulate(model, t, np.zeros((t.size, 1)))
    assert np.all(run["speed"] == 0.0)
    assert np.all(run["position"] == 0.0)


def test_breakaway_happens_at_the_breakaway_level() -> None:
    """A force that rises in small steps starts a mass at the first step above mu + excess."""
    model = mass(effects={"stribeck_friction": {"mu": 1.0, "excess": 0.5, "v_s": 0.1}})
    t = np.arange(0, 2, 0.001)
    run = simulate(model, t, t[:, None])
    first = int(np.argmax(run["velocity"] != 0.0))
    assert t[first] == pytest.approx(1.502, abs=0.0015)


@pytest.mark.parametrize(
    "effects",
    [
        {"stribeck_friction": {"mu": 0.025, "excess": 0.03, "v_s": 2.5}},
        {"coulomb_friction": {"mu": 0.033}, "hard_stop": {"gap": 1.0, "k_s": 2.0}},
        {"dahl_presliding": {"F_c": 0.03, "sigma": 1.0}},
        {"coulomb_friction": {"mu": 0.03}, "backlash": {"gap": 0.05, "k": 5.0, "c": 0.01, "J": 1e-3}},
    ],
    ids="+".join,
)
def test_error_follows_the_tolerance_across_events(effects: dict[str, Any]) -> None:
    """Regressed over four decades of rtol, the error falls with it; second order would be a slope of 2/5."""
    model, t = motor(effects=effects), np.arange(0, 8, 0.005)
    u = slow_excitation(t)
    reference = simulate(model, t, u, rtol=1e-12).x
    tolerances = np.array([1e-5, 1e-6, 1e-7, 1e-8, 1e-9])
    errors = [np.abs(simulate(model, t, u, rtol=r).x - reference).max() for r in tolerances]
    slope = np.polyfit(np.log(tolerances), np.log(errors), 1)[0]
    assert slope > 0.7
    assert errors[1] < 1e-4 * np.abs(reference).max()


def test_the_sampling_of_the_record_does_not_matter() -> None:
    model = stick_slip()
    coarse = np.arange(0, 8, 0.02)
    fine = np.arange(0, 8, 0.02 / 16)
    u = slow_excitation(coarse)
    on_coarse = simulate(model, coarse, u, rtol=1e-10).x
    on_fine = simulate(model, fine, np.repeat(u, 16, axis=0)[: fine.size], rtol=1e-10).x[::16]
    assert np.abs(on_coarse - on_fine).max() < 1e-6


def test_stiction_in_a_stick_slip_motor_is_exactly_zero() -> None:
    t = np.arange(0, 16, 0.005)
    speed = simulate(stick_slip(), t, slow_excitation(t))["speed"]
    stuck = speed == 0.0
    assert 0.05 < stuck.mean() < 0.5
    assert np.abs(speed[~stuck]).min() > 0.0


def test_energy_is_conserved_on_an_elastic_stop() -> None:
    model = mass(k=10.0, effects={"hard_stop": {"gap": 0.05, "k_s": 500.0}})
    t = np.linspace(0, 10, 501)
    run = simulate(model, t, np.zeros((t.size, 1)), [0.0, 1.0], rtol=1e-10)
    over = np.maximum(np.abs(run["displacement"]) - 0.05, 0)
    energy = 0.5 * run["velocity"] ** 2 + 5.0 * run["displacement"] ** 2 + 250.0 * over**2
    assert energy == pytest.approx(np.full(t.size, 0.5), rel=1e-6)


class Rider(Effect):
    """A second mass that lies on the first and is carried along by dry friction."""

    name = "test_rider"
    equation = "-mu sign(v - v2), m2 v2' = mu sign(v - v2)"
    states = {"velocity": "Q/s"}
    mu = Par("F", nominal=1.0, doc="friction between the two")
    m2 = Par("F·s²/Q", nominal=1.0, positive=True, doc="mass of the rider")

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -p.mu * m.sign(x.velocity - x.own.velocity)

    def rates(self, m: Any, x: Any, p: Any) -> dict[str, Any]:
        return {"velocity": p.mu * m.sign(x.velocity - x.own.velocity) / p.m2}


@pytest.fixture
def rider() -> Any:
    register(Rider)
    yield Rider
    del EFFECTS["test_rider"]


LOADED = {"kappa_d": 0.3, "kappa_e": 0.0}
FRICTION_OF_LOAD = {"load_dependent_friction": LOADED}


def loaded_motor_reference(start: list[float], voltages: list[float], hold: float, step: float = 1e-5) -> np.ndarray:
    """States (T, 2) of `motor` with friction in proportion to its torque, by Runge and Kutta in tiny steps.

    Friction is weaker than the torque that it comes from, so that nothing ever sticks.
    """
    p, share = MOTOR, 1.0 - LOADED["kappa_d"]

    def rates(i: float, w: float, voltage: float) -> tuple[float, float]:
        torque = p["K_t"] * i
        against = torque if w == 0.0 else abs(torque) * np.sign(w)  # at rest friction opposes what drives
        return (voltage - p["R_a"] * i - p["K_m"] * w) / p["L_a"], (torque - (1.0 - share) * against) / p["J"]

    i, w = start
    states = [(i, w)]
    for voltage in voltages:
        for _ in range(round(hold / step)):
            a = rates(i, w, voltage)
            b = rates(i + step / 2 * a[0], w + step / 2 * a[1], voltage)
            c = rates(i + step / 2 * b[0], w + step / 2 * b[1], voltage)
            d = rates(i + step * c[0], w + step * c[1], voltage)
            i += step / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
            w += step / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
        states.append((i, w))
    return np.array(states)


@pytest.mark.parametrize(
    ("start", "voltages", "hold"),
    [
        ([0.0, 0.0], [4.0], 0.05),
        ([0.0, 0.0], [-4.0, -4.0], 0.3),
        ([0.0, 0.0], [0.0, 4.0, 0.0, -4.0], 0.05),
        ([0.0, 3.0], [0.0, -2.0, 1.0], 0.1),
        ([1e-6, 0.0], [4.0], 0.05),
    ],
)
def test_friction_that_is_zero_only_at_the_start_of_a_hold_acts(
    start: list[float], voltages: list[float], hold: float
) -> None:
    """Without a current there is neither torque nor friction: both grow while the input is held."""
    model = motor(effects=FRICTION_OF_LOAD)
    t, u = hold * np.arange(len(voltages) + 1), np.array([*voltages, 0.0])[:, None]
    run = simulate(model, t, u, start, rtol=1e-9)
    expected = loaded_motor_reference(start, voltages, hold)
    assert run.x == pytest.approx(expected, rel=1e-4, abs=1e-4)


def test_friction_from_nothing_is_exact() -> None:
    """While it turns forward, a motor with friction in proportion to its torque is one with a smaller K_t."""
    t, u = np.linspace(0.0, 2.0, 3), np.full((3, 1), 4.0)
    p = {**MOTOR, "B": 1e-3, "K_m": 0.09}
    run = simulate(motor(effects=FRICTION_OF_LOAD, parameters=p), t, u, rtol=1e-10)
    K_t = (1.0 - LOADED["kappa_d"]) * p["K_t"]
    A = [[-p["R_a"] / p["L_a"], -p["K_m"] / p["L_a"], 4.0 / p["L_a"]], [K_t / p["J"], -p["B"] / p["J"], 0.0], [0.0] * 3]
    expected = [(expm(np.array(A) * when) @ [0.0, 0.0, 1.0])[:2] for when in t]
    assert run.x == pytest.approx(np.array(expected), rel=1e-8)


@pytest.mark.parametrize(("k", "q0"), [(0.0, 0.0), (50.0, 0.0), (50.0, 0.1)])
def test_friction_of_a_load_that_begins_at_nothing(k: float, q0: float) -> None:
    """Forces and a spring that are exactly 0 at first; a stuck mass whose friction is taken away moves at once."""
    effects = {"load_dependent_friction": {"kappa_d": 0.9, "kappa_e": 0.1}}
    model, hold = mass(k=k, effects=effects), 0.05
    forces = [0.0, 5.0, 0.0] if q0 == 0.0 else [4.0, 0.0]

    def rates(_: float, x: np.ndarray, force: float) -> list[float]:
        spring = -k * x[0]
        return [x[1], force + spring - (0.9 * abs(force) + 0.1 * abs(spring)) * np.sign(x[1])]

    x, expected = np.array([q0, 0.0]), [np.array([q0, 0.0])]
    for force in forces:
        push = force - k * x[0]
        if abs(push) > 0.9 * abs(force) + 0.1 * abs(k * x[0]) or x[1] != 0.0:
            offset = [0.0, 1e-12 * np.sign(push) if x[1] == 0.0 else 0.0]
            ends = {"rtol": 1e-10, "atol": 1e-14, "max_step": 1e-3, "args": (force,)}
            x = solve_ivp(rates, (0.0, hold), x + offset, method="DOP853", **ends).y[:, -1]
        expected.append(x)
    t, u = hold * np.arange(len(forces) + 1), np.array([*forces, 0.0])[:, None]
    run = simulate(model, t, u, [q0, 0.0], rtol=1e-10)
    assert run.x == pytest.approx(np.array(expected), rel=1e-6, abs=1e-8)


class Clamp(Effect):
    """A clamp that closes at a constant rate, from open at the start."""

    name = "test_clamp"
    equation = "-grip |z| sign(v), z' = 1"
    states = {"z": "s"}
    grip = Par("F/s", nominal=1.0, doc="growth of the friction")

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -p.grip * m.abs(x.own.z) * m.sign(x.velocity)

    def rates(self, m: Any, x: Any, p: Any) -> dict[str, Any]:
        return {"z": 1.0}


@pytest.fixture
def clamp() -> Any:
    register(Clamp)
    yield Clamp
    del EFFECTS["test_clamp"]


SLOPE = 4.0 * MOTOR["K_t"] / MOTOR["L_a"]
"""How fast the torque of `motor` begins to grow under 4 V, in N·m/s."""


@pytest.mark.parametrize("voltage", [4.0, -4.0])
def test_friction_that_grows_faster_than_the_torque_holds_from_the_first_moment(
    clamp: type[Effect], voltage: float
) -> None:
    model = motor(effects={"test_clamp": {"grip": 1.001 * SLOPE}}, with_position=True)
    run = simulate(model, [0.0, 0.1, 0.2], np.full((3, 1), voltage))
    assert np.all(run["speed"] == 0.0)
    assert np.all(run["position"] == 0.0)
    assert run["current"] == pytest.approx(voltage / 0.764 * -np.expm1(-0.764 / 0.0026 * run.t), rel=1e-5)


def test_friction_that_grows_more_slowly_than_the_torque_lets_go_at_once(clamp: type[Effect]) -> None:
    """Before the current saturates, J w = (slope - grip) t^2 / 2."""
    model, grip = motor(effects={"test_clamp": {"grip": 0.9 * SLOPE}}), 0.9 * SLOPE
    run = simulate(model, [0.0, 1e-6], np.full((2, 1), 4.0), rtol=1e-10)
    assert MOTOR["J"] * run["speed"][-1] == pytest.approx((SLOPE - grip) * 1e-12 / 2, rel=1e-2)


def test_friction_that_passes_through_zero_later(clamp: type[Effect]) -> None:
    """A clamp that opens, lets the shaft go when the torque wins, and closes again behind it."""
    model = mass(effects={"test_clamp": {"grip": 2.0}})
    t = np.linspace(0.0, 4.0, 9)
    run = simulate(model, t, np.ones((t.size, 1)), [0.0, 0.0, -2.0], rtol=1e-10)
    assert np.all(run["velocity"][t <= 1.5] == 0.0)  # 2 |t - 2| >= 1
    stop = 2.5 + np.sqrt(0.5)  # v = 1/4 + 1/4 at 2.5, then v' = 1 - 2 (t - 2) = -2 (t - 2.5)
    assert run["velocity"][4] == pytest.approx(0.25, rel=1e-8)
    assert run["velocity"][5] == pytest.approx(0.5, rel=1e-8)
    assert [when for when, name, what in run.events if what == "stuck"][-1] == pytest.approx(stop, rel=1e-8)
    assert run["velocity"][-1] == 0.0


def test_friction_that_is_gone_for_a_moment_while_nothing_pushes(clamp: type[Effect]) -> None:
    model = mass(effects={"test_clamp": {"grip": 2.0}})
    t = np.array([0.0, 1.0, 2.0, 3.0])
    run = simulate(model, t, np.array([[0.0], [0.0], [1.9], [1.9]]), [0.3, 0.0, -1.0])
    assert np.all(run["velocity"] == 0.0)
    assert np.all(run["displacement"] == 0.3)


@pytest.mark.parametrize(("force", "together"), [(2.0, True), (6.0, False)])
def test_two_surfaces_at_once(rider: type[Effect], force: float, together: bool) -> None:
    """The rider sticks to the mass while mu carries it, else slips; the mass rubs on the ground too."""
    model = mass(effects={"coulomb_friction": {"mu": 0.5}, "test_rider": {"mu": 1.0, "m2": 1.0}})
    t = np.linspace(0, 1, 11)
    run = simulate(model, t, np.full((t.size, 1), force))
    if together:
        acceleration, rider_acceleration = (force - 0.5) / 2, (force - 0.5) / 2
    else:
        acceleration, rider_acceleration = force - 0.5 - 1.0, 1.0
    assert run["velocity"] == pytest.approx(acceleration * t, rel=1e-9, abs=1e-12)
    assert run["test_rider.velocity"] == pytest.approx(rider_acceleration * t, rel=1e-9, abs=1e-12)


def test_both_surfaces_stick_under_a_small_force(rider: type[Effect]) -> None:
    model = mass(effects={"coulomb_friction": {"mu": 0.5}, "test_rider": {"mu": 1.0, "m2": 1.0}})
    run = simulate(model, [0.0, 1.0], [[0.4], [0.4]])
    assert np.all(run.x == 0.0)


def test_signs_that_multiply_are_refused() -> None:
    class Bad(Effect):
        """Not affine in the sign."""

        name = "test_bad"
        equation = "sign(v) sign(q)"

        def force(self, m: Any, x: Any, p: Any) -> Any:
            return m.sign(x.velocity) * m.sign(x.position)

    register(Bad)
    try:
        with pytest.raises(InputError, match="affine"):
            _ = mass(effects={"test_bad": {}}).states
    finally:
        del EFFECTS["test_bad"]


def test_smooth_error_follows_the_tolerance() -> None:
    model, t = stick_slip().with_options(sign_scale=0.5), np.arange(0, 4, 0.005)
    u = slow_excitation(t)
    reference = simulate(model, t, u, kind="smooth", rtol=1e-11).x
    tolerances = np.array([1e-4, 1e-5, 1e-6, 1e-7])
    errors = [np.abs(simulate(model, t, u, kind="smooth", rtol=r).x - reference).max() for r in tolerances]
    assert np.polyfit(np.log(tolerances), np.log(errors), 1)[0] > 0.7


def test_smooth_tends_to_exact_as_the_order_grows() -> None:
    """Away from standstill |1 - |sign_j|| falls exponentially in j; crossings leave 1/j."""
    model, t = motor(effects={"coulomb_friction": {"mu": 0.033}}), np.arange(0, 4, 0.005)
    u = 2.0 * np.sign(np.sin(np.pi * t + 1e-9))[:, None]
    exact = simulate(model, t, u).x
    errors = [
        np.abs(simulate(model.with_options(sign_order=j), t, u, kind="smooth").x - exact).max()
        for j in (100, 400, 1600)
    ]
    assert errors[2] < errors[1] / 2 < errors[0] / 4


def test_a_linear_system_is_piecewise_exact() -> None:
    model = mass(c=0.6, k=40.0)
    t = np.arange(0, 3, 0.01)
    u = np.cos(3 * t)[:, None]
    run = simulate(model, t, u, [0.1, -0.2], kind="piecewise")
    a = np.array([[0, 1, 0], [-40, -0.6, 1], [0, 0, 0]])
    step, x = expm(a * 0.01), np.array([0.1, -0.2])
    for k in range(1, t.size):
        x = (step @ [*x, u[k - 1, 0]])[:2]
    assert run.x[-1] == pytest.approx(x, rel=1e-10)
    assert simulate(model, t, u, [0.1, -0.2], rtol=1e-10).x == pytest.approx(run.x, abs=1e-8)


def test_midpoint_flow_and_jacobian_of_a_stiff_model() -> None:
    """Order 10,000 is far too stiff for an explicit method; one half period takes the sliding solution."""
    model = motor(effects={"coulomb_friction": {"mu": 0.033}}, sign_order=10_000)
    x = SmoothFlow(model, 0.1)(np.array([0.0, 0.0]), np.array([0.2]))
    assert abs(x[1]) < 1e-3
    assert x[0] == pytest.approx(0.2 / 0.764, rel=1e-2)


def test_an_input_delay_shifts_the_input() -> None:
    t = np.arange(0, 2, 0.01)
    u = slow_excitation(t)
    plain = motor(effects={"coulomb_friction": {"mu": 0.033}})
    late = plain.with_effect("input_delay", T=0.03)
    shifted = np.concatenate([np.repeat(u[:1], 3, axis=0), u[:-3]])
    assert simulate(late, t, u).x == pytest.approx(simulate(plain, t, shifted).x, abs=1e-9)
    assert late.delay == 0.03


@pytest.mark.parametrize(
    ("hold", "weights"),
    [("forward", (1.0, 0.0)), ("centred", (0.5, 0.5)), ("backward", (0.0, 1.0)), (0.2, (0.8, 0.2)),
     ("linear", (0.5, 0.5)), ("auto", (1.0, 0.0))],
)  # fmt: skip
def test_when_an_input_acts(hold: str | float, weights: tuple[float, float]) -> None:
    rng = np.random.default_rng(1)
    t, u = np.cumsum(rng.uniform(0.01, 0.03, 50)), rng.normal(size=50)
    model = Model.from_dict(
        {"plant": "mass_spring_damper", "parameters": {"m": 2.0, "c": 0.0, "k": 0.0}, "input_hold": hold}
    )
    impulse = np.diff(t) * (weights[0] * u[:-1] + weights[1] * u[1:])
    for kind in ("exact", "smooth"):
        run = simulate(model, t, u, kind=kind)
        np.testing.assert_allclose(run["velocity"][1:], np.cumsum(impulse) / 2.0, atol=1e-9)
    assert Model.from_dict(model.to_dict()).input_hold == hold


@pytest.mark.parametrize("kind", ["exact", "smooth"])
def test_an_interpolated_input_moves_a_mass_as_a_straight_line_does(kind: str) -> None:
    """Travel by straight lines between uneven samples, in closed form; held in halves they lead elsewhere."""
    rng = np.random.default_rng(2)
    t, u = np.cumsum(rng.uniform(0.01, 0.03, 50)), rng.normal(size=50)
    model = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 2.0, "c": 0.0, "k": 0.0}})
    h, q, v = np.diff(t), [0.0], [0.0]
    for step, a, b in zip(h, u, u[1:], strict=False):
        q.append(q[-1] + v[-1] * step + (a / 2 + (b - a) / 6) * step**2 / 2.0)
        v.append(v[-1] + (a + b) / 2 * step / 2.0)
    run = simulate(model.with_options(input_hold="linear"), t, u, kind=kind, rtol=1e-10)
    np.testing.assert_allclose(run["velocity"], v, atol=1e-10)
    np.testing.assert_allclose(run["displacement"], q, atol=1e-10)
    np.testing.assert_array_equal(run.u[:, 0], u)
    halves = simulate(model.with_options(input_hold="centred"), t, u, kind=kind, rtol=1e-10)
    assert np.abs(halves["displacement"] - q).max() > 1e-7


@pytest.mark.parametrize("kind", ["exact", "smooth"])
def test_a_stepper_continues_where_it_stopped(kind: str) -> None:
    model = stick_slip().with_effect("input_delay", T=0.013)
    t = np.arange(0, 2, 0.01)
    u = slow_excitation(t)
    whole = simulate(model, t, u, kind=kind, rtol=1e-9)
    stepper = Stepper(model, kind=kind, rtol=1e-9)
    parts = [stepper.advance(0.01, u[k]).copy() for k in range(t.size - 1)]
    assert np.array(parts) == pytest.approx(whole.x[1:], abs=1e-6)


def test_imposed_motion_gives_the_force_of_a_hysteretic_damper() -> None:
    """At constant velocity a Dahl element tends to F_c; the force needed is the opposite of its own."""
    model = Model.from_dict(
        {
            "plant": "force_element",
            "parameters": {"c": 2.0, "k": 0.0},
            "effects": {"dahl_presliding": {"F_c": 10.0, "sigma": 1e4}},
        }
    )
    t = np.linspace(0, 1, 101)
    run = simulate(model, t, np.full((101, 1), 0.1))
    assert run["force"] == pytest.approx(0.2 + 10.0 * (1 - np.exp(-1e3 * 0.1 * t)), rel=1e-5)


def test_a_run_that_diverges_says_when() -> None:
    model = mass(k=1.0, effects={"cubic_stiffness": {"k3": -1000.0}})
    with pytest.raises(SimulationError, match=r"stops at t = [0-9.]+ s: it diverges"):
        simulate(model, [0.0, 100.0], [[1.0], [1.0]], [1.0, 1.0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0.0, 0.0], [[0.0], [0.0]]), "increase"),
        (([0.0, 1.0], [[0.0], [np.nan]]), "finite"),
        (([0.0, 1.0], [[0.0, 1.0], [0.0, 1.0]]), r"u \(T, 1\)"),
        (([0.0, 1.0], [[0.0], [0.0]], [1.0]), r"x0 \(2,\)"),
        (([0.0, 1.0], [[0.0], [0.0]], None, "euler"), "known: exact"),
        (([0.0, 1.0], [[0.0], [0.0]], None, "exact", 0.0), "rtol"),
    ],
)
def test_bad_arguments_are_refused(arguments: tuple[Any, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        simulate(motor(), *arguments)


def test_friction_comes_back_after_an_imposed_velocity_was_zero():
    settings = {"plant": "force_element", "parameters": {"c": 100.0, "k": 0.0}}
    model = Model.from_dict({**settings, "effects": {"coulomb_friction": {"mu": 50.0}}})
    t = np.arange(400) * 0.01
    v = np.where(t > 1, 0.4 * np.sin(2 * np.pi * t), 0.0)
    force = simulate(model, t, v[:, None]).y[:, 0]
    moving = v != 0.0
    assert np.allclose(force[moving], (100 * v + 50 * np.sign(v))[moving])
