"""Robots from URDFs: the tree, its errors, and the equations against Pinocchio, an independent program."""

import os
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from signlin_ros.errors import ModelError
from signlin_ros.robots import inverse_dynamics, mass_matrix, read_urdf, regressor
from signlin_ros.robots.inertia import (
    about_centre,
    from_pseudo_inertia,
    least_eigenvalue,
    least_eigenvalue_along,
    moved,
    pseudo_inertia,
)
from signlin_ros.robots.recorded import Factors, Recorded

SHARED = Path(os.environ.get("SIGNLIN_DATA", "../shared/data")) / "joints"
SMALL = Path(__file__).parents[2] / "config/arm/small_arm.urdf"
ARMS = {
    "ur10e.urdf": None,
    "tx40.urdf": None,
    "panda.urdf": [f"panda_joint{i}" for i in range(1, 8)],
    "tiago.urdf": ["torso_lift_joint", *(f"arm_{i}_joint" for i in range(1, 8))],
}
COUNT = 1000
PINOCCHIO_ORDER = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]


def states(n, count=COUNT, seed=1):
    rng = np.random.default_rng(seed)
    return rng.uniform(-2, 2, (count, n)), rng.uniform(-2, 2, (count, n)), rng.uniform(-5, 5, (count, n))


def urdf(name):
    file = SHARED / name
    if not file.is_file():
        pytest.skip("needs the shared records")
    return file


def oracle(file, robot, locked=None):
    pin = pytest.importorskip("pinocchio")
    model = pin.buildModelFromUrdf(str(file))
    at = pin.neutral(model)
    for name, value in (locked or {}).items():
        at[model.joints[model.getJointId(name)].idx_q] = value
    model = pin.buildReducedModel(model, [model.getJointId(n) for n in model.names[1:] if n not in robot.names], at)
    assert list(model.names[1:]) == list(robot.names)
    return pin, model, model.createData()


@pytest.mark.parametrize("name", ARMS)
def test_inverse_dynamics_and_its_regressor_are_those_of_pinocchio(name):
    file = urdf(name)
    robot = read_urdf(file, ARMS[name])
    pin, model, data = oracle(file, robot)
    q, v, a = states(robot.n)
    expected = np.array([pin.rnea(model, data, *x) for x in zip(q, v, a, strict=True)])
    assert np.abs(inverse_dynamics(robot, q, v, a) - expected).max() < 1e-10
    Y = np.array([pin.computeJointTorqueRegressor(model, data, *x).copy() for x in zip(q, v, a, strict=True)])
    own = regressor(robot, q, v, a)
    order = np.concatenate([10 * k + np.array(PINOCCHIO_ORDER) for k in range(robot.n)])
    assert np.abs(own[:, :, order] - Y).max() < 1e-10
    assert np.abs(own @ robot.pi - expected).max() < 1e-10


@pytest.mark.parametrize("name", ARMS)
def test_recorded_forward_dynamics_and_mass_matrix_are_those_of_pinocchio(name):
    file = urdf(name)
    robot = read_urdf(file, ARMS[name])
    pin, model, data = oracle(file, robot)
    n, (q, v, a) = robot.n, states(robot.n)
    if name == "tx40.urdf":  # the last link has no inertia: only its motor's makes the mass matrix invertible
        model.armature[:] = 0.3
    efforts = np.array([pin.rnea(model, data, *x) for x in zip(q, v, a, strict=True)])
    Q, V, U = (ca.SX.sym(s, n) for s in "qvu")
    recorded = Recorded(robot, ca.vertsplit(Q), ca.vertsplit(V))
    M = recorded.M + ca.diag(ca.DM(model.armature))
    function = ca.Function(
        "f", [Q, V, U], [ca.densify(M), Factors(M).solve(U - recorded.bias), recorded.inverse(ca.vertsplit(U))]
    )
    M_found, a_found, needed = function.map(COUNT)(q.T, v.T, efforts.T)
    expected = np.array([np.triu(pin.crba(model, data, x)) for x in q])
    expected += np.swapaxes(np.triu(expected, 1), 1, 2)
    found = np.array(M_found).reshape(n, COUNT, n).swapaxes(0, 1)
    assert np.abs(found - expected).max() < 1e-10
    assert np.abs(mass_matrix(robot, q) + np.diag(model.armature) - expected).max() < 1e-10
    aba = np.array([pin.aba(model, data, *x).copy() for x in zip(q, v, efforts, strict=True)])
    assert np.abs(np.array(a_found).T - aba).max() < 1e-10
    assert (
        np.abs(np.array(needed).T - inverse_dynamics(robot, q, v, efforts)).max() < 1e-8
    )  # accelerations of 400 rad/s²


def test_joints_that_are_not_named_are_locked_where_it_is_said():
    file = urdf("panda.urdf")
    locked = {"panda_joint4": -1.2, "panda_joint6": 0.7, "panda_finger_joint1": 0.02}
    robot = read_urdf(file, ["panda_joint1", "panda_joint2", "panda_joint3", "panda_joint5", "panda_joint7"], locked)
    pin, model, data = oracle(file, robot, locked | {"panda_finger_joint2": 0.0})
    q, v, a = states(robot.n, 50)
    expected = np.array([pin.rnea(model, data, *x) for x in zip(q, v, a, strict=True)])
    assert np.abs(inverse_dynamics(robot, q, v, a) - expected).max() < 1e-10


def test_the_order_of_the_joints_is_that_which_is_asked_for():
    robot, other = read_urdf(SMALL), read_urdf(SMALL, ["elbow", "waist", "shoulder"])
    q, v, a = states(3, 20)
    place = [2, 0, 1]
    expected = inverse_dynamics(robot, q, v, a)[:, place]
    assert np.abs(inverse_dynamics(other, q[:, place], v[:, place], a[:, place]) - expected).max() < 1e-12
    Y = regressor(other, q[:, place], v[:, place], a[:, place])
    assert np.abs(Y @ other.pi - expected).max() < 1e-12


def test_power_is_the_rate_of_the_energy():
    robot, dt = read_urdf(SMALL, gravity=(0, 0, 0)), 1e-6
    q, v, a = states(3, 200)

    def kinetic(q, v):
        return 0.5 * np.einsum("ti,tij,tj->t", v, mass_matrix(robot, q), v)

    rate = (kinetic(q + v * dt, v + a * dt) - kinetic(q - v * dt, v - a * dt)) / (2 * dt)
    power = (inverse_dynamics(robot, q, v, a) * v).sum(axis=1)
    assert np.allclose(rate, power, rtol=1e-6, atol=1e-6)


def test_a_tree_with_a_prismatic_joint():
    text = SMALL.read_text().replace('name="elbow" type="revolute"', 'name="elbow" type="prismatic"')
    text = text.replace('<parent link="upper_arm"/>', '<parent link="column"/>')
    robot = read_urdf(text)
    assert [j.parent for j in robot.joints] == [-1, 0, 0]
    assert robot.joints[2].effort_unit == "N"
    q, v, a = states(3, 20)
    M = mass_matrix(robot, q)
    assert np.allclose(M, np.swapaxes(M, 1, 2))
    assert np.allclose(M[:, 1, 2], 0.0)  # branches do not feel each other but through the column
    expected = inverse_dynamics(robot, q, v, a)
    assert np.allclose(regressor(robot, q, v, a) @ robot.pi, expected)


def test_a_payload_is_a_body_on_a_link():
    robot = read_urdf(SMALL)
    loaded = robot.with_body("tool", about_centre(2.0, [0.05, 0, 0], np.zeros((3, 3))))
    still = np.zeros((1, 3))
    fall = inverse_dynamics(loaded, still, still, still) - inverse_dynamics(robot, still, still, still)
    assert np.allclose(fall, [[0.0, -2 * 9.81 * (0.35 + 0.28 + 0.05), -2 * 9.81 * (0.28 + 0.05)]])


def test_inertial_parameters_move_with_their_frame_and_stay_consistent():
    rng = np.random.default_rng(3)
    root = rng.normal(size=(4, 4))
    pi = from_pseudo_inertia(root @ root.T)
    assert least_eigenvalue(pi) > 0
    assert np.allclose(from_pseudo_inertia(pseudo_inertia(pi)), pi)
    R, t = read_urdf(SMALL).joints[0].R, np.array([0.1, -0.2, 0.3])
    assert np.allclose(moved(moved(pi, R, t), R.T, -R.T @ t), pi)
    assert least_eigenvalue(moved(pi, R, t)) > 0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("robot", "sdf"), "the outermost element is <sdf>"),
        (('child link="forearm"', 'child link="arm"'), "found 2 root links"),
        (('xyz="0 1 0"', 'xyz="0 0 0"'), "the axis of 'shoulder' is 0 0 0"),
        (('<mass value="1.8"/>', ""), "<inertial> of link 'upper_arm' needs <mass>"),
        (('xyz="0.35 0 0"', 'xyz="${length} 0 0"'), "a xacro file has to be expanded first"),
        (('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><mimic joint="elbow"/>'), "mimics 'elbow'"),
        (('name="waist" type="revolute"', 'name="hook" type="floating"'), "'hook' is floating: a base that moves"),
    ],
)
def test_what_is_wrong_with_a_urdf_is_said(change, said):
    with pytest.raises(ModelError, match=said.replace("$", r"\$")):
        read_urdf(SMALL.read_text().replace(*change))


def test_a_rod_that_mimics_a_joint_may_be_fixed():
    """A rod of a parallelogram: one motor moves it too, so the way out is to carry it as part of its parent."""
    rod = """<link name="rod"><inertial><mass value="0.1"/>
    <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial></link><joint name="rod_joint"
    type="revolute"><parent link="upper_arm"/><child link="rod"/><axis xyz="0 1 0"/><mimic joint="elbow"/></joint>"""
    text = SMALL.read_text().replace("</robot>", f"{rod}</robot>")
    joints = ["waist", "shoulder", "elbow"]
    with pytest.raises(ModelError, match=r"'rod_joint' mimics 'elbow'.*type=\"fixed\""):
        read_urdf(text, joints)
    at = 'type="{}"><parent link="upper_arm"/><child link="rod"'
    fixed = read_urdf(text.replace(at.format("revolute"), at.format("fixed")), joints)
    masses = [sum(joint.pi[0] for joint in robot.joints) for robot in (fixed, read_urdf(SMALL))]
    assert masses[0] == pytest.approx(masses[1] + 0.1)


def test_a_misspelt_joint_is_told_with_the_nearest():
    with pytest.raises(ModelError, match=r"no joint 'elbo' that moves.*did you mean 'elbow'"):
        read_urdf(SMALL, ["waist", "elbo"])


def test_a_urdf_whose_inertia_cannot_be_is_told():
    text = SMALL.read_text().replace('ixx="0.002"', 'ixx="0.040"')  # larger than the two others together
    robot = read_urdf(text)
    assert list(robot.inconsistent()) == ["shoulder"]
    assert not read_urdf(SMALL).inconsistent()


def test_the_least_eigenvalue_grows_with_each_parameter_as_is_said():
    rng = np.random.default_rng(3)
    pi = about_centre(2.0, rng.normal(size=3), np.diag([0.02, 0.03, 0.04]))
    value, slope = least_eigenvalue_along(pi)
    assert value == pytest.approx(least_eigenvalue(pi), rel=1e-9)
    step = 1e-6 * np.eye(10)
    differences = [(least_eigenvalue(pi + s) - least_eigenvalue(pi - s)) / 2e-6 for s in step]
    np.testing.assert_allclose(slope, differences, atol=1e-6)
