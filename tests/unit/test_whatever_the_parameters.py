"""Faults of a record that are told whatever the parameters of the model are: by work, by directions, by leaps."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from numpy.typing import NDArray

from signlin_ros.checks import Finding, check
from signlin_ros.checks.base import with_channel
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

Array = NDArray[np.float64]
STEP, SAMPLES = 0.01, 1600
NOISE = {"current": 0.02, "speed": 0.1, "position": 1e-3}
MOTOR = Model.load("dc_motor").without_effect("coulomb_friction").with_options(with_position=True)
FAR = MOTOR.with_parameters(J=40.0 * MOTOR.parameters["J"], B=0.02)


@functools.cache
def driven(channels: tuple[str, ...] = ("current", "speed", "position"), mean: float = 0.0) -> ModelData:
    """Return what a motor with dry friction does under levels that are held for 0.3 s."""
    rng = np.random.default_rng(5)
    u = mean + np.repeat(rng.uniform(-8.0, 8.0, SAMPLES), 30)[:SAMPLES]
    t = np.arange(SAMPLES) * STEP
    model = MOTOR.with_effect("coulomb_friction", mu=0.033)
    x = simulate(model, t, u[:, None]).x
    seen = {n: x[:, model.states.index(n)] + NOISE[n] * rng.normal(size=SAMPLES) for n in channels}
    return ModelData(t, u[:, None], seen, None, MOTOR.inputs, MOTOR.states, dict(MOTOR.units), "run.csv")


def told(model: Model, data: ModelData, *cures: str) -> tuple[ModelData, dict[str, list[Finding]]]:
    (after,), findings = check(model, [data], cures)
    found: dict[str, list[Finding]] = {}
    for finding in findings:
        found.setdefault(finding.check, []).append(finding)
    return after, found


@pytest.mark.parametrize("name", ["voltage", "current"])
def test_a_reversed_sign_is_told_by_the_work(name: str) -> None:
    data = driven()
    values = data.u[:, 0] if name == "voltage" else data.measured["current"]
    after, found = told(FAR, with_channel(data, name, -values), f"reverse_{name}")
    (finding,) = found["unit_or_sign"]
    assert finding.applied
    assert "gives back" in finding.said
    np.testing.assert_array_equal(after.u[:, 0], data.u[:, 0])
    np.testing.assert_array_equal(after.measured["current"], data.measured["current"])


@pytest.mark.parametrize("channels", [("current", "speed"), ("speed",), ("position",)])
def test_right_signs_are_not_doubted_however_far_the_parameters_are(channels: tuple[str, ...]) -> None:
    cures = [f.cure for f in told(FAR, driven(channels))[1].get("unit_or_sign", [])]
    assert not any("reverse" in cure for cure in cures)


@pytest.mark.parametrize("late", [40, 60])
def test_an_input_that_is_late_is_not_reversed(late: int) -> None:
    spring = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 2.0, "k": 40.0}})
    rng = np.random.default_rng(3)
    t = np.arange(SAMPLES) * STEP
    tones = zip((3.0, 4.4, 5.2, 6.1, 7.3, 8.8), rng.uniform(0.0, 6.0, 6), strict=True)
    u = np.sum([np.sin(rate * t + phase) for rate, phase in tones], axis=0)
    x = simulate(spring.with_effect("coulomb_friction", mu=0.2), t, u[:, None]).x + 1e-3 * rng.normal(size=(SAMPLES, 2))
    seen = {"displacement": x[:, 0], "velocity": x[:, 1]}
    delayed = np.concatenate([np.full(late, u[0]), u[:-late]])[:, None]
    data = ModelData(t, delayed, seen, None, spring.inputs, spring.states, dict(spring.units), "run.csv")
    far = spring.with_parameters(m=40.0, c=0.05, k=1.0)
    assert not any("reverse" in finding.cure for finding in told(far, data)[1].get("unit_or_sign", []))


def test_a_current_without_a_sign_is_refused() -> None:
    data = driven()
    unsigned = with_channel(data, "current", np.abs(data.measured["current"]))
    after, found = told(MOTOR, unsigned, "leave_out_current")
    assert found["unsigned_current"][0].applied
    assert "current" not in after.measured
    assert told(MOTOR, unsigned)[1]["unsigned_current"][0].open


@pytest.mark.parametrize("mean", [0.0, 9.0])
def test_a_current_with_a_sign_is_right_also_one_that_never_changes_it(mean: float) -> None:
    assert "unsigned_current" not in told(MOTOR, driven(mean=mean))[1]


def test_a_position_that_was_set_anew_is_continued() -> None:
    data = driven()
    q = data.measured["position"].copy()
    q[900:] -= q[900]
    after, found = told(MOTOR, with_channel(data, "position", q))
    assert found["leap"][0].applied
    np.testing.assert_allclose(after.measured["position"], data.measured["position"], atol=0.2)


def test_a_reading_that_failed_and_caught_up_is_no_leap() -> None:
    data = driven()
    q = data.measured["position"].copy()
    fast = int(np.argmax(np.abs(data.measured["speed"][100:-100]))) + 100
    q[fast - 30 : fast] = q[fast - 30]
    assert "leap" not in told(MOTOR, data)[1]
    assert "leap" not in told(MOTOR, with_channel(data, "position", q))[1]


def test_a_gear_near_a_unit_is_no_unit() -> None:
    data = driven()
    after, found = told(MOTOR, with_channel(data, "speed", 48.0 * data.measured["speed"]), "scale_speed")
    assert "unit_or_sign" not in found
    assert "48 times (a gear, or a unit)" in found["position_velocity"][0].said
    ratio = np.median(after.measured["speed"] / data.measured["speed"])
    assert ratio == pytest.approx(1.0, rel=0.01)


def test_many_wild_positions_of_a_smooth_motion_in_coarse_steps_are_left_out() -> None:
    data = driven(("speed", "position"))
    step = 2.0 * np.pi / 16384
    x = step * np.round(np.cumsum(data.measured["speed"]) * STEP / step)
    x = np.convolve(x, np.ones(9) / 9, "same")
    x = step * np.round(x / step)
    at = np.arange(100, SAMPLES - 100, 60)
    wild = x.copy()
    wild[at] = np.random.default_rng(2).uniform(300.0, 900.0, at.size)
    after, found = told(MOTOR, with_channel(data, "position", wild))
    assert found["wild_samples"][0].applied
    assert np.flatnonzero(np.isnan(after.measured["position"])).tolist() == at.tolist()


def test_where_a_smooth_motion_turns_it_does_not_jump_to_a_level() -> None:
    damper = Model.load("force_element")
    t = np.arange(3000) * 0.002
    x = 2e-6 * np.round(0.01 * np.sin(2.0 * np.pi * 1.7 * t) / 2e-6)
    v = np.gradient(x, t)
    force = 800.0 * v + 50.0 * np.sign(v) + np.random.default_rng(1).normal(size=t.size)
    seen = {"displacement": x, "force": force}
    data = ModelData(t, v[:, None], seen, None, damper.inputs, damper.states, dict(damper.units), "run.csv")
    assert "two_sources" not in told(damper, data)[1]


def test_parameters_that_are_off_are_no_two_units() -> None:
    drive = Model.from_dict(
        {"plant": "mass_spring_damper", "axis": "rotary", "parameters": {"m": 0.09, "c": 0.03, "k": 0.0}}
    )
    rng = np.random.default_rng(4)
    t = np.arange(2000) * STEP
    u = np.repeat(rng.uniform(-3.0, 3.0, 40), 50) + np.sin(9.0 * t)
    v = simulate(drive.with_effect("coulomb_friction", mu=0.45), t, u[:, None]).x[:, 1]
    seen = {"velocity": v + 0.05 * rng.normal(size=t.size)}
    data = ModelData(t, u[:, None] / 0.35, seen, None, drive.inputs, drive.states, dict(drive.units), "run.csv")
    assert not [finding for finding in told(drive, data)[1].get("unit_or_sign", []) if "," in finding.channel]
