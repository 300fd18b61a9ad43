"""The monitor over ROS 2: a diagnosis of what was kept, the better model applied and taken back, nothing restarted."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed: pip install 'signlin_ros[ros]'")

from domain_coordinator import domain_id
from std_msgs.msg import Float64, Float64MultiArray, String
from std_srvs.srv import Trigger

from signlin_ros.model import Model

PERIOD, PATIENCE = 7.0, 600.0
"""Period of the input in s, over whole ones of which errors are compared; how long to wait for the verdict."""
PLOTTED = ("error/speed", "rms/speed", "A/position/speed", "B/current/voltage", "pole_1/real", "friction/speed")


def trigger(graph: Any, service: str) -> Any:
    return graph.call(Trigger, f"/monitor/{service}", Trigger.Request())


def states(verdicts: list[Any]) -> list[str]:
    return [json.loads(message.data)["state"] for message in verdicts]


def over_a_period(graph: Any, errors: list[Any], speed: int) -> float:
    """The median of the errors that come during the next period of the input."""
    errors.clear()
    graph.spin(PERIOD)
    return median(errors, speed)


def median(errors: list[Any], speed: int) -> float:
    """The median of the errors; without bounds where none came, as on a busy machine that is compiling a model."""
    return float("inf") if not errors else float(np.median([abs(message.data[3 + speed]) for message in errors]))


@pytest.mark.slow
def test_what_is_found_is_applied_and_taken_back(graph: Any, tmp_path: Path) -> None:
    truth = Model.load("dc_motor").with_options(with_position=True, update_period=0.05, operating_point="midpoint")
    truth.save(tmp_path / "truth.yaml")
    # each state comes with the input that led to it: that this is found out is tested in diagnosis/test_input_hold.py
    nominal = truth.without_effect("coulomb_friction").with_options(input_hold="backward")
    nominal.save(tmp_path / "nominal.yaml")
    drive = (
        "input_signal:=multisine",
        "amplitude:=2.0",
        f"input_period:={PERIOD}",
        "publish_rate:=50.0",
        "noise:=0.001",
    )
    graph.start("plant_simulator", *drive, model=tmp_path / "truth.yaml")
    joint = "state_source:=joint_state"
    graph.start("linearizer", joint, model=tmp_path / "nominal.yaml")
    graph.start(
        "monitor", joint, "learn:=10.0", "most_rows:=1000", f"folder:={tmp_path}", model=tmp_path / "nominal.yaml"
    )
    errors, verdicts = graph.collect(Float64MultiArray, "/monitor/error"), graph.collect(String, "/monitor/verdict")
    graph.wait(lambda: errors, "the first error", PATIENCE)
    plotted = {name: graph.collect(Float64, f"/monitor/plot/{name}") for name in PLOTTED}
    graph.wait(lambda: all(plotted.values()), "numbers with names", PATIENCE)
    assert plotted["A/position/speed"][-1].data == 1.0
    assert plotted["friction/speed"][-1].data == pytest.approx(0.0, abs=1e-9)  # the model has none yet
    assert not trigger(graph, "apply").success
    assert not trigger(graph, "experiment").success
    plans = graph.collect(String, "/monitor/plan")
    graph.spin(2 * PERIOD)
    assert not trigger(graph, "cancel").success
    assert trigger(graph, "diagnose").success
    assert not trigger(graph, "diagnose").success  # one at a time
    assert trigger(graph, "cancel").success
    graph.wait(lambda: "cancelled" in states(verdicts), "that it was cancelled", PATIENCE)
    asked = trigger(graph, "diagnose")
    assert asked.success, asked.message
    done = graph.wait(
        lambda: [v for v in map(json.loads, (m.data for m in verdicts)) if v["state"] in ("done", "failed")],
        "a verdict",
        PATIENCE,
    )[-1]
    assert done["state"] == "done", done
    running = [v for v in map(json.loads, (m.data for m in verdicts)) if v["state"] == "running"]
    assert max(v["progress"] for v in running) > 0.0
    assert "coulomb_friction" in Model.load(done["model_file"]).effects
    planned = trigger(graph, "experiment")
    assert planned.success, planned.message
    graph.wait(lambda: [m for m in plans if json.loads(m.data)["state"] in ("done", "failed")], "a plan", PATIENCE)
    assert json.loads(plans[-1].data)["sentence"]
    speed, before = nominal.states.index("speed"), median(errors, nominal.states.index("speed"))
    applied = trigger(graph, "apply")
    assert applied.success, applied.message
    assert "applied already" in trigger(graph, "apply").message
    # On a busy machine an input comes late now and then, and the period with it is worse than the model.
    graph.wait(lambda: over_a_period(graph, errors, speed) < before / 5, "the errors to fall to a fifth", 10 * PERIOD)
    assert trigger(graph, "record").success
    reverted = trigger(graph, "revert")
    assert reverted.success, reverted.message
    graph.wait(lambda: before / 2 < over_a_period(graph, errors, speed) < np.inf, "the errors as before", 10 * PERIOD)
    assert not trigger(graph, "revert").success
    assert trigger(graph, "reset").success
    graph.wait(lambda: states(verdicts)[-1] == "reset", "that what is usual is learnt anew")


@pytest.mark.long  # in real time: the machine's own control loop needs the processor. In simulated time it is quick:
@pytest.mark.ros  # tests/ros/test_monitor_logic.py
@pytest.mark.xdist_group("ros_naming")  # beside the others, in a domain of its own
def test_a_change_is_called_then_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    from live_changes import NOMINAL, RATE, Machine, compile_ahead
    from live_ros import watched

    rig = Machine(np.random.default_rng(3200))
    compile_ahead(3200, "load")
    with domain_id() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        called, began, names = watched(rig, NOMINAL, "load", 12.0, 300.0, 8.0, RATE, naming=True)
    assert called is not None
    assert 12.0 <= called < 17.0
    assert began is not None
    assert names[:1] == ["constant_load"]
