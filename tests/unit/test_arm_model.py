"""Models of arms: files, names, errors, and the linearization joint by joint."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from signlin_ros.compiled import linear_function, scales, smooth_function
from signlin_ros.errors import InputError, ModelError
from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.simulation import simulate

SMALL = Path(__file__).parents[2] / "config/arm/small_arm.yaml"
MODEL = Model.load(SMALL)
RICH = (
    MODEL.with_effect("shoulder.load_dependent_friction", kappa_d=0.0, kappa_e=0.1)
    .with_effect("elbow.dahl_presliding", F_c=0.2, sigma=40.0)
    .with_effect("waist.gravity_load", A=0.4, q0=0.3)
)


def content(**changes):
    return {**MODEL.to_dict(), "robot": str(SMALL.with_suffix(".urdf")), **changes}


def points(model, count=100, seed=0):
    rng = np.random.default_rng(seed)
    n, m = len(model.states), len(model.inputs)
    for _ in range(count):
        x = rng.uniform(-2, 2, n)
        x[3:6] *= 10 ** rng.uniform(-5, 0.3, 3) * (rng.random(3) > 0.1)
        yield x, rng.uniform(-10, 10, m)


def test_names_and_units():
    assert MODEL.states[:4] == ("waist.position", "shoulder.position", "elbow.position", "waist.velocity")
    assert MODEL.inputs == ("waist.effort", "shoulder.effort", "elbow.effort")
    assert MODEL.units["elbow.velocity"] == "rad/s"
    assert MODEL.units["elbow.effort"] == "N·m"
    assert MODEL.value("elbow.coulomb_friction.mu") == 0.6
    assert MODEL.value("elbow.motor_inertia") == 0.03
    assert MODEL.par_declarations()["elbow.viscous_friction.b"].unit == "N·m·s/rad"


def test_a_file_is_written_and_read_without_loss(tmp_path):
    RICH.save(tmp_path / "new.yaml")
    again = Model.load(tmp_path / "new.yaml")
    assert again.effects == RICH.effects
    assert again.parameters == RICH.parameters
    assert again.states == RICH.states
    assert again.to_dict() == RICH.placed_in(tmp_path).to_dict()


def test_changes_make_new_models():
    other = MODEL.with_parameters({"elbow.coulomb_friction.mu": 0.9, "waist.motor_inertia": 0.2})
    assert (other.value("elbow.coulomb_friction.mu"), MODEL.value("elbow.coulomb_friction.mu")) == (0.9, 0.6)
    assert "elbow.coulomb_friction" not in MODEL.without_effect("elbow.coulomb_friction").effects
    with pytest.raises(ModelError, match=r"did you mean 'elbow.coulomb_friction.mu'"):
        MODEL.with_parameters({"elbow.coulomb_friction.my": 0.9})
    with pytest.raises(ModelError, match="no joint 'elbwo'"):
        MODEL.with_effect("elbwo.quadratic_drag")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"robot": "none.urdf"}, "none.urdf"),
        ({"elbwo": {}}, "elbwo: unknown key.*did you mean 'elbow'"),
        ({"joints": ["waist", "wrist"]}, "no joint 'wrist'"),
        ({"elbow": {"effort": {"unit": "A"}}}, "elbow.effort.gain: missing; an effort in A needs its N·m per A"),
        ({"elbow": {"effort": {"gain": 0.0}}}, "elbow.effort.gain: found 0"),
        ({"elbow": {"effort": {"side": "output"}}}, "allowed: motor, link"),
        ({"elbow": {"effects": {"columb_friction": {"mu": 1.0}}}}, "elbow.effects.columb_friction.*coulomb_friction"),
        ({"elbow": {"effects": {"coulomb_friction": {"mu": -1.0}}}}, "elbow.effects.coulomb_friction.mu: found -1"),
        ({"linearization": "optimal"}, "depend on where the joints' zeros are"),
        ({"payload": {"on": "tol", "m": 1.0}}, "no link 'tol'.*did you mean 'tool'"),
        ({"payload": {"on": "base", "m": 1.0}}, "'base' does not move"),
        ({"gravity": [0, 0]}, "gravity: found"),
        ({"couplings": {"c": {"joints": ["shoulder", "elbow"], "position": [1, 1, 1, 1]}}}, "independently"),
        ({"couplings": {"c": {"joints": ["shoulder", "hip"], "position": [1, 0, 1, 1]}}}, "no joint 'hip'"),
    ],
)
def test_what_is_wrong_with_a_file_is_said(changes, said):
    with pytest.raises(ModelError, match=said):
        Model.from_dict(content(**changes))


@pytest.mark.parametrize("method", ["per_joint", "jacobian"])
@pytest.mark.parametrize("model", [MODEL, RICH], ids=["given", "rich"])
def test_the_linear_model_is_exact_at_its_point(model, method):
    linearizer = Linearizer(model, method)
    for x, u in points(model):
        r = linearizer(x, u)
        assert np.abs((r.A @ x + r.B @ u + r.c - r.f) / (1 + np.abs(r.f))).max() < 1e-12


def test_the_jacobian_is_that_of_automatic_differentiation():
    model = MODEL.with_effect("elbow.dahl_presliding", F_c=0.2, sigma=40.0)  # no loads: these are held
    linearizer, smooth = Linearizer(model, "jacobian"), smooth_function(model.structure, model.sign_order)
    for x, u in points(model, 30):
        n, r = len(model.states), linearizer(x, u)
        flat = np.array(smooth(x, u, model.p, scales(model))).ravel()
        J = flat[n : n + n * n].reshape(n, n)
        assert np.abs(r.f - flat[:n]).max() < 1e-10 * (1 + np.abs(r.f).max())
        assert np.abs(r.A - J).max() < 1e-10 * np.abs(J).max()


def test_friction_enters_as_the_damper_that_it_is_at_its_velocity():
    frictionless = MODEL
    for key in MODEL.effects:
        frictionless = frictionless.without_effect(key)
    with_friction, without = Linearizer(MODEL), Linearizer(frictionless)
    x = np.array([0.3, -0.5, 0.8, 0.4, -0.7, 1.1])
    r, r0 = with_friction(x), without(x)
    force = np.linalg.solve((r.B[3:]), r.f[3:] - r0.f[3:])  # N·m of friction on each joint
    damping = np.linalg.solve(r.B[3:], r.A[3:, 3:] - r0.A[3:, 3:])
    # the rest of the difference is the rigid body's, at another acceleration: it acts through positions only
    assert np.allclose(damping, np.diag(force / x[3:]), atol=1e-9)


def test_a_does_not_depend_on_where_the_zeros_are():
    text = SMALL.with_suffix(".urdf").read_text()
    turned = text.replace('<origin xyz="0 0 0.1"/>', '<origin xyz="0 0 0.1" rpy="0 0 0.9"/>')
    turned = turned.replace('<origin xyz="0.35 0 0"/>', '<origin xyz="0.35 0 0" rpy="0 -0.4 0"/>')
    other = Model.from_dict(content(robot=turned))
    shift = np.array([-0.9, 0.0, 0.4, 0.0, 0.0, 0.0])
    for x, u in points(MODEL, 20):
        r, moved = Linearizer(MODEL)(x, u), Linearizer(other)(x + shift, u)
        assert np.abs(r.A - moved.A).max() < 1e-9
        assert np.abs(r.B - moved.B).max() < 1e-9
        assert np.abs(r.A[:, 0]).max() == 0.0  # nothing depends on the angle about gravity


def test_a_gain_turns_amperes_into_torques():
    model = Model.from_dict(content(elbow={"effort": {"gain": 8.0}}))
    assert model.units["elbow.effort"] == "A"
    x = np.zeros(6)
    assert np.allclose(Linearizer(model)(x).B[:, 2], 8.0 * Linearizer(_bare())(x).B[:, 2])


def _bare():
    return Model.from_dict(content(elbow={}))


def test_a_coupling_puts_the_motors_friction_on_both_joints():
    coupled = Model.from_dict(
        content(couplings={"wrist": {"joints": ["shoulder", "elbow"], "position": [30, 0, 30, 30]}})
    )
    x = np.array([0.1, 0.2, 0.3, 0.0, 0.5, -0.5])  # the elbow's motor stands still
    r, r0 = (
        Linearizer(coupled)(x),
        Linearizer(MODEL.without_effect("elbow.coulomb_friction").without_effect("elbow.viscous_friction"))(x),
    )
    inertia = np.linalg.inv(r.B[3:]) - np.linalg.inv(r0.B[3:])
    assert np.allclose(inertia, 0.03 * np.array([[0, 0, 0], [0, 1, 1], [0, 1, 0]]), atol=1e-12)
    x[5] = 0.5
    v = np.array([0.0, 1.0, 1.0])
    force = (
        np.linalg.inv(r.B[3:]) @ (Linearizer(coupled)(x).f[3:])
        - np.linalg.inv(r0.B[3:])
        @ (Linearizer(MODEL.without_effect("elbow.coulomb_friction").without_effect("elbow.viscous_friction"))(x).f[3:])
    )
    assert np.allclose(force, -v * (0.6 + 0.4 * 1.0), atol=1e-6)


def test_two_joints_stand_still_at_once():
    t = np.arange(0.0, 2.0, 0.002)
    u = np.column_stack([2.0 * np.sin(3 * t), np.zeros(t.size), np.zeros(t.size)])
    hanging = np.array([0.0, np.pi / 2, 0.0, 0.0, 0.0, 0.0])
    run = simulate(MODEL, t, u, x0=hanging)
    still = run.x[:, 3:] == 0.0
    assert still[:, 1:].all(axis=1).mean() > 0.05
    assert (run.x[1:][still[1:, 1] & still[:-1, 1], 1] == run.x[:-1][still[1:, 1] & still[:-1, 1], 1]).all()
    smooth = simulate(MODEL, t, u, x0=hanging, kind="smooth")
    assert np.abs(run.x[-1] - smooth.x[-1]).max() < 0.05


def test_another_method_is_refused_for_an_arm_and_per_joint_for_others():
    with pytest.raises(InputError, match="known for the plant arm"):
        Linearizer(MODEL, "optimal")
    with pytest.raises(InputError, match="known for the plant dc_motor"):
        Linearizer(Model.load("dc_motor"), "per_joint")


def test_friction_of_the_joint_itself_stays_with_it_beside_a_coupling():
    own = {"type": "viscous_friction", "b": 0.5, "at": "joint"}
    couplings = {"wrist": {"joints": ["shoulder", "elbow"], "position": [30, 0, 30, 30]}}
    elbow = {"effects": {"viscous_friction": {"b": 2.0}, "bearing": own}}
    model = Model.from_dict(content(couplings=couplings, elbow=elbow, shoulder={}, waist={}))
    assert Model.from_dict(model.to_dict()).to_dict() == model.to_dict()
    x = np.array([0.0, 0.3, -0.2, 0.0, 1.0, 0.5])
    r, r0 = Linearizer(model)(x), Linearizer(Model.from_dict(content(elbow={}, shoulder={}, waist={})))(x)
    damping = -np.linalg.solve(r.B[3:], r.A[3:, 3:]) + np.linalg.solve(r0.B[3:], r0.A[3:, 3:])
    assert np.allclose(damping, [[0, 0, 0], [0, 2.0, 2.0], [0, 2.0, 2.5]], atol=1e-9)


def test_a_joint_that_comes_to_rest_leaves_one_that_rests_alone():
    text = SMALL.with_suffix(".urdf").read_text()
    text = text.replace('<mass value="1.8"/>', '<mass value="1.9"/>').replace(
        '<mass value="1.0"/>', '<mass value="0.95"/>'
    )
    model, t = Model.from_dict(content(robot=text)), np.linspace(0.0, 0.01, 11)
    x0 = np.array([5.60216682e-03, 1.94155559, -6.48596885e-01, -3.58753736e-01, 7.65947757e-03, 0.0])
    run = simulate(model, t, np.tile([-1.00792342, 2.51494514, -1.02246243], (t.size, 1)), x0=x0, rtol=1e-5)
    assert [(surface, what) for _, surface, what in run.events] == [("shoulder.velocity", "stuck")]
    assert (run.x[7:, 4:] == 0.0).all()


def test_a_six_joint_arm_is_linearized_by_few_operations():
    """By the derivatives of the inverse dynamics: plain differentiation takes 15,600, and half a minute to start."""
    file = Path(os.environ.get("SIGNLIN_DATA", "../shared/data")) / "joints/ur10e.urdf"
    if not file.is_file():
        pytest.skip("needs the shared records")
    friction = {"effects": {"viscous_friction": {"b": 5.0}, "coulomb_friction": {"mu": 3.0}}}
    joints = (
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "elbow_joint",
        "wrist_1_joint",
        "wrist_2_joint",
        "wrist_3_joint",
    )
    model = Model.from_dict({"plant": "arm", "robot": str(file), **dict.fromkeys(joints, friction)})
    function, _ = linear_function(model.structure, 50, "per_joint")
    assert function.n_instructions() < 9000


def test_a_payload_is_read_as_the_documents_write_it(tmp_path):
    """YAML reads a bare `on` as true."""
    shutil.copy(SMALL.with_suffix(".urdf"), tmp_path / "small_arm.urdf")
    text = SMALL.read_text(encoding="utf-8")
    more = "    payload: {on: tool, m: 0.5, com: [0, 0, 0.1], tolerance: {m: 5.0, com: 0.1}}\n"
    (tmp_path / "arm.yaml").write_text(text.rstrip() + "\n" + more, encoding="utf-8")
    model = Model.load(tmp_path / "arm.yaml")
    assert (model.arm.payload.on, model.arm.payload.m) == ("tool", 0.5)
    model.save(tmp_path / "again.yaml")
    assert Model.load(tmp_path / "again.yaml").arm.payload == model.arm.payload
