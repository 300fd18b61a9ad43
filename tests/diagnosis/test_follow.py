"""The compiled loop of the diagnosis: its paths against the simulation, its sensitivities against differences."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.follow.equations import equations, neutral_sensors
from signlin_ros.follow.loop import NONE_LATE, _allocated, follow
from signlin_ros.follow.steps import padded
from signlin_ros.model import Model
from signlin_ros.simulation import simulate

T, DT = 1200, 0.005
TIMES = np.arange(T) * DT
INPUT = (4 * np.sign(np.sin(2 * np.pi * 0.7 * TIMES)) + 2 * np.sin(2 * np.pi * 1.7 * TIMES))[:, None]
CHANNELS = ("current", "speed", "position")
SCALE = np.array([5.0, 20.0, 30.0, 1.0, 1.0, 1.0])
CASES = {
    "none": {},
    "coulomb_friction": {"mu": 0.033},
    "stribeck_friction": {"mu": 0.025, "excess": 0.02, "v_s": 2.0},
    "dahl_presliding": {"F_c": 0.03, "sigma": 1.0},
    "cogging_torque": {"A": 0.02, "N": 3.0, "phi": 0.3},
    "hard_stop": {"gap": 3.0, "k_s": 1.0},
    "input_deadzone": {"d": 0.5},
    "input_delay": {"T": 0.0123},
    "load_dependent_friction": {"kappa_d": 0.1, "kappa_e": 0.0},
}


def motor(effect: str) -> Model:
    model = Model.load("dc_motor").without_effect("coulomb_friction").with_options(with_position=True)
    return model if effect == "none" else model.with_effect(effect, **CASES[effect])


def run(model, free=(), change=None, y=None, gains=None, lags=None, belief=None, scale=None):
    eq = equations(model.structure, CHANNELS, tuple(free))
    p = np.concatenate([model.p, neutral_sensors(3)])
    for name, shift in (change or {}).items():
        p[eq.parameters.index(name)] += shift
    delay = next((p[i] for i, name in enumerate(eq.parameters) if name == "input_delay.T"), 0.0)
    n, count = eq.sizes[0], eq.sizes[3]
    y = np.zeros((T, 3)) if y is None else y
    gains = np.zeros((1, n, 3)) if gains is None else gains
    E, D, X = np.zeros((T, 3)), np.zeros((T if free else 0, 3, padded(count))), np.zeros((T, n))
    lags, ringing = NONE_LATE if lags is None else lags, eq.ringing(p, SCALE[:n])
    scale, aware = SCALE[:n] if scale is None else scale, belief is not None
    arguments = (eq.flags(bool(free)), TIMES, INPUT, y, gains, np.zeros(n), p, scale, TIMES + delay, ringing, lags)
    filtered = (belief if aware else np.zeros((3, 0)), np.ones(3))
    assert follow(eq.calls(bool(free), aware), *arguments, *filtered, E, D, X) == T
    return E, D[:, :, :count], X


@pytest.mark.parametrize("effect", CASES)
def test_free_run_is_the_exact_simulation(effect):
    model = motor(effect)
    exact = simulate(model, TIMES, INPUT, rtol=1e-8).x
    _, _, found = run(model)
    error = np.sqrt(np.mean((found - exact) ** 2, axis=0)) / np.std(exact, axis=0)
    assert error[:3].max() < (5e-3 if effect == "load_dependent_friction" else 1e-3)  # |current| is a kink


def stiff(bristle: float) -> list[Model]:
    lugre = {"F_c": 0.03, "F_s": 0.05, "sigma1": 0.005, "sigma2": 1e-5, "v_s": 3.0}
    motors = [
        motor("none").with_effect("dahl_presliding", F_c=0.03, sigma=bristle),
        motor("none").with_effect("lugre_friction", sigma0=bristle, **lugre),
    ]
    assert all(m.states[3].endswith(".z") for m in motors)
    return motors


@pytest.mark.parametrize("bristle", [3.0, 5.0, 30.0])
@pytest.mark.parametrize("which", [0, 1])
def test_a_stiff_bristle_is_followed_in_fewer_substeps_than_its_rate_asks_for(bristle, which):
    model = stiff(bristle)[which]
    exact = simulate(model, TIMES, INPUT, rtol=1e-8).x
    fastest = bristle * np.abs(exact[:, 1]).max() / 0.05 * DT
    assert fastest > 8.0
    _, _, found = run(model)
    error = np.sqrt(np.mean((found - exact) ** 2, axis=0)) / np.std(exact, axis=0)
    assert error[:3].max() < 2e-4


@pytest.mark.parametrize("bristle", [6.8, 8.8, 13.6])
def test_a_stiff_and_damped_bristle_is_followed_whatever_the_scale_of_its_state(bristle):
    """In steps that its rate makes unstable the state grew 50 times in a sample: a point of a LuGre friction beside its
    estimate left 2200 more than that, since a bound on the rate of all else is large where a state's scale is.
    """
    law = {"F_c": 0.0316, "F_s": 0.038, "sigma0": bristle, "sigma1": 0.0045 * bristle, "sigma2": 0.0, "v_s": 3.0}
    model = motor("none").with_effect("lugre_friction", **law)
    exact = simulate(model, TIMES, INPUT, rtol=1e-8).x
    _, _, found = run(model, scale=np.array([5.0, 20.0, 30.0, 60.0]))
    error = np.sqrt(np.mean((found - exact) ** 2, axis=0)) / np.std(exact, axis=0)
    assert error[:3].max() < 2e-4


@pytest.mark.parametrize("bristle", [2.0, 13.6, 50.0])
def test_a_kalman_filter_follows_a_stiff_bristle(bristle):
    """From 8 N·m/rad on no step was short enough: Dahl's friction beside cogging diverged."""
    model = motor("cogging_torque").with_effect("dahl_presliding", F_c=0.03, sigma=bristle)
    exact = simulate(model, TIMES, INPUT, rtol=1e-8).x
    n = exact.shape[1]
    belief = np.stack([np.full(n, 1e-6), np.full(n, 1e-6), np.ones(n)])
    E, _, _ = run(model, y=exact[:, :3].copy(), gains=np.full((1, n, 3), 0.1), belief=belief)
    assert (np.sqrt(np.mean(E**2, axis=0)) / np.std(exact[:, :3], axis=0)).max() < 1e-3


@pytest.mark.parametrize("friction", [0.0, 0.033])
def test_a_current_that_is_over_within_a_sample_is_followed(friction):
    model = motor("none").with_parameters({"L_a": 2e-5})
    model = model.with_effect("coulomb_friction", mu=friction) if friction else model
    assert model.parameters["R_a"] / 2e-5 * DT > 100.0
    exact = simulate(model, TIMES, INPUT, rtol=1e-8).x
    _, _, found = run(model)
    error = np.sqrt(np.mean((found - exact) ** 2, axis=0)) / np.std(exact, axis=0)
    assert error.max() < 1e-3


@pytest.mark.parametrize("effect", [*CASES, 0, 1])
def test_sensitivities_are_those_of_finite_differences(effect):
    model = motor(effect) if effect in CASES else stiff(20.0)[effect]
    rng = np.random.default_rng(3)
    _, _, X = run(model)
    y = X[:, :3] * 1.05 + rng.normal(size=(T, 3)) * 0.01 * np.std(X[:, :3], axis=0)
    gains = np.zeros((1, X.shape[1], 3))
    gains[0, :3, :] = np.diag([0.1, 0.2, 0.3])
    free = [name for name in model.trace.parameters if name not in ("L_a", "B")]
    _, D, _ = run(model, free, y=y, gains=gains)
    for i, name in enumerate(free):
        h = 1e-5 * max(abs(model.value(name)), 1e-3)
        up, down = (run(model, change={name: s * h}, y=y, gains=gains)[0] for s in (1, -1))
        difference = (up - down) / (2 * h)
        if name == "load_dependent_friction.kappa_e":
            continue
        assert np.linalg.norm(D[:, :, i] - difference) < 0.06 * np.linalg.norm(difference), name  # trapezoidal rule


def test_a_late_sensor_shows_what_was():
    model = motor("none")
    _, _, X = run(model)
    lag = 0.0123
    fine = np.arange(0, TIMES[-1] + 1e-9, DT / 50)
    held = INPUT[np.minimum((fine / DT + 1e-6).astype(int), T - 1)]
    speed = simulate(model, fine, held, rtol=1e-9).x[:, 1]
    late = np.interp(TIMES - lag, fine, speed)
    E, _, _ = run(model, y=X[:, :3] * 0, lags=np.array([[0, 0, -1, 0], [lag, 1, -1, 0], [0, 2, -1.0, 0]]))
    assert np.max(np.abs(-E[5:, 1] - late[5:])) < 1e-3 * np.std(speed)


def test_a_late_sensor_shows_what_was_within_a_step_that_is_longer_than_the_motion_lasts():
    """A current that settles in a tenth of a step: a cubic between samples missed it by 26 % of its size."""
    model = motor("none").with_parameters({"L_a": 0.1 * DT * motor("none").value("R_a")})
    fine = np.arange(0, TIMES[-1] + 1e-9, DT / 50)
    held = INPUT[np.minimum((fine / DT + 1e-6).astype(int), T - 1)]
    current = simulate(model, fine, held, rtol=1e-9).x[:, 0]
    for lag in (0.3 * DT, 0.87 * DT, 2.6 * DT):
        E, _, _ = run(model, lags=np.array([[lag, 0, -1, 0], [0, 1, -1.0, 0], [0, 2, -1.0, 0]]))
        late = np.interp(TIMES - lag, fine, current)
        assert np.max(np.abs(-E[5:, 0] - late[5:])) < 0.02 * np.std(current)


def test_a_loop_that_yields_within_a_step_stays_within_what_it_yields_at():
    """With n = 3 and a way of ten yields in a sample the state left all bounds."""
    loop = {"alpha": 0.8, "D": 0.004, "lambda": 1.0, "beta": 0.5, "gamma": 0.5, "n": 3.0, "k": 0.05}
    model = Model.load("dc_motor").without_effect("coulomb_friction").with_options(with_position=True)
    _, _, X = run(model.with_effect("bouc_wen_hysteresis", **loop))
    assert np.abs(X[:, 1]).max() * DT > 10 * loop["D"]
    assert np.abs(X[:, 3]).max() < 1.1


def test_a_run_out_of_bounds_says_where():
    model = Model.load("mass_spring_damper").with_effect("cubic_stiffness", k3=-1e6)
    eq = equations(model.structure, ("displacement",), ())
    p = np.concatenate([model.p, neutral_sensors(1)])
    E, X = np.zeros((T, 1)), np.zeros((T, 2))
    arguments = (eq.flags(False), TIMES, 100 * INPUT, np.zeros((T, 1)), np.zeros((1, 2, 1)), np.zeros(2), p)
    rest = (np.ones(2), TIMES.copy(), np.inf, NONE_LATE, np.zeros((3, 0)), np.ones(1), E, np.zeros((0, 1, 0)), X)
    done = follow(eq.calls(False), *arguments, *rest)
    assert 0 < done < T


def test_the_loop_is_compiled_once_whoever_owns_the_record():
    """A second version, for arrays that may be written to, would cost a user nine seconds on a new machine."""
    model, frozen = motor("none"), np.zeros((T, 3))
    frozen.flags.writeable = False
    run(model)
    versions = len(_allocated.signatures)
    run(model, y=frozen)
    run(model, ["J"])
    assert len(_allocated.signatures) == versions
