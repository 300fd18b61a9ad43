"""A set point that is taken for a force or a voltage is refused; forces and voltages are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from signlin_ros.checks import check
from signlin_ros.checks.finding import Finding
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

Array = NDArray[np.float64]
STEP, SAMPLES = 0.01, 2000
DRIVE = Model.from_dict(
    {"plant": "mass_spring_damper", "axis": "rotary", "parameters": {"m": 0.02, "c": 0.05, "k": 0.0}}
)
MOTOR = Model.load("dc_motor")


def steps(size: float, seed: int = 1, every: int = 50) -> Array:
    return np.repeat(np.random.default_rng(seed).uniform(-size, size, SAMPLES // every), every)


def followed(goal: Array, gain: float, seed: int = 2) -> Array:
    """Return what a loop of the second order makes of a goal (T,), with noise."""
    y, rate, found = 0.0, 0.0, np.empty(goal.size)
    for k, wanted in enumerate(gain * goal):
        found[k] = y
        for _ in range(10):
            rate += 0.1 * STEP * (400.0 * (wanted - y) - 32.0 * rate)
            y += 0.1 * STEP * rate
    return found + 1e-3 * found.std() * np.random.default_rng(seed).normal(size=goal.size)


def record(model: Model, u: Array, measured: dict[str, Array], label: str) -> ModelData:
    name = model.inputs[0]
    t = np.arange(u.size) * STEP
    return ModelData(
        t, u[:, None], measured, None, model.inputs, model.states, dict(model.units), "run.csv", labels={name: label}
    )


def refused(model: Model, data: ModelData) -> list[Finding]:
    return [f for f in check(model, [data])[1] if f.check in ("position_command", "speed_command")]


@pytest.mark.parametrize("gain", [1.57, 0.0015, -0.4])
def test_a_command_of_position_in_units_of_its_own(gain: float) -> None:
    goal = steps(0.6) / abs(gain)
    (found,) = refused(DRIVE, record(DRIVE, goal, {"displacement": followed(goal, gain)}, "pulse_us"))
    assert found.open
    assert f"{gain:.3g} times the number of the force (column 'pulse_us')" in found.sentence


def test_what_a_proportional_controller_puts_out_is_no_command() -> None:
    goal, gain, q, v = np.repeat([0.4, -0.9, 0.7, 0.1], SAMPLES // 4), 0.06, 0.0, 0.0
    u, x = np.empty(SAMPLES), np.empty(SAMPLES)
    for k, wanted in enumerate(goal):
        u[k], x[k] = gain * (wanted - q), q
        for _ in range(10):
            v += 0.1 * STEP * (u[k] - 0.05 * v) / 0.02
            q += 0.1 * STEP * v
    for part in (slice(0, SAMPLES // 4), slice(SAMPLES // 4, SAMPLES // 2)):
        assert not refused(DRIVE, record(DRIVE, u[part], {"displacement": x[part]}, "c1"))


@pytest.mark.parametrize(
    "label", ["pulse [N·m]", "motor torque", "force", "0.045 * iq", "14.4 * i_q", "37.0 * p_kPa", "2 * (pA - pB)"]
)
def test_what_is_called_a_force_may_push_against_a_spring(label: str) -> None:
    model = DRIVE.with_parameters(k=0.6)
    u = steps(0.5)
    x = simulate(model, np.arange(SAMPLES) * STEP, u[:, None]).x
    assert not refused(DRIVE, record(DRIVE, u, {"displacement": x[:, 0]}, label))


@pytest.mark.parametrize("label", ["axis_2", "force"])
def test_a_force_on_a_free_mass_is_no_command(label: str) -> None:
    u = np.cumsum(np.random.default_rng(3).normal(size=SAMPLES)) * 0.02
    for force in (u - u.mean(), steps(0.3)):
        x = simulate(DRIVE.with_effect("coulomb_friction", mu=0.05), np.arange(SAMPLES) * STEP, force[:, None]).x
        measured = {"displacement": x[:, 0], "velocity": x[:, 1]}
        assert not refused(DRIVE, record(DRIVE, force, measured, label))


@pytest.mark.parametrize(("times", "unit"), [(1.0, ""), (9.549296585513721, " in rpm")])
def test_a_command_of_speed(times: float, unit: str) -> None:
    goal = steps(40.0)
    data = record(MOTOR, times * goal, {"speed": followed(goal, 1.0)}, "n_soll")
    (found,) = refused(MOTOR, data)
    assert f"settles at the number of the voltage (column 'n_soll'){unit}: this is a commanded speed" in found.sentence
    assert not refused(MOTOR, replace(data, labels={"voltage": "u [V]"}))


def test_a_voltage_is_no_command_of_speed() -> None:
    u = steps(4.0)
    x = simulate(MOTOR, np.arange(SAMPLES) * STEP, u[:, None]).x
    assert not refused(MOTOR, record(MOTOR, u, {"current": x[:, 0], "speed": x[:, 1]}, "axis_2"))


def test_zeros_of_an_input_in_bursts_are_a_second_source() -> None:
    rng = np.random.default_rng(5)
    t = np.arange(SAMPLES) * STEP
    u = 0.3 * np.sin(1.3 * t) + 0.2 * np.sin(3.1 * t + 1.0)
    x = simulate(DRIVE, t, u[:, None]).x
    told = u.round(4)
    for k in range(20, SAMPLES - 10, 40):
        told[k : k + rng.integers(1, 5)] = 0.0
    data = record(DRIVE, told, {"displacement": x[:, 0], "velocity": x[:, 1]}, "force")
    (found,) = [f for f in check(DRIVE, [data])[1] if f.check == "two_sources"]
    assert (found.cure, found.open) == ("hold_force", True)
    (cured,), _ = check(DRIVE, [data], ["hold_force"])
    assert "on the line between the values beside them" in found.remedy
    assert np.abs(cured.u[:, 0] - u).max() < 0.01 * np.abs(u).max()  # held: 0.07
