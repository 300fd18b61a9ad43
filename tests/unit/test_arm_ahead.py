"""Short forward simulations of unseen motion: right against the exact simulation, and what they say of a law."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from signlin_ros.arms.ahead import Ahead, ForwardModel, Witness, _impulses, compared
from signlin_ros.arms.data import ArmRun
from signlin_ros.arms.foretold import forward_text
from signlin_ros.arms.laws import BASIC, EXTRA
from signlin_ros.arms.search import Key
from signlin_ros.arms.told import diagnosed_json, sentences
from signlin_ros.arms.verbs import diagnose
from signlin_ros.robots import mass_matrix
from signlin_ros.simulation import simulate
from tests.arm_records import record, small

MODEL, STEP = small(), 0.002
N = MODEL.robot.n


@dataclass
class Estimate:
    """Coefficients by name, the bodies those of the file."""

    design: SimpleNamespace
    theta: np.ndarray
    pi = MODEL.robot.pi
    rows = SimpleNamespace(n=N)


def forward(terms=(), **more):
    """Return the forward model of the small arm as its file has it, with more laws and columns."""
    values = {
        f"{i}.motor_inertia": MODEL.parameters[f"{name}.motor_inertia"] for i, name in enumerate(MODEL.robot.names)
    }
    for key, use in MODEL.effects.items():
        (law,) = (law for law in BASIC if law.effect == use.type)
        i = MODEL.arm_plant.place_of(key)
        values[f"{i}.{law.effect}.{law.linear}"] = use.parameters[law.linear]
    values |= more
    basic = [(i, law) for i in range(N) for law in BASIC]
    pieces = [SimpleNamespace(motors=MODEL.arm_plant.places)]
    state = SimpleNamespace(
        robot=MODEL.robot,
        carried=0.0,
        kept=(),
        rows=SimpleNamespace(pieces=pieces),
        friction=lambda _: (
            [(i, law, 0.0, values.get(f"{i}.{law.effect}.{law.linear}", 0.0)) for i, law in basic]
            + [(key.at, law, key.shape, values[f"{key.at}.{key.law}"]) for key, law in terms]
        ),
        body=lambda _: MODEL.robot.pi,
        point=lambda _: 0.0 * MODEL.robot.pi,
    )
    estimate = Estimate(SimpleNamespace(names=tuple(values)), np.array(list(values.values())))
    return ForwardModel(state, estimate)


def test_the_mass_matrix_has_the_motors_in_it():
    q = np.random.default_rng(1).normal(size=(5, N))
    inertias = np.diag([MODEL.parameters[f"{name}.motor_inertia"] for name in MODEL.robot.names])
    np.testing.assert_allclose(forward().mass(q), mass_matrix(MODEL.robot, q) + inertias, atol=1e-12)


@pytest.mark.slow
def test_windows_follow_the_models_exact_simulation():
    """From the same state under the same efforts, joints that stop and stick in between."""
    t = np.arange(0.0, 0.6, STEP)
    u = np.stack([1.5 * np.sin(9 * t), 8.0 * np.cos(7 * t), 2.0 * np.sin(11 * t + 1)], axis=1)
    start = np.array([0.1, 0.4, -0.5, 0.3, -0.2, 0.4])
    exact = simulate(MODEL, t, u, x0=start)
    velocities = exact.x[:, N:]
    assert (np.abs(velocities).min(axis=0) < 1e-9).any()
    shown = forward().velocities(start[None, :N], start[None, N:], np.zeros((1, N)), u[:-1, None], STEP)
    left = np.sqrt(np.mean((shown[:, 0] - velocities[1:]) ** 2, axis=0))
    assert (left < 0.02 * velocities.std(axis=0)).all()


def test_what_runs_away_is_held():
    key = Key("cubic_viscous_friction", 1)
    model = forward([(key, next(law for law in EXTRA if law.effect == key.law))], **{"1.cubic_viscous_friction": -5.0})
    q, v, tau = np.zeros((2, N)), np.full((2, N), 2.0), np.zeros((40, 2, N))
    shown = model.velocities(q, v, np.zeros((2, N)), tau, 0.01, np.full(N, 6.0))
    assert np.isfinite(shown).all()
    assert np.abs(shown).max() == 6.0


def test_dry_friction_holds_what_it_can_hold():
    rng = np.random.default_rng(2)
    A = rng.normal(size=(50, 3, 3))
    G = A @ np.swapaxes(A, 1, 2) + 2.0 * np.eye(3)
    speed, largest = rng.normal(size=(50, 3)), np.full((50, 3), 0.3)
    impulse = _impulses(speed, G, largest)
    after = speed - np.einsum("wij,wj->wi", G, impulse)
    assert (np.abs(impulse) <= largest + 1e-12).all()
    sticks = np.abs(impulse) < largest - 1e-6
    assert sticks.any()
    assert not sticks.all()
    assert np.abs(after[sticks]).max() < 1e-3
    slides = ~sticks & (np.abs(after) > 1e-3)
    assert (np.sign(after[slides]) == np.sign(impulse[slides])).all()


@pytest.mark.parametrize("law", EXTRA, ids=lambda law: law.effect)
def test_a_law_needs_on_both_sides_what_its_force_says(law):
    key = Key(law.effect, 1, 0.5 if law.shape else 0.0)
    model, plain = forward([(key, law)], **{f"1.{law.effect}": 0.3}), forward()
    q, v = np.full((2, N), 0.6), np.array([[0.2, 0.7, 0.1], [0.2, -0.7, 0.1]])
    load = np.full((2, N), 4.0)
    needed = []
    for one in (model, plain):
        always, dry = one.friction(q, v, load)
        needed.append((always + dry * np.sign(v))[:, 1])
    speed = v[:, 1]
    expected = {
        "stribeck_friction": 0.3 * np.exp(-((speed / 0.5) ** 2)) * np.sign(speed),
        "cubic_viscous_friction": 0.3 * speed**3,
        "asymmetric_viscous_friction": 0.3 * np.abs(speed),
        "load_dependent_friction": 0.3 * 4.0 * np.sign(speed),
        "linear_stiffness": 0.3 * 0.6,
    }[law.effect]
    np.testing.assert_allclose(needed[0] - needed[1], expected, atol=1e-12)


def ahead(scale, seed=3):
    rng = np.random.default_rng(seed)
    squares = scale * rng.uniform(0.8, 1.2, size=(60, N))
    return Ahead(np.sqrt(squares.mean(axis=0)), squares, np.arange(60) // 3)


@pytest.mark.parametrize(
    ("scale", "says", "told"), [(0.5, "confirmed", "->"), (1.0, "undecided", "chance"), (1.5, "in question", "but")]
)
def test_windows_confirm_or_call_into_question(scale, says, told):
    witness = compared(ahead(1.0), ahead(scale, seed=4), 1)
    assert witness.says == says
    assert told in forward_text(witness, "rad/s")
    assert compared(ahead(1.0), ahead(scale, seed=4), -1).says == says


@pytest.mark.slow
def test_what_is_hidden_is_seen_ahead_and_what_is_said_is_what_the_table_says():
    truth = MODEL.with_effect("shoulder.load_dependent_friction", kappa_d=0.0, kappa_e=0.12)
    known, unseen = (
        ArmRun(t, q, v, u, "simulated", np.zeros(N)) for t, q, v, u in (record(truth, seed) for seed in (3, 4))
    )
    found = diagnose(MODEL, [known], [unseen], 6.0)
    (witness,) = found.witnesses
    assert witness.says == "confirmed"
    assert witness.with_ < 0.5 * witness.without
    content = diagnosed_json(found, "", "", [])
    joint, (entry,) = content["joints"]["shoulder"]["forward"], content["ranking"]
    assert joint["basic"] == pytest.approx(entry["forward"]["without"], rel=0.05)
    assert joint["model"] == pytest.approx(entry["forward"]["with"])
    assert entry["status"] == "confirmed"
    against = replace(witness, without=witness.with_, with_=witness.without, errors=-9.0)
    other = replace(found, witnesses=(against,))
    assert diagnosed_json(other, "", "", [])["ranking"][0]["status"] == "ambiguous"
    assert "in question" in sentences(other)[1]
    assert isinstance(against, Witness)
