"""The nodes as processes: the executables in lib/signlin_ros, over ROS 2."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed: pip install 'signlin_ros[ros]'")

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import DescribeParameters
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model, shipped_models
from signlin_ros.nodes import convert

sys.path.insert(0, str(Path(__file__).parent))
from malformed import malformed

pytestmark = pytest.mark.ros

sys.path.pop(0)

NANO = 1_000_000_000
PERIOD, STEP = NANO // 5, NANO // 50
DATA = Path(os.environ.get("SIGNLIN_DATA", Path(__file__).parents[3] / "shared" / "data"))


def state(*values: float) -> Float64MultiArray:
    return Float64MultiArray(data=list(values))


def feed(graph: Any, publisher: Any, message: Any, models: list[Any], count: int = 1) -> None:
    """Publish a state until so many more models have come."""
    goal = len(models) + count

    def more() -> bool:
        publisher.publish(message)
        return len(models) >= goal

    graph.wait(more, f"{count} models")


def assert_core_s(messages: list[Any], model: Model) -> None:
    """Each A, B, c is what the core gives at the x_k and u_k beside it, to the last bit; no gap, no NaN."""
    core = Linearizer(model)
    updates = [convert.read_model(message) for message in messages]
    for update in updates:
        expected = core(update.result.x, update.result.u)
        for name in ("A", "B", "c"):
            np.testing.assert_array_equal(getattr(update.result, name), getattr(expected, name))
            assert np.isfinite(getattr(update.result, name)).all()
    first = updates[0].sequence
    assert [update.sequence for update in updates] == list(range(first, first + len(updates)))


def _next(models: list[Any]) -> int:
    """The sequence that comes next."""
    return convert.read_model(models[-1]).sequence + 1 if models else 0


def test_two_processes_publish_and_receive(graph: Any) -> None:
    plant = graph.start("plant_simulator", "input_signal:=square", "amplitude:=2", "input_period:=1")
    models, matrices = graph.models(), graph.collect(Float64MultiArray, "/linearizer/A", latched=True)
    states = graph.collect(Float64MultiArray, "/state")
    linearizer = graph.start("linearizer", "update_period:=0.05")
    graph.wait(lambda: len(models) >= 25, "25 models")
    assert_core_s(models, Model.load("dc_motor").with_options(update_period=0.05))
    used = {tuple(convert.read_model(message).result.x) for message in models[5:]}
    graph.wait(lambda: used <= {tuple(message.data) for message in states}, "every state that was used")
    assert [(d.label, d.size, d.stride) for d in matrices[0].layout.dim] == [
        ("rows", 2, 4),
        ("columns", 2, 2),
    ]
    A = {tuple(convert.read_model(message).result.A.ravel()) for message in models}
    assert sum(tuple(message.data) in A for message in matrices) >= 20
    assert (plant.stop(signal.SIGINT), linearizer.stop(signal.SIGTERM)) == (0, 0)
    for process in (plant, linearizer):
        assert "Traceback" not in process.output


def test_exactly_300_updates_in_60_s_of_simulated_time(graph: Any) -> None:
    graph.start("plant_simulator", "input_signal:=sine", "input_period:=7.3", sim_time=True)
    graph.start("linearizer", sim_time=True)
    models, states = graph.models(), graph.collect(Float64MultiArray, "/state")
    clock = graph.publisher(Clock, "/clock", depth=1)
    graph.wait(lambda: clock.get_subscription_count() == 2, "two followers of the clock")
    inputs = graph.node.count_subscribers
    graph.wait(lambda: inputs("/state") == 2 and inputs("/linearizer/model") == 1, "all topics")

    def tick(now: int) -> None:
        clock.publish(Clock(clock=convert.stamp_of(now)))
        graph.executor.spin_once(timeout_sec=0.002)

    def run_to(boundary: int, now: int, due: int) -> None:
        """Run the clock there; it may be faster than the machine, so wait until both nodes have done their part."""
        seen = len(states)
        for time in range(now + STEP, boundary + 1, STEP):
            tick(time)
        graph.wait(lambda: tick(boundary) or (len(states) > seen and _next(models) >= due), f"all due by {boundary} ns")

    # Until a model came from a state of the last period, so that from then on it is known which one is due next.
    now = 0
    while not models or convert.read_model(models[-1]).stamp <= now - PERIOD or now % PERIOD:
        now += STEP
        tick(now)
        graph.spin(0.01)
    start, first = now, _next(models)
    for period in range(300):
        run_to(now + PERIOD, now, first + period + 1)
        now += PERIOD
    assert now == start + 60 * NANO
    graph.spin(0.5)
    updates = [convert.read_model(m) for m in models if convert.read_model(m).sequence >= first]
    assert [update.sequence for update in updates] == list(range(first, first + 300))
    stamps = [update.stamp for update in updates]
    assert stamps == sorted(stamps)
    assert start - PERIOD < stamps[0] <= stamps[-1] <= now
    assert_core_s(models, Model.load("dc_motor"))


def test_1000_malformed_messages(graph: Any) -> None:
    linearizer = graph.start("linearizer", "update_period:=0.02")
    models, diagnostics = graph.models(), graph.collect(DiagnosticArray, "/diagnostics")
    states = graph.publisher(Float64MultiArray, "/state")
    inputs = graph.publisher(Float64MultiArray, "/input")
    feed(graph, states, state(0.1, 1.0), models)
    for k, message in enumerate(malformed(1000)):
        (inputs if k % 5 == 4 else states).publish(message)
        graph.executor.spin_once(timeout_sec=0.001)
    inputs.publish(state(0.5))
    feed(graph, states, state(0.25, 2.5), models, 3)
    assert linearizer.running
    for message in models:
        assert np.isfinite(message.data).all()
    last = convert.read_model(models[-1]).result
    assert (last.x.tolist(), last.u.tolist()) == ([0.25, 2.5], [0.5])
    status = graph.diagnostics(diagnostics, "")
    values = {item.key: item.value for item in status.values}
    for kind in ("layout", "length", "not_finite"):
        assert int(values[f"refused: {kind}"]) >= 3
    assert linearizer.stop() == 0


@pytest.mark.parametrize(("observer", "near"), [("none", 0.0), ("kalman", 0.1)])
def test_joint_states(graph: Any, observer: str, near: float) -> None:
    """By name; extra joints and other orders are fine; NaN, repeated and old stamps are not used.

    An observer comes near to these speeds only: no motor jumps from one to another.
    """
    source = ("state_source:=joint_state", "joint_name:=wheel", f"observer:={observer}", "state_timeout:=5.0")
    graph.start("linearizer", *source, "update_period:=0.02")
    models, diagnostics = graph.models(), graph.collect(DiagnosticArray, "/diagnostics")
    joints = graph.publisher(JointState, "/joint_states")
    K_t = Model.load("dc_motor").value("K_t")

    def message(velocity: list[float], stamp: Time | None = None, names: str = "arm wheel") -> JointState:
        values = dict(zip(names.split(), velocity, strict=False))
        result = JointState(name=names.split(), velocity=list(values.values()), effort=[K_t] * len(values))
        result.header.stamp = stamp or graph.node.get_clock().now().to_msg()
        return result

    def publish(*arguments: Any, **named: Any) -> None:
        joints.publish(message(*arguments, **named))

    graph.wait(lambda: publish([9.0, 3.0]) or models, "a model")
    graph.wait(lambda: publish([4.0, 9.0], names="wheel arm") or abs(_speed(models) - 4.0) <= near, "the other order")
    assert convert.read_model(models[-1]).result.x[0] == pytest.approx(1.0)
    stamp = convert.nanoseconds(message([0.0]).header.stamp)
    assert 0 <= stamp - convert.read_model(models[-1]).stamp < 10 * NANO
    repeated = graph.node.get_clock().now().to_msg()
    for _ in range(20):
        publish([9.0, float("nan")])
        publish([9.0])
        publish([9.0, float("inf")])
        publish([9.0, 7.0], stamp=Time())
        publish([9.0, 4.0], stamp=repeated)
        publish([9.0, 8.0], names="arm leg")
        graph.spin(0.01)
    status = graph.diagnostics(diagnostics, "")
    refused = {v.key.split(": ")[1]: int(v.value) for v in status.values if v.key.startswith("refused: ")}
    assert set(refused) == {"missing", "not_finite", "stale", "repeated"}
    assert all(min(abs(_speed([m]) - v) for v in (3.0, 4.0)) <= near for m in models)
    graph.wait(lambda: publish([9.0, 5.0]) or abs(_speed(models) - 5.0) <= near, "recovery")


def _speed(models: list[Any]) -> float:
    return float(convert.read_model(models[-1]).result.x[1])


def test_what_is_carried_by_the_model_when_the_joint_does_not_tell(graph: Any) -> None:
    graph.start("linearizer", "state_source:=joint_state", "update_period:=0.02", model="bouc_wen.yaml")
    models, joints = graph.models(), graph.publisher(JointState, "/joint_states")

    def moving() -> bool:
        now = graph.node.get_clock().now()
        q, v = np.sin(now.nanoseconds / NANO), np.cos(now.nanoseconds / NANO)
        message = convert.joint_state("joint", {"position": q, "velocity": v}, now.nanoseconds)
        joints.publish(message)
        return len(models) >= 20

    graph.wait(moving, "20 models")
    hysteresis = [convert.read_model(m).result.x[2] for m in models]
    assert np.isfinite(hysteresis).all()
    assert np.ptp(hysteresis) > 0


def test_parameters_at_run_time(graph: Any) -> None:
    """Good ones are taken at once, bad ones refused with the reason while the running model goes on."""
    linearizer = graph.start("linearizer", "update_period:=0.02")
    models, states = graph.models(), graph.publisher(Float64MultiArray, "/state")
    feed(graph, states, state(0.1, 1.0), models)
    before = convert.read_model(models[-1]).result.A
    for name, value, text in (
        ("parameters.J", -1.0, "parameters.J"),
        ("parameters.J", float("nan"), "parameters.J"),
        ("parameters.L_a", 0.0, "restart"),
        ("linearization", "optimum", "optimal"),
        ("sign_scale", 0.0, "operating_range"),
        ("update_period", 1e-10, "update_period"),
        ("plant", "bouc_wen", "read-only"),
        ("parameters.K", 1.0, "did you mean 'parameters.K_"),
        ("effects.coulomb_friction.mu", "much", "DOUBLE"),
    ):
        result = graph.set_parameter(name, value)
        assert not result.successful, name
        assert text in result.reason
    feed(graph, states, state(0.1, 1.0), models, 2)
    np.testing.assert_array_equal(convert.read_model(models[-1]).result.A, before)

    assert graph.set_parameter("effects.coulomb_friction.mu", 0.05).successful
    assert graph.set_parameter("sign_order", 20).successful
    assert graph.set_parameter("parameters.R_a", 1).successful  # a whole number for a float
    assert graph.set_parameter("update_period", 0.03).successful
    feed(graph, states, state(0.1, 1.0), models, 3)
    model = Model.load("dc_motor").with_parameters({"coulomb_friction.mu": 0.05, "R_a": 1.0})
    expected = Linearizer(model.with_options(sign_order=20))([0.1, 1.0])
    np.testing.assert_array_equal(convert.read_model(models[-1]).result.A, expected.A)
    assert linearizer.stop() == 0


def test_a_node_that_does_not_follow_a_changed_model_refuses_the_change(graph: Any, tmp_path: Path) -> None:
    rows = np.zeros((100, 4))
    rows[:, 0] = np.arange(100) * 0.01
    np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header="t,voltage,current,speed", comments="")
    graph.start("plant_simulator")
    graph.start("replay", f"record:={tmp_path / 'run.csv'}", "loop:=true")
    for node in ("/plant_simulator", "/replay"):
        for name, value in (("parameters.J", 0.003), ("effects.coulomb_friction.mu", 0.05), ("sign_order", 20)):
            result = graph.set_parameter(name, value, node)
            assert not result.successful
            assert "read-only" in result.reason
        request = DescribeParameters.Request(names=["parameters.J"])
        (inertia,) = graph.call(DescribeParameters, f"{node}/describe_parameters", request).descriptors
        assert inertia.read_only


def test_a_simulated_drive_with_sensors_is_linearized_at_its_true_state(graph: Any) -> None:
    """One model file for both: the simulator publishes what the sensors show, the linearizer takes it off again."""
    sensors = ("effects.sensor_offset.speed:=3.0", "effects.sensor_offset.current:=0.5")
    models, states = graph.models(), graph.collect(Float64MultiArray, "/state")
    graph.start("linearizer", "update_period:=0.05", *sensors)
    graph.start("plant_simulator", *sensors)  # without an input it stands still
    graph.wait(lambda: len(models) >= 10, "10 models")
    assert {tuple(message.data) for message in states} == {(0.5, 3.0)}
    assert {tuple(convert.read_model(message).result.x) for message in models} == {(0.0, 0.0)}
    assert_core_s(models, Model.load("dc_motor").with_options(update_period=0.05))


def test_parameters_say_what_they_are(graph: Any) -> None:
    graph.start("linearizer")
    names = ["effects.coulomb_friction.mu", "sign_order", "plant", "linearization"]
    request = DescribeParameters.Request(names=names)
    mu, order, plant, method = graph.call(DescribeParameters, "/linearizer/describe_parameters", request).descriptors
    declared = Model.load("dc_motor").par_declarations()["effects.coulomb_friction.mu"]
    assert declared.doc in mu.description
    assert "[N·m]" in mu.description
    assert mu.floating_point_range[0].to_value == declared.high
    assert order.integer_range[0].from_value == 1
    assert plant.read_only
    assert "midpoint" not in method.additional_constraints
    assert "termwise" in method.additional_constraints


@pytest.mark.parametrize(
    ("name", "parameters", "text"),
    [
        ("linearizer", ["effects.coulomb_friction.nu:=1.0"], "known: mu"),
        ("linearizer", ["sign_ordr:=20"], "did you mean 'sign_order'"),
        ("linearizer", ["state_source:=arry"], "did you mean 'array'"),
        ("linearizer", ["sign_order:=20.5"], "sign_order: 20.5 is not taken: ROS keeps the 50 before it"),
        ("linearizer", ["start_type_description_service:=5"], "'5' of type 'INTEGER', expecting type 'BOOL'"),
        ("plant_simulator", ["publish_rate:=-3.0"], "publish_rate: found -3; allowed: [0.1, 10000]"),
        ("plant_simulator", ["input_signal:=sinus"], "did you mean 'sine'"),
        ("replay", [], "record: missing"),
        ("replay", ["record:=/nowhere/run.csv"], "/nowhere/run.csv"),
    ],
)
def test_a_bad_start_is_said_in_one_line(graph: Any, name: str, parameters: list[str], text: str) -> None:
    process = graph.start(name, *parameters)
    assert process.popen.wait(60.0) == 2
    assert text in process.output
    assert len(process.output.strip().splitlines()) == 1


def test_no_parameter_file(graph: Any) -> None:
    process = graph.start("linearizer", model="nowhere.yaml")
    assert process.popen.wait(60.0) == 2
    assert "nowhere.yaml" in process.output
    assert "Traceback" not in process.output


def motor_with(folder: Path, line: str) -> Path:
    """The shipped motor's file with one line more."""
    file = folder / "motor.yaml"
    file.write_text(f"{shipped_models()['dc_motor'].read_text()}    {line}\n")
    return file


@pytest.mark.parametrize("name", ["linearizer", "plant_simulator", "replay"])
def test_use_sim_time_of_another_type_is_said_in_one_line(graph: Any, name: str, tmp_path: Path) -> None:
    file = motor_with(tmp_path, "use_sim_time: 5")
    process = graph.start(name, model=file, sim_time=None)
    assert process.popen.wait(60.0) == 2
    assert "use_sim_time" in process.output
    assert len(process.output.strip().splitlines()) == 1


def test_a_file_with_an_empty_list_and_mapping_starts_as_on_the_command_line(graph: Any, tmp_path: Path) -> None:
    for line in ("frozen: []", "signals: {}"):
        file = motor_with(tmp_path, line)
        process, models = graph.start("linearizer", model=file, sim_time=None), graph.models()
        feed(graph, graph.publisher(Float64MultiArray, "/state"), state(0.1, 1.0), models)
        assert process.stop() == 0
        graph.wait(lambda: graph.node.count_publishers("/linearizer/model") == 0, "its end")


def catches(pid: int, number: int) -> bool:
    """Tell whether a process has a handler for a signal."""
    status = Path(f"/proc/{pid}/status").read_text()
    return bool(int(status.partition("SigCgt:")[2].split()[0], 16) >> (number - 1) & 1)


def test_signals_while_a_node_starts_end_it_without_a_word(graph: Any) -> None:
    """From the first line of its own on, when it catches SIGTERM, which nothing before that does."""
    for delay, number in zip(np.linspace(0.0, 1.2, 8), (signal.SIGINT, signal.SIGTERM) * 4, strict=True):
        process = graph.start("plant_simulator", copied=False)
        graph.wait(lambda pid=process.popen.pid: catches(pid, signal.SIGTERM), "its own first line")
        sleep(delay)
        process.popen.send_signal(number)
        process.popen.send_signal(number)
        assert process.stop(number) == 0, process.output
        assert process.output == ""


HALF_MADE = """
import os, signal
from signlin_ros.nodes import runner

class Half:
    def __init__(self):
        os.kill(os.getpid(), signal.SIGINT)
        self.made = True

    def __del__(self):
        del self.made

class Whole:
    def __del__(self):
        raise RuntimeError("its own fault")

def create():
    Whole()
    Half()

raise SystemExit(runner.run("half", create, ["half"]))
"""


def test_what_a_signal_leaves_half_made_is_not_told_as_a_fault(graph: Any) -> None:
    command = [sys.executable, "-c", HALF_MADE]
    done = subprocess.run(command, check=False, capture_output=True, text=True, env=graph.env)
    assert done.returncode == 0
    assert "its own fault" in done.stderr
    assert "AttributeError" not in done.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_while_an_effect_file_runs_end_the_node_without_a_word(graph: Any, tmp_path: Path, number: int) -> None:
    begun = tmp_path / "begun"
    waits = "while True:\n    time.sleep(0.01)\n"  # one long sleep would not notice a signal just before it
    (tmp_path / "slow.py").write_text(f"import pathlib, time\npathlib.Path({str(begun)!r}).touch()\n{waits}")
    process = graph.start("plant_simulator", model=motor_with(tmp_path, "effect_files: [slow.py]"), sim_time=None)
    graph.wait(begun.exists, "the effect file")
    process.popen.send_signal(number)
    process.popen.send_signal(number)
    assert process.stop(number) == 0, process.output
    assert process.output == ""


def test_a_signal_in_a_callback_from_c_is_not_lost() -> None:
    """Such a callback, as LLVM's when it has compiled something, swallows exceptions, and Python says so."""
    script = """
import ctypes, signal, sys, time
from signlin_ros.nodes.runner import run

def create():
    ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGTERM))()
    time.sleep(60)

sys.exit(run("late", create, []))
"""
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=30, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")


def test_signals_while_signals_are_handled_wait_for_nothing() -> None:
    """Thousands in a second: some come while an earlier one is handled."""
    script = """
import os, subprocess, sys
from signlin_ros.nodes.runner import _Signals

signals = _Signals()
signals.started = True
sender = "import os, time; end = time.time() + 1.0\\nwhile time.time() < end: [os.kill({}, n) for n in (2, 15)]"
sending = subprocess.Popen([sys.executable, "-c", sender.format(os.getpid())])
while sending.poll() is None:
    pass
sys.exit(int(not signals.stop))
"""
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")


def test_an_end_that_hangs_is_ended_and_says_where() -> None:
    script = """
import os, signal, sys, time
import rclpy.node
from signlin_ros.nodes import runner

class Hanging(rclpy.node.Node):
    def destroy_node(self):
        time.sleep(60)

def create():
    node = Hanging("hanging")
    node.create_timer(0.1, lambda: os.kill(os.getpid(), signal.SIGTERM))  # once it spins, however long that takes
    return node

runner.END_PATIENCE = 1.0
sys.exit(runner.run("hanging", create, []))
"""
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=50, check=False)
    assert ended.returncode == 1
    assert "in destroy_node" in ended.stderr


def test_stale_states_and_who_comes_late(graph: Any) -> None:
    """Without states the diagnostics turn to ERROR, nothing more comes, and the last model stays latched."""
    graph.start("linearizer", "update_period:=0.02")
    diagnostics = graph.collect(DiagnosticArray, "/diagnostics")
    assert graph.diagnostics(diagnostics, "no valid state yet").level == b"\x02"
    models, states = graph.models(), graph.publisher(Float64MultiArray, "/state")
    feed(graph, states, state(0.1, 1.0), models, 3)
    status = graph.diagnostics(diagnostics, "the last model stays")
    assert status.level == b"\x02"
    assert status.hardware_id == "dc_motor"
    count = len(models)
    late = graph.models()
    everything = [graph.collect(Float64MultiArray, f"/linearizer/{name}", latched=True) for name in "ABc"]
    graph.wait(lambda: late and all(everything), "the latched messages")
    assert late[0] == models[-1]
    assert len(models) == count
    feed(graph, states, state(0.1, 2.0), models)
    assert convert.read_model(models[-1]).sequence == count


def test_restart_in_any_order(graph: Any) -> None:
    options = ("input_signal:=sine", "input_period:=1.0")
    linearizer = graph.start("linearizer", "update_period:=0.02")
    plant = graph.start("plant_simulator", *options)
    models = graph.models()
    graph.wait(lambda: len(models) > 3, "models")
    assert plant.stop() == 0
    graph.start("plant_simulator", *options)
    count = len(models)
    graph.wait(lambda: len(models) > count + 5, "models with the second plant")
    assert linearizer.stop(signal.SIGTERM) == 0
    graph.wait(lambda: graph.node.count_publishers("/linearizer/model") == 0, "the first linearizer to be gone")
    count, before = len(models), monotonic()
    graph.start("linearizer", "update_period:=0.02")

    def second() -> list[int]:
        """The numbers of the second one's models; the last of the first may still wait to be read."""
        sequences = [convert.read_model(message).sequence for message in models[count - 1 :]]
        restarts = np.flatnonzero(np.diff(sequences) < 0)
        return sequences[restarts[0] + 1 :] if restarts.size else []

    graph.wait(lambda: len(second()) > 5, "models of the second linearizer")
    sequences = second()
    assert sequences == sorted(sequences)
    assert sequences[-1] <= (monotonic() - before) / 0.02  # counted anew: no more than the time allows


def test_two_linearizers_by_namespace(graph: Any) -> None:
    graph.start("linearizer", "update_period:=0.02", namespace="/left")
    graph.start("linearizer", "update_period:=0.02", namespace="/right", model="bouc_wen.yaml")
    left, right = graph.models("/left/linearizer"), graph.models("/right/linearizer")
    feed(graph, graph.publisher(Float64MultiArray, "/left/state"), state(0.1, 1.0), left, 2)
    assert right == []
    feed(graph, graph.publisher(Float64MultiArray, "/right/state"), state(0.1, 1.0, 0.2), right, 2)
    assert len(convert.read_model(left[-1]).result.x) == 2
    assert len(convert.read_model(right[-1]).result.x) == 3


def test_simulated_time_that_jumps_back(graph: Any) -> None:
    graph.start("linearizer", "state_source:=joint_state", sim_time=True)
    models, clock = graph.models(), graph.publisher(Clock, "/clock", depth=1)
    joints = graph.publisher(JointState, "/joint_states")

    def run(start: float, speed: float) -> None:
        """Run the clock from a start until a model at that speed has come."""
        now = [round(start * NANO)]

        def step() -> bool:
            now[0] += NANO // 50
            clock.publish(Clock(clock=convert.stamp_of(now[0])))
            joints.publish(convert.joint_state("joint", {"velocity": speed, "effort": 0.0}, now[0]))
            return bool(models) and abs(_speed(models) - speed) < 0.01  # an observer comes near to it

        graph.wait(step, f"a model at {speed} rad/s")

    run(1000.0, 1.0)
    run(10.0, 2.0)
    assert convert.read_model(models[-1]).stamp < 1000 * NANO
    sequences = [convert.read_model(m).sequence for m in models]
    assert sequences == list(range(len(models)))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_a_node_cleanly(graph: Any, number: int) -> None:
    nodes = [graph.start("linearizer"), graph.start("plant_simulator")]
    for name in ("/linearizer", "/plant_simulator"):
        service = f"{name}/describe_parameters"
        client = graph.node.create_client(DescribeParameters, service)
        graph.wait(client.service_is_ready, service)
    for process in nodes:
        process.popen.send_signal(number)
        process.popen.send_signal(number)
    assert [process.stop(number) for process in nodes] == [0, 0]
    for process in nodes:
        assert "Traceback" not in process.output


def test_replay(graph: Any, tmp_path: Path) -> None:
    """A record is played sample by sample, the linearizer follows, and the node ends by itself."""
    t = np.arange(400) * 0.005
    voltage, speed, current = 2.0 * (t > 0.5), 10.0 * t, 1.0 + t
    rows = np.stack([t, voltage, current, speed], axis=1)
    np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header="t,voltage,current,speed", comments="")
    models, states = graph.models(), graph.collect(Float64MultiArray, "/state")
    joints = graph.collect(JointState, "/joint_states")
    graph.start("linearizer", "update_period:=0.05")
    graph.wait(lambda: graph.node.count_subscribers("/state") == 2, "the linearizer")
    replay = graph.start("replay", f"record:={tmp_path / 'run.csv'}", "rate:=2")
    graph.wait(lambda: not replay.running, "the end of the record")
    graph.wait(lambda: list(states[-1].data) == [current[-1], speed[-1]], "the last sample")
    assert replay.popen.returncode == 0
    assert len(states) > 390
    known = {tuple(row) for row in rows[:, 2:4]}
    assert {tuple(m.data) for m in states} <= known
    stamps = [convert.nanoseconds(m.header.stamp) for m in joints]
    np.testing.assert_allclose(np.diff(stamps).min() / NANO, 0.0025, atol=1e-6)
    torques = Model.load("dc_motor").value("K_t") * (1.0 + np.array([m.velocity[0] for m in joints]) / 10.0)
    np.testing.assert_allclose([m.effort[0] for m in joints], torques)
    graph.wait(lambda: len(models) >= 15, "15 models")
    assert_core_s(models, Model.load("dc_motor").with_options(update_period=0.05))


def test_replay_with_the_record_s_clock(graph: Any, tmp_path: Path) -> None:
    t = np.arange(300) * 0.01
    rows = np.stack([t, 0 * t, 0 * t, t], axis=1)
    np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header="t,voltage,current,speed", comments="")
    clock, models = graph.collect(Clock, "/clock"), graph.models()
    graph.start("linearizer", sim_time=True)
    graph.wait(lambda: graph.node.count_subscribers("/state") == 1, "the linearizer")
    replay = graph.start("replay", f"record:={tmp_path / 'run.csv'}", "rate:=3", "publish_clock:=true", "loop:=true")
    graph.wait(lambda: clock and convert.nanoseconds(clock[-1].clock) > 4 * NANO, "the second round")
    assert replay.running
    times = [convert.nanoseconds(m.clock) for m in clock]
    assert times == sorted(times)
    graph.wait(lambda: len(models) >= 15, "15 models")
    assert replay.stop() == 0


@pytest.mark.parametrize(("first", "bound"), [(2.0**31 - 1, "2147483649"), (-2.5, "-2.5")])
def test_replay_names_the_time_that_ros_has_not(graph: Any, tmp_path: Path, first: float, bound: str) -> None:
    t = np.linspace(0.0, 2.0, 201)
    rows = np.stack([t + first, 0 * t, 0 * t, t], axis=1)
    options = {"delimiter": ",", "header": "t,voltage,current,speed", "comments": "", "fmt": "%.12g"}
    np.savetxt(tmp_path / "run.csv", rows, **options)
    replay = graph.start("replay", f"record:={tmp_path / 'run.csv'}", "publish_clock:=true")
    graph.wait(lambda: "/clock begins at 0" in replay.output, "the warning")
    assert f"ROS has no time {bound} s: /clock begins at 0" in replay.output


def test_the_linearizer_follows_a_measured_servo(graph: Any) -> None:
    """XL-330: only positions were measured, velocity comes from the causal filter; each A_k is the core's."""
    record = DATA / "xl330" / "xl330_kp400_sin_sin.csv"
    if not record.exists():
        pytest.skip(f"{record} is not there; SIGNLIN_DATA names the folder of the measured records")
    models = graph.models()
    graph.start("linearizer", model="xl330.yaml", sim_time=True)
    graph.wait(lambda: graph.node.count_subscribers("/state") == 1, "the linearizer")
    options = (f"record:={record}", "rate:=2", "publish_clock:=true")
    replay = graph.start("replay", *options, model="xl330.yaml")
    graph.wait(lambda: not replay.running, "the end of the record", 180.0)
    assert replay.popen.returncode == 0
    assert "velocity from displacement by a causal filter, delay" in replay.output
    graph.wait(lambda: len(models) > 100, "100 models")
    updates = [convert.read_model(message).result for message in models]
    assert all(np.isfinite(message.data).all() for message in models)
    start = Linearizer(Model.load("xl330").with_options(operating_point="start"))
    for update in updates:
        np.testing.assert_allclose(update.A, start(update.x, update.u).A, rtol=1e-12)
    assert max(abs(update.x[1]) for update in updates) > 1.0
