"""Servos: MJCF, BAM's JSON, Isaac Lab, URDF and SDF of a position-controlled joint, and on records of one."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from signlin_ros.export import export
from signlin_ros.export.bam_program import budget
from signlin_ros.export.loss import drive_of
from signlin_ros.export.matrix import servo_bench
from signlin_ros.export.python_text import loaded
from signlin_ros.model import Model
from signlin_ros.records import ModelData, read_for_model
from signlin_ros.simulation import simulate

RECORDS = Path(os.environ.get("SIGNLIN_DATA", Path(__file__).resolve().parents[2] / ".." / "shared" / "data")) / "servo"
LOADS = {"kappa_d": 0.2, "kappa_e": 0.1}


@pytest.fixture(scope="module")
def loaded_servo():
    return Model.load("xl330_servo").with_effect("load_dependent_friction", **LOADS)


def _percent(found):
    return found.loss.channels["speed"].percent


def test_mjcf_holds_the_loop_the_motor_and_the_arm(tmp_path):
    pytest.importorskip("mujoco")
    found = export(Model.load("xl330_servo"), "mjcf", tmp_path / "servo.xml")
    assert _percent(found) < 2.0
    assert "<position " in (tmp_path / "servo.xml").read_text()


def test_mjcf_has_the_nearest_friction_for_what_it_does_not_hold(loaded_servo, tmp_path):
    pytest.importorskip("mujoco")
    found = export(loaded_servo, "mjcf", tmp_path / "servo.xml")
    bare = export(Model.load("xl330_servo"), "mjcf", tmp_path / "bare.xml")
    assert any("stand for it, nearest on this run" in line for line in found.exported.lost)
    assert _percent(bare) < _percent(found) < 12.0  # dropped it would be more than twice that


@pytest.mark.parametrize(
    ("effect", "values", "variant"),
    [
        ("coulomb_friction", {"mu": 0.03}, "m1"),
        ("stribeck_friction", {"mu": 0.03, "excess": 0.02, "v_s": 1.0}, "m2"),
        ("load_dependent_friction", LOADS, "m5"),
        ("load_dependent_stribeck", {**LOADS, "excess": 0.5, "v_s": 1.0}, "m5"),
    ],
)
def test_bam_file_is_a_model_of_bam(tmp_path, effect, values, variant):
    model = servo_bench().with_effect(effect, **values)
    found = export(model, "bam", tmp_path / "servo.json")
    content = json.loads((tmp_path / "servo.json").read_text())
    assert (content["model"], content["actuator"]) == (variant, "xl330")
    assert {"kt", "R", "armature", "q_offset", "friction_base", "friction_viscous"} <= set(content)
    assert _percent(found) < (1.0 if variant in ("m1", "m2") else 15.0)


def test_budget_is_that_of_the_paper():
    p = {"friction_base": 0.01, "friction_stribeck": 0.02, "dtheta_stribeck": 0.5, "alpha": 2.0}
    assert budget(p, 0.3, -0.1, 0.0) == pytest.approx(0.03)
    assert budget(p, 0.3, -0.1, 0.5) == pytest.approx(0.01 + 0.02 * np.exp(-1.0))
    m5 = {**p, "load_friction_motor": 0.2, "load_friction_external": 0.1}
    assert budget(m5, 0.3, -0.1, 1e3) == pytest.approx(0.01 + 0.07)
    assert budget({"friction_base": 0.01, "load_friction_base": 0.2}, 0.3, -0.1, 0.0) == pytest.approx(0.01 + 0.08)


def test_isaac_lab_file_has_bams_configuration_where_that_holds_more(loaded_servo, tmp_path):
    simple = export(Model.load("xl330_servo"), "isaaclab", tmp_path / "simple.py")
    richer = export(loaded_servo, "isaaclab", tmp_path / "richer.py")
    assert simple.exported.settings["class"] == "ImplicitActuatorCfg"
    assert richer.exported.settings["class"] == "BamActuatorCfg"
    assert _percent(simple) < 1.0
    assert loaded(tmp_path / "richer.py")["DATA"]["load_friction_motor"] == 0.2
    assert "load_friction_motor" in (tmp_path / "richer.py").read_text().split("parameter_overrides")[1]


def test_urdf_holds_damping_and_friction(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    found = export(Model.load("xl330_servo"), "urdf", tmp_path / "servo.urdf")
    joint = mujoco.MjModel.from_xml_path(str(tmp_path / "servo.urdf"))
    assert joint.dof_frictionloss[0] == pytest.approx(0.018212)
    assert joint.dof_damping[0] == pytest.approx(0.005902 + 0.37005**2 / 3.49835)
    assert any("no actuator" in line for line in found.exported.lost)
    assert _percent(found) < 5.0


def test_sdf_is_written_and_not_run(tmp_path):
    found = export(Model.load("dc_motor").with_effect("linear_stiffness", k=0.1), "sdf", tmp_path / "m.sdf")
    text = (tmp_path / "m.sdf").read_text()
    assert "<friction>0.033</friction>" in text
    assert "<spring_stiffness>0.1</spring_stiffness>" in text
    assert "Gazebo" in found.loss.not_run


@pytest.mark.parametrize("target", ["bam", "isaaclab"])
def test_only_servos_are_exported_to_servo_formats(tmp_path, target):
    suffix = {"bam": ".json", "isaaclab": ".py"}[target]
    with pytest.raises(ValueError, match="holds the plant servo; found dc_motor"):
        export(Model.load("dc_motor"), target, tmp_path / f"m{suffix}")


@pytest.mark.skipif(not RECORDS.is_dir(), reason="needs the shared records of servos")
@pytest.mark.parametrize("gain", [100, 400])
def test_record_of_a_servo_drives_the_file_under_its_own_gain(tmp_path, gain):
    pytest.importorskip("mujoco")
    model = Model.load("xl330_servo")
    data = read_for_model(RECORDS / f"xl330_kp{gain}_sin_sin.json", model)
    found = export(model, "mjcf", tmp_path / "servo.xml", data)
    position = found.loss.channels["position"]
    assert found.loss.against == "the measurement"
    assert position.difference < 0.15 * position.ours  # the supply varies in the record, not in the file
    assert f"kp = {gain} -" in (tmp_path / "servo.xml").read_text()


def test_units_of_a_record_say_that_the_axis_turns(tmp_path):
    t = np.arange(0.0, 2.0, 0.01)
    rows = np.column_stack([t, 0.3 * np.sin(3 * t), 0.1 * np.cos(3 * t)])
    path = tmp_path / "run.csv"
    np.savetxt(path, rows, delimiter=",", header="t,displacement [rad],force [N·m]", comments="", encoding="utf-8")
    model = Model.load("mass_spring_damper")
    export(model, "urdf", tmp_path / "turns.urdf", read_for_model(path, model))
    assert 'type="continuous"' in (tmp_path / "turns.urdf").read_text()
    export(model, "urdf", tmp_path / "slides.urdf")
    assert 'type="prismatic"' in (tmp_path / "slides.urdf").read_text()


def test_friction_that_grows_with_the_load_is_exported_with_its_equations(loaded_servo, tmp_path):
    found = export(loaded_servo, "casadi", tmp_path / "servo.py")
    assert _percent(found) < 2.0


@pytest.mark.parametrize("moving", [0.0, 2.0])
def test_a_speed_that_nobody_measured_begins_as_the_exact_model_follows_it(moving):
    model = Model.load("xl330_servo")
    t = np.arange(0.0, 2.0, 0.01)
    u = np.tile([0.8, 1.0, 7.4], (t.size, 1))  # goal, torque on, supply
    run = simulate(model, t, u, np.array([0.0, moving]))
    measured = {"position": run["position"]}
    data = ModelData(t, u, measured, None, model.inputs, model.states, model.units)
    drive = drive_of(model, data)
    found = simulate(model, t, u, drive.x0)["position"]
    resting = simulate(model, t, u, np.zeros(2))["position"]
    error, without = (np.sqrt(np.mean((one - run["position"]) ** 2)) for one in (found, resting))
    assert (drive.x0[1] == 0.0) == (moving == 0.0)
    assert error <= without
