"""What the demo makes of what it hears, and the demo itself, briefly."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from signlin_ros import demo
from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.simulation import Trajectory, simulate


@pytest.fixture(scope="module")
def run() -> Trajectory:
    t = np.arange(int(3 * demo.PUBLISH_RATE) + 1) / demo.PUBLISH_RATE
    u = np.where((t // 0.7) % 2 < 1, 2.0, -2.0)[:, None]
    return simulate(Model.load("dc_motor"), t, u)


def as_heard(run: Trajectory, keep: Any, rng: Any) -> Any:
    """The run as a listener gets it: each state late by up to half a step, with the input that led to it."""
    late = rng.uniform(0.0, 0.5 / demo.PUBLISH_RATE, run.t.size)[keep]
    t = run.t[keep] + late - late[0]
    led = np.vstack([run.u[:1], run.u[:-1]])[keep]
    return SimpleNamespace(t=t, x=run.x[keep], u_t=t - 1e-4, u=led)


def model_at(run: Trajectory, k: int) -> tuple[float, Any]:
    """A published model (time and update), here from the library itself."""
    result = Linearizer(Model.load("dc_motor"))(run.x[k], run.u[k])
    return run.t[k], SimpleNamespace(result=result)


def test_the_grid_of_the_plant_is_found_in_late_stamps(run: Trajectory) -> None:
    record = demo.on_grid(as_heard(run, slice(None), np.random.default_rng(0)))
    assert np.allclose(record.t, run.t)
    assert np.array_equal(record.x, run.x)
    assert np.array_equal(record.u[:-1], run.u[:-1])


def test_a_linear_prediction_is_the_piecewise_simulation(run: Trajectory) -> None:
    model = Model.load("dc_motor")
    record, part = demo.DemoRecord(run.t, run.x, run.u), slice(20, 61)
    lin = Linearizer(model)(run.x[20], run.u[20])
    expected = simulate(model, run.t[part], run.u[part], run.x[20], kind="piecewise")
    found = demo.predict_linear(lin.A, lin.B, lin.c, record, part)
    np.testing.assert_allclose(found[:-1], expected.x[:-1], rtol=1e-6, atol=1e-9)


def test_the_exact_model_predicts_what_was_simulated_and_the_others_are_off(run: Trajectory) -> None:
    rivals = demo.Rivals(Model.load("dc_motor"))
    record = demo.on_grid(as_heard(run, slice(None), np.random.default_rng(1)))
    found = demo.windows(rivals, record, [model_at(run, k) for k in range(10, run.t.size - 50, 40)])
    assert len(found) > 10
    assert demo.rms(found, "exact") < 1e-3
    assert demo.rms(found, "no friction") > 0.5
    assert demo.typical(found, "published") < demo.typical(found, "no friction")
    assert demo.largest_difference(rivals.model, found) == 0.0


def test_no_prediction_is_judged_over_a_gap(run: Trajectory) -> None:
    rivals = demo.Rivals(Model.load("dc_motor"))
    keep = np.r_[0:100, 120 : run.t.size]
    record = demo.on_grid(as_heard(run, keep, np.random.default_rng(2)))
    models = [model_at(run, k) for k in (10, 90, 200, run.t.size - 5)]
    assert [window.time for window in demo.windows(rivals, record, models)] == [run.t[10], run.t[200]]


@pytest.mark.ros
@pytest.mark.ros
@pytest.mark.slow
def test_the_demo_runs(tmp_path: Path) -> None:
    pytest.importorskip("rclpy", reason="ROS 2 is not installed: pip install 'signlin_ros[ros]'")
    pytest.importorskip("matplotlib", reason="needs the extra plot")
    from domain_coordinator import domain_id

    with domain_id() as domain:
        done = subprocess.run(
            [sys.executable, "-m", "signlin_ros.demo", "--output", str(tmp_path), "--seconds", "2"],
            capture_output=True,
            text=True,
            check=False,
            timeout=300,
            env={**os.environ, "ROS_DOMAIN_ID": str(domain), "DISPLAY": ""},
        )
    assert done.returncode == 0, done.stderr
    assert "midpoint, median" in done.stdout
    assert "listening" in done.stderr
    assert (tmp_path / "demo.png").stat().st_size > 10_000


def test_a_missing_installation_is_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.setattr(demo.processes.sysconfig, "get_path", lambda _: str(tmp_path))
    monkeypatch.setenv("AMENT_PREFIX_PATH", "")
    with pytest.raises(demo.DemoError, match="install"):
        demo.prefix()
