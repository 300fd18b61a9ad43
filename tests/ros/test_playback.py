"""Records as streams of states, without ROS."""

from __future__ import annotations

import itertools
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, filtfilt

from signlin_ros.errors import InputError
from signlin_ros.model import Model
from sim_nodes.measuring import Measuring
from sim_nodes.playback import Playback
from sim_nodes.signals import INPUT_SIGNALS, input_signal

DATA = Path(os.environ.get("SIGNLIN_DATA", Path(__file__).parents[3] / "shared" / "data"))


def written(path: Path, header: str, *columns: np.ndarray) -> str:
    np.savetxt(path, np.stack(columns, axis=1), delimiter=",", header=header, comments="", fmt="%.17g")
    return str(path)


def real(*parts: str) -> str:
    file = DATA.joinpath(*parts)
    if not file.exists():
        pytest.skip(f"{file} is not there; SIGNLIN_DATA names the folder of the measured records")
    return str(file)


def test_measured_states_are_played_as_they_are(tmp_path: Path) -> None:
    t = np.arange(50) * 0.01
    path = written(tmp_path / "run.csv", "t,voltage,current,speed", t + 3, np.sin(t), np.cos(t), t**2)
    samples = list(Playback(Model.load("dc_motor"), path).round())
    np.testing.assert_allclose([s.t for s in samples], t, atol=1e-12)
    np.testing.assert_allclose([s.x for s in samples], np.stack([np.cos(t), t**2], axis=1))
    np.testing.assert_allclose([s.u for s in samples], np.sin(t)[:, None])


def test_an_input_that_switches_between_two_states_is_played_when_it_did(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    rows = [f"{0.01 * i:.3f},,{i},{i}\n{0.01 * i + 0.003:.3f},{i % 3},," for i in range(30)]
    path.write_text("\n".join(["t,voltage,current,speed", *rows]) + "\n")
    samples = list(Playback(Model.load("dc_motor"), str(path)).round())
    assert all(a.t <= b.t for a, b in itertools.pairwise(samples))
    states, switches = [s for s in samples if not s.switch], [s for s in samples if s.switch]
    np.testing.assert_allclose(np.diff([s.t for s in states]), 0.01)
    late = np.array([s.t for s in switches]) % 0.01
    np.testing.assert_allclose(late, 0.003, atol=1e-9)
    volts = [s.u[0] for s in switches]
    np.testing.assert_array_equal(np.diff(volts) % 3, 1)
    np.testing.assert_array_equal([s.u[0] for s in states[1:]], volts[: len(states) - 1])


def test_a_loop_goes_on_in_time(tmp_path: Path) -> None:
    t = np.arange(20) * 0.01
    path = written(tmp_path / "run.csv", "t,voltage,current,speed", t, 0 * t, 0 * t, t)
    playback = Playback(Model.load("dc_motor"), path)
    times = [s.t for s in itertools.islice(playback.rounds(loop=True), 70)]
    np.testing.assert_allclose(np.diff(times), 0.01, atol=1e-9)
    assert len(list(playback.rounds(loop=False))) == 20


@pytest.mark.parametrize(("first", "clock"), [(3.0, 3.0), (0.0, 0.0), (-2.5, 0.0), (1.8e9, 1.8e9), (2.2e9, 0.0)])
def test_a_published_clock_is_one_that_ros_can_hold(tmp_path: Path, first: float, clock: float) -> None:
    t = np.arange(50) * 0.01
    path = written(tmp_path / "run.csv", "t,voltage,current,speed", t + first, 0 * t, 0 * t, t)
    assert Playback(Model.load("dc_motor"), path).clock_start == clock


@pytest.mark.parametrize(
    ("first", "bound"), [(3.0, None), (-2.5, -2.5), (2.0**31 - 0.25, 2.0**31 + 0.24), (2.2e9, 2.2e9)]
)
def test_the_time_that_ros_cannot_hold_is_found(tmp_path: Path, first: float, bound: float | None) -> None:
    t = np.arange(50) * 0.01
    path = written(tmp_path / "run.csv", "t,voltage,current,speed", t + first, 0 * t, 0 * t, t)
    assert Playback(Model.load("dc_motor"), path).not_in_ros == (
        bound if bound is None else pytest.approx(bound, abs=1e-6)
    )


def test_velocity_comes_from_positions_and_that_is_said(tmp_path: Path) -> None:
    t = np.arange(400) * 0.005
    path = written(tmp_path / "run.csv", "t,force,displacement", t, 0 * t, np.sin(2 * t))
    playback = Playback(Model.load("mass_spring_damper"), path)
    velocity = np.array([s.x[1] for s in playback.round()])
    np.testing.assert_allclose(velocity[20:], 2 * np.cos(2 * t)[20:], atol=0.01)
    assert "causal filter, delay" in playback.notes()[0]


def test_only_the_past_is_used(tmp_path: Path) -> None:
    t = np.arange(400) * 0.005
    q = np.sin(2 * t)
    whole = written(tmp_path / "a.csv", "t,force,displacement", t, 0 * t, q)
    other = written(tmp_path / "b.csv", "t,force,displacement", t, 0 * t, np.where(t < 1.0, q, 5.0))
    model = Model.load("mass_spring_damper")
    first, second = ([s.x for s in Playback(model, path).round() if s.t < 0.99] for path in (whole, other))
    np.testing.assert_array_equal(first, second)


def test_states_that_nobody_measures_are_carried_by_the_model(tmp_path: Path) -> None:
    t = np.arange(400) * 0.005
    path = written(tmp_path / "run.csv", "t,force,displacement,velocity", t, 0 * t, np.sin(2 * t), 2 * np.cos(2 * t))
    playback = Playback(Model.load("bouc_wen"), path)
    hysteresis = np.array([s.x[2] for s in playback.round()])
    assert np.isfinite(hysteresis).all()
    assert np.ptp(hysteresis) > 0.1
    assert playback.notes() == ["carried by the model: hysteresis"]


def test_what_a_sensor_adds_is_played_but_not_followed(tmp_path: Path) -> None:
    """Published is what was measured; a velocity, and what the model carries, come from the true values."""
    t = np.arange(400) * 0.005
    path = written(tmp_path / "run.csv", "t,force,displacement", t, 0 * t, 3.0 + 2.0 * np.sin(2 * t))
    model = Model.load("bouc_wen").with_effect("sensor_offset", displacement=3.0, velocity=1.0)
    model = model.with_effect("sensor_gain", displacement=2.0)
    shown = np.array([s.x for s in Playback(model, path).round()])
    np.testing.assert_allclose(shown[:, 0], 3.0 + 2.0 * np.sin(2 * t), rtol=1e-14)
    np.testing.assert_allclose(shown[20:, 1], 1.0 + 2.0 * np.cos(2 * t)[20:], atol=0.01)
    bare = written(tmp_path / "true.csv", "t,force,displacement", t, 0 * t, np.sin(2 * t))
    true = np.array([s.x for s in Playback(Model.load("bouc_wen"), bare).round()])
    np.testing.assert_allclose(shown[:, 2], true[:, 2], rtol=1e-9, atol=1e-12)


def test_a_simulated_drive_shows_what_its_sensors_show() -> None:
    model = Model.load("dc_motor").with_effect("sensor_delay", speed=0.025, current=0.0)
    model = model.with_effect("sensor_gain", current=2.0).with_effect("sensor_offset", speed=0.5)
    measuring = Measuring(model, 0.01, np.array([1.0, 7.0]))
    np.testing.assert_allclose(measuring.shown(), [2.0, 7.5])
    for k in range(1, 20):
        measuring.take(np.array([1.0 + k, 7.0 - 3.0 * k]))
        late = max(k - 2.5, 0.0) if k > 2 else 0.0  # straight between samples, at rest before the first
        np.testing.assert_allclose(measuring.shown(), [2.0 * (1.0 + k), 7.0 - 3.0 * late + 0.5])


def test_perfect_sensors_show_the_state_to_the_last_bit() -> None:
    measuring = Measuring(Model.load("dc_motor"), 0.005, np.zeros(2))
    for x in np.random.default_rng(2).normal(0.0, 1e3, (50, 2)):
        measuring.take(x)
        np.testing.assert_array_equal(measuring.shown(), x)


def test_what_cannot_be_played(tmp_path: Path) -> None:
    t = np.arange(50) * 0.01
    path = written(tmp_path / "run.csv", "t,voltage", t, t)
    with pytest.raises(InputError, match="none of the states current, speed"):
        Playback(Model.load("dc_motor"), path)
    with pytest.raises(InputError, match="record: missing"):
        Playback(Model.load("dc_motor"), "")
    path = written(tmp_path / "run.csv", "t,speed", t, t)
    with pytest.raises(InputError, match="voltage"):
        Playback(Model.load("dc_motor"), path)


def test_emps() -> None:
    """The causal velocity is near the one that a zero-phase filter finds afterwards."""
    playback = Playback(Model.load("emps"), real("emps", "DATA_EMPS_PULSES.csv"))
    x = np.array([s.x for s in playback.round()])
    t, q = playback.t, x[:, 0]
    b, a = butter(4, 2 * 50.0 * playback.step)
    velocity = np.gradient(filtfilt(b, a, q), t)
    error = np.sqrt(np.mean((x[100:, 1] - velocity[100:]) ** 2))
    assert error < 0.05 * velocity.std()
    assert "velocity from displacement" in playback.notes()[0]


def test_xl330() -> None:
    playback = Playback(Model.load("xl330"), real("xl330", "xl330_kp400_sin_sin.csv"))
    x = np.array([s.x for s in playback.round()])
    assert np.isfinite(x).all()
    assert 1.0 < np.ptp(x[:, 0]) < 3.0
    assert 1.0 < np.abs(x[:, 1]).max() < 10.0


@pytest.mark.parametrize("kind", INPUT_SIGNALS[1:])
def test_input_signals_have_the_stated_amplitude_and_period(kind: str) -> None:
    signal = input_signal(kind, 3.0, 2.0)
    assert signal is not None
    t = np.arange(4096) / 2048
    values = np.array([signal(one) for one in t])
    assert np.abs(values).max() == pytest.approx(3.0, rel=1e-3)
    assert abs(values.mean()) < 1e-9
    np.testing.assert_allclose(values, [signal(one + 2.0) for one in t], atol=1e-9)


def test_an_external_input_is_no_signal() -> None:
    assert input_signal("external", 1.0, 1.0) is None
