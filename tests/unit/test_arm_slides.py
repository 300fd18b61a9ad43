"""Prismatic joints: a stroke of centimetres is motion, and friction is told of it as of a joint that turns."""

import numpy as np
import pytest

from signlin_ros.arms.check import check
from signlin_ros.arms.data import ArmRun, read_data
from signlin_ros.arms.notes import weigh
from signlin_ros.arms.study import study
from signlin_ros.arms.verbs import diagnose
from signlin_ros.model import Model
from signlin_ros.robots import inverse_dynamics
from tests.arm_records import reference

URDF = """<robot name="column">
  <link name="base"/>
  <joint name="turn" type="revolute"><parent link="base"/><child link="beam"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="50" velocity="5"/></joint>
  <link name="beam"><inertial><origin xyz="0.2 0 0"/><mass value="4"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.08" iyz="0" izz="0.08"/></inertial></link>
  <joint name="lift" type="prismatic"><parent link="beam"/><child link="tool"/><origin xyz="0.4 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-0.1" upper="0.1" effort="200" velocity="1"/></joint>
  <link name="tool"><inertial><origin xyz="0 0 -0.1"/><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.002"/></inertial></link>
</robot>"""
STROKE, MU = 0.03, np.array([1.5, 12.0])


def model(**lift):
    effects = {name: {"viscous_friction": {"b": 1.0}, "coulomb_friction": {"mu": 2.0}} for name in ("turn", "lift")}
    sections = {name: {"effects": own} for name, own in effects.items()}
    return Model.from_dict({"plant": "arm", "robot": URDF, **sections, **lift})


def run(seed, stroke):
    """Return a record of a column that turns and lifts: Coulomb and viscous friction, noisy sensors."""
    t, q, v, a = reference(seed, 24.0, 2)
    size = np.array([1.0, stroke / np.ptp(q[:, 1])])
    q, v, a = q * size, v * size, a * size
    friction = MU * np.tanh(v / (2e-3 * size)) + np.array([0.8, 30.0]) * v
    u = inverse_dynamics(model().robot, q, v, a) + np.array([0.1, 5.0]) * a + friction
    rng = np.random.default_rng(seed)
    shown = [x + s * rng.normal(size=x.shape) for x, s in ((q, 1e-5 * size), (v, 1e-3 * size), (u, [0.02, 0.1]))]
    return ArmRun(t, *shown, "column.csv", np.zeros(2))


@pytest.mark.parametrize(("stroke", "told"), [(STROKE, True), (0.002, False)])
def test_a_stroke_of_centimetres_is_motion(stroke, told):
    found = study(model(), [run(1, stroke)], [run(2, stroke)], 6.0)
    assert (1 not in found.barred) == told


def test_friction_that_the_file_leaves_out_is_told_of_a_joint_that_slides():
    found = diagnose(
        model(lift={"effects": {"viscous_friction": {"b": 30.0}}}), [run(1, STROKE)], [run(2, STROKE)], 6.0
    )
    (missing,) = found.missing
    assert (missing.joint, missing.effect) == (1, "coulomb_friction")
    assert missing.value == pytest.approx(MU[1], rel=0.05)
    assert found.found == ()


def test_a_weight_tells_a_lifts_gain_wherever_it_is():
    assert "off its axis" in weigh(prismatic=False)
    assert "off its axis" not in weigh(prismatic=True)


@pytest.mark.parametrize(
    ("scale", "wanted"),
    [
        ((1e3, 1e3), {"lift_position_in_mm"}),
        ((1e3, 1.0), {"lift_position_in_mm"}),
        ((1.0, 1e3), {"lift_velocity_in_mm"}),
        ((1.0, 1.0), set()),
    ],
    ids=["both", "position", "velocity", "none"],
)
def test_a_slide_in_millimetres_is_seen_and_cured(tmp_path, scale, wanted):
    one, names = run(1, 0.1), ("turn", "lift")
    shown = [one.q * [1.0, scale[0]], one.v * [1.0, scale[1]], one.tau]
    what = ("pos", "vel", "force")
    head = ",".join(["t [s]", *(f"{name}_{word}" for word in what for name in names)])
    path = tmp_path / "column.csv"
    np.savetxt(path, np.column_stack([one.t, *shown]), delimiter=",", header=head, comments="")
    records = read_data(model(), [str(path)], {})
    _, findings = check(model(), records)
    assert {f.cure for f in findings if f.severity == "refuse"} == wanted
    (cured,), left = check(model(), records, sorted(wanted))
    assert not any(f.open for f in left)
    np.testing.assert_allclose(cured.measured["lift.position"], one.q[:, 1])
    np.testing.assert_allclose(cured.measured["lift.velocity"], one.v[:, 1])
