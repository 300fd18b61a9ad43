"""The linearizer while it runs: another model, position alone, and its life cycle."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed: pip install 'signlin_ros[ros]'")

from lifecycle_msgs.srv import ChangeState, GetState
from std_msgs.msg import Float64MultiArray, String

from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.nodes import convert

CONFIGURE, CLEANUP, ACTIVATE, DEACTIVATE = 1, 2, 3, 4


PERIOD = 0.1
JITTER = 0.3
"""Of a state's stamp against the period's beginning, in update periods."""


def sizes(models: list[Any]) -> list[int]:
    return [int(message.data[4]) for message in models]


def test_a_whole_model_is_taken_at_once_and_a_bad_one_is_refused(graph: Any, tmp_path: Path) -> None:
    graph.start("plant_simulator", "input_signal:=square", "amplitude:=2", model=_with_position(tmp_path))
    graph.start("linearizer", f"update_period:={PERIOD}", "state_source:=joint_state")
    models, texts = graph.models(), graph.collect(String, "/linearizer/model_yaml", latched=True)
    graph.wait(lambda: len(models) >= 5 and texts, "models")
    better = Model.load("dc_motor").with_options(with_position=True, update_period=PERIOD)
    better = better.with_effect("dahl_presliding").with_parameters(J=0.0023)
    better.save(tmp_path / "better.yaml")
    (tmp_path / "bad.yaml").write_text("/**: {ros__parameters: {plant: dc_motor, parameters: {J: -1.0}}}")
    refused = graph.set_parameter("model_file", str(tmp_path / "bad.yaml"))
    assert not refused.successful
    assert "parameters.R_a: missing" in refused.reason
    taken = graph.set_parameter("model_file", str(tmp_path / "better.yaml"))
    assert taken.successful, taken.reason
    graph.wait(lambda: sizes(models)[-1] == 4, "a model of four states")
    graph.wait(lambda: sizes(models).count(4) >= 10, "ten of them")
    updates = [convert.read_model(message) for message in models]
    first = updates[0].sequence
    assert [u.sequence for u in updates] == list(range(first, first + len(updates)))
    assert Model.from_dict(_parameters(texts[-1].data)) == Model.from_dict(better.to_dict())
    core = Linearizer(better)
    for update in updates[-5:]:
        np.testing.assert_array_equal(update.result.A, core(update.result.x, update.result.u).A)
    from rcl_interfaces.srv import ListParameters

    names = graph.call(ListParameters, "/linearizer/list_parameters", ListParameters.Request()).result.names
    assert "effects.dahl_presliding.sigma" in names
    assert graph.set_parameter("model_file", "").successful
    graph.wait(lambda: sizes(models)[-1] == 2, "the first model again")


def gap(models: list[Any]) -> float:
    """The longest time without a model between the stamps of models, in update periods."""
    return float(np.max(np.diff([convert.read_model(message).stamp for message in models]))) / 1e9 / PERIOD - 1.0


def test_another_model_leaves_a_gap_of_at_most_one_update_period(graph: Any, tmp_path: Path) -> None:
    """Beyond the gaps that a busy machine leaves just before, where nothing changes."""
    graph.start("plant_simulator", "input_signal:=square", "amplitude:=2", model=_with_position(tmp_path))
    graph.start("linearizer", f"update_period:={PERIOD}", "state_source:=joint_state")
    models = graph.models()
    graph.wait(lambda: len(models) >= 5, "models")
    lost = []
    for effect in ("dahl_presliding", "lugre_friction", "backlash"):  # each is compiled anew
        better = Model.load("dc_motor").with_options(with_position=True, update_period=PERIOD).with_effect(effect)
        better.save(tmp_path / f"{effect}.yaml")
        usual = len(models) - 1
        graph.wait(lambda k=usual: len(models) > k + 10, "models without a change")
        before, size = len(models) - 1, len(better.states)
        taken = graph.set_parameter("model_file", str(tmp_path / f"{effect}.yaml"))
        assert taken.successful, taken.reason
        graph.wait(lambda n=size, k=before: sizes(models[k:]).count(n) >= 3, f"models with {effect}")
        lost.append(gap(models[before:]) - max(gap(models[usual : before + 1]) - JITTER, 0.0))
        assert graph.set_parameter("model_file", "").successful
        graph.wait(lambda: sizes(models)[-1] == 2, "the first model again")
    assert min(lost) < 1.0 + JITTER, f"{lost} update periods without a model"


def test_position_alone_is_enough(graph: Any, tmp_path: Path) -> None:
    from sensor_msgs.msg import JointState

    model = _with_position(tmp_path)
    graph.start("plant_simulator", "input_signal:=sine", "amplitude:=3", "input_period:=2.0", model=model)
    graph.start("linearizer", "update_period:=0.05", "state_source:=joint_state", model=model, namespace="/blind")
    models = graph.models("/blind/linearizer")
    joints, inputs = graph.collect(JointState, "/joint_states"), graph.collect(Float64MultiArray, "/input")
    out = graph.publisher(JointState, "/blind/joint_states")
    out_u = graph.publisher(Float64MultiArray, "/blind/input")
    sent, truth = 0, {}

    def forward() -> bool:
        nonlocal sent
        for k in range(sent, min(len(joints), len(inputs))):
            message, sent = joints[k], k + 1
            stamp = convert.nanoseconds(message.header.stamp)
            truth[stamp] = float(message.velocity[0])
            message.velocity, message.effort = [], []
            out_u.publish(inputs[k])
            out.publish(message)
        return len(models) >= 60

    graph.wait(forward, "60 models")
    pairs = [(convert.read_model(m), truth.get(convert.read_model(m).stamp)) for m in models[20:]]
    errors = np.array([abs(u.result.x[1] - speed) for u, speed in pairs if speed is not None])
    assert errors.size > 20
    largest = max(map(abs, truth.values()))
    assert np.median(errors) < 0.01 * largest  # with messages that come unevenly, the more so beside other work


def test_a_driver_that_leaves_stamps_empty_and_whose_effort_is_the_input(graph: Any, tmp_path: Path) -> None:
    from diagnostic_msgs.msg import DiagnosticArray
    from sensor_msgs.msg import JointState

    model = Model.load("mass_spring_damper").with_options(operating_point="midpoint", update_period=0.05)
    model.save(tmp_path / "mass.yaml")
    source = ("state_source:=joint_state", "joint_name:=slide", "stamps:=reception", "state_timeout:=5.0")
    process = graph.start("linearizer", *source, "input_timeout:=5.0", model=tmp_path / "mass.yaml", namespace="/left")
    models, joints = graph.models("/left/linearizer"), graph.publisher(JointState, "/left/joint_states")
    messages, sent = graph.collect(DiagnosticArray, "/diagnostics"), [0]

    def publish(effort: float) -> None:
        sent[0] += 1
        message = JointState(name=["other", "slide"], position=[0.0, 0.01 * np.sin(0.1 * sent[0])])
        message.velocity, message.effort = [0.0, 0.1 * np.cos(0.1 * sent[0])], [7.0, effort]
        joints.publish(message)
        joints.publish(JointState(name=["elsewhere"], position=[1.0]))  # of another publisher

    def status(effort: float, text: str) -> Any:
        def found() -> Any:
            publish(effort)
            told = [s for m in messages for s in m.status if s.name.startswith("/left/linearizer:")]
            return next((s for s in told if text in s.message), None)

        messages.clear()
        return graph.wait(found, text)

    without = status(0.0, "no input has come: linearized at the state itself")
    assert (without.level, without.hardware_id) == (b"\x01", "left/slide")
    assert status(2.0, "publishing").level == b"\x00"
    assert convert.read_model(models[-1]).result.u == pytest.approx([2.0])
    assert process.output.count("a message was refused") == 1


def test_the_life_cycle_and_a_transition_that_is_refused(graph: Any) -> None:
    graph.start("plant_simulator", "input_signal:=sine")
    graph.start("linearizer", "update_period:=0.05", "autostart:=false")
    models = graph.models()

    def change(transition: int) -> bool:
        request = ChangeState.Request()
        request.transition.id = transition
        return bool(graph.call(ChangeState, "/linearizer/change_state", request).success)

    def label() -> str:
        return str(graph.call(GetState, "/linearizer/get_state", GetState.Request()).current_state.label)

    assert label() == "unconfigured"
    assert not change(ACTIVATE)
    assert label() == "unconfigured"
    assert change(CONFIGURE)
    graph.spin(0.3)
    assert not models
    assert change(ACTIVATE)
    graph.wait(lambda: len(models) >= 5, "models")
    assert not change(CONFIGURE)
    assert change(DEACTIVATE)
    graph.spin(0.2)
    count = len(models)
    graph.spin(0.3)
    assert len(models) == count
    assert change(ACTIVATE)
    graph.wait(lambda: len(models) > count, "models again")
    assert change(DEACTIVATE)
    assert change(CLEANUP)
    assert label() == "unconfigured"


def _with_position(folder: Path) -> Path:
    file = folder / "motor.yaml"
    Model.load("dc_motor").with_options(with_position=True).save(file)
    return file


def _parameters(text: str) -> dict[str, Any]:
    import yaml

    return dict(yaml.safe_load(text)["/**"]["ros__parameters"])
