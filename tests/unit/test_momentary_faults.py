"""What goes wrong in a record for a moment: wild inputs and forces, readings that are held, zeros of a held command;
and what two faults at once look like.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from signlin_ros.checks.base import with_channel
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.linear import linear_base
from signlin_ros.checks.run import check
from signlin_ros.errors import RecordError
from signlin_ros.model import Model
from signlin_ros.records import ModelData, read_for_model
from signlin_ros.records.notes import Note
from signlin_ros.simulation import simulate

Array = NDArray[np.float64]
STEP, SAMPLES = 0.01, 1500
MOTOR = Model.load("dc_motor").without_effect("coulomb_friction")
QUASI_STATIC = MOTOR.with_parameters(L_a=0.0)
DAMPER = Model.load("force_element").without_effect("coulomb_friction")


def held_command(rng: np.random.Generator, scale: float = 8.0) -> Array:
    """Return levels that are held for 5 to 60 samples."""
    levels = np.repeat(rng.uniform(-scale, scale, SAMPLES), rng.integers(5, 60, SAMPLES))
    return np.asarray(levels[:SAMPLES])


def motor(model: Model = MOTOR, seed: int = 1) -> ModelData:
    """Return what a motor with dry friction does under such a command, with noise on its sensors."""
    rng = np.random.default_rng(seed)
    t, u = np.arange(SAMPLES) * STEP, held_command(rng)
    run = simulate(model.with_effect("coulomb_friction", mu=0.02), t, u[:, None])
    speed = run.x[:, run.states.index("speed")]
    current = (u - model.parameters["K_m"] * speed) / model.parameters["R_a"]
    noisy = {"current": current + 0.02 * rng.normal(size=SAMPLES), "speed": speed + 0.1 * rng.normal(size=SAMPLES)}
    noisy = noisy if model is QUASI_STATIC else {"speed": noisy["speed"]}
    return ModelData(t, u[:, None], noisy, None, model.inputs, model.states, dict(model.units), "run.csv")


def damper(seed: int = 1) -> ModelData:
    """Return a damper with dry friction whose velocity is the rate of its displacement."""
    rng = np.random.default_rng(seed)
    t = np.arange(SAMPLES) * STEP / 10
    x = 0.01 * np.sin(9.0 * t) + 0.004 * np.sin(31.0 * t + 1.0)
    v = np.gradient(x, t)
    force = DAMPER.parameters["c"] * v + 50.0 * np.sign(v) + 2.0 * rng.normal(size=SAMPLES)
    measured = {"displacement": x + 3e-5 * rng.normal(size=SAMPLES), "force": force}
    notes = (Note("velocity is the derivative of a spline through displacement", "derived", "velocity"),)
    names = DAMPER.inputs, DAMPER.states, dict(DAMPER.units)
    return ModelData(t, v[:, None], measured, None, *names, "damper.csv", notes=notes)


def checked(model: Model, record: ModelData, *cures: str) -> tuple[ModelData, dict[str, list[Finding]]]:
    (after,), findings = check(model, [record], cures)
    found: dict[str, list[Finding]] = {}
    for finding in findings:
        found.setdefault(finding.check, []).append(finding)
    return after, found


def with_spikes(values: Array, size: float, count: int = 9) -> tuple[Array, NDArray[np.intp]]:
    rng = np.random.default_rng(7)
    at = np.sort(rng.choice(np.arange(20, SAMPLES - 20, 7), count, replace=False))
    found = values.copy()
    found[at] += rng.choice([-1.0, 1.0], count) * size * rng.uniform(1.0, 5.0, count)
    return found, at


@pytest.mark.parametrize("model", [MOTOR, QUASI_STATIC])
def test_wild_samples_of_an_input_that_drove_nothing_are_replaced(model: Model) -> None:
    record = motor(model)
    spiked, at = with_spikes(record.u[:, 0], 300.0)
    after, found = checked(model, with_channel(record, "voltage", spiked))
    (finding,) = found["wild_samples"]
    assert finding.applied
    assert "the motion does not follow" in finding.said
    assert np.flatnonzero(after.u[:, 0] != spiked).tolist() == at.tolist()
    assert np.mean(after.u[:, 0] == record.u[:, 0]) > 0.995  # where a level began with one, the one before is held


def test_pulses_that_drove_the_machine_are_left_alone() -> None:
    rng = np.random.default_rng(3)
    u, at = with_spikes(held_command(rng), 60.0)
    t = np.arange(SAMPLES) * STEP
    run = simulate(MOTOR.with_effect("coulomb_friction", mu=0.02), t, u[:, None])
    speed = run.x[:, run.states.index("speed")] + 0.1 * rng.normal(size=SAMPLES)
    names = MOTOR.inputs, MOTOR.states, dict(MOTOR.units)
    record = ModelData(t, u[:, None], {"speed": speed}, None, *names, "hammer.csv")
    assert at.size
    assert "wild_samples" not in checked(MOTOR, record)[1]
    reversed_one = with_channel(record, "voltage", -u)  # what the input does is in doubt as a whole
    assert "wild_samples" not in checked(MOTOR, reversed_one)[1]


def test_wild_samples_of_a_force_and_of_a_displacement_are_left_out() -> None:
    record = damper()
    force, at = with_spikes(record.measured["force"], 2e4)
    after, found = checked(DAMPER, with_channel(record, "force", force))
    assert found["wild_samples"][0].channel == "force"
    assert np.flatnonzero(np.isnan(after.measured["force"])).tolist() == at.tolist()
    place, at = with_spikes(record.measured["displacement"], 0.5)
    wrong = np.gradient(place, record.t)
    after, found = checked(DAMPER, with_channel(with_channel(record, "displacement", place), "velocity", wrong))
    assert found["wild_samples"][0].channel == "displacement"
    assert np.abs(after.u[5:-5, 0] - record.u[5:-5, 0]).max() < 0.1 * np.abs(record.u).max()  # worked out anew


def test_a_channel_at_the_end_of_its_range_is_clipped_and_no_reading_failed() -> None:
    record = motor(QUASI_STATIC)
    limit = 0.6 * np.abs(record.measured["current"]).max()
    clipped = np.clip(record.measured["current"], -limit, limit)
    found = checked(QUASI_STATIC, with_channel(record, "current", clipped))[1]
    assert "held_readings" not in found
    assert [finding.channel for finding in found["clipped"]] == ["current"]


def test_readings_that_are_held_are_left_out() -> None:
    record = motor()
    speed, lost = record.measured["speed"].copy(), np.zeros(SAMPLES, dtype=bool)
    for k in range(50, SAMPLES - 50, 100):
        speed[k : k + 13], lost[k + 1 : k + 13] = speed[k], True
    after, found = checked(MOTOR, with_channel(record, "speed", speed))
    assert found["held_readings"][0].applied
    assert not np.isin(record.t[lost & (np.diff(record.u[:, 0], prepend=0.0) == 0.0)], after.t).any()
    assert np.isfinite(after.measured["speed"]).sum() == SAMPLES - lost.sum()
    rests = replace(record, measured={"speed": np.where(np.abs(record.measured["speed"]) < 5.0, 0.0, speed)})
    assert "held_readings" not in checked(MOTOR, motor())[1]
    assert "held_readings" in checked(MOTOR, rests)[1]  # a sensor that is asleep is another matter


def test_a_machine_that_friction_holds_is_no_reading_that_is_held() -> None:
    model = Model.load("mass_spring_damper").without_effect("coulomb_friction").with_parameters(k=0.0)
    rng = np.random.default_rng(5)
    t, u = np.arange(SAMPLES) * STEP, held_command(rng, 2.0)
    x = simulate(model.with_effect("coulomb_friction", mu=1.0), t, u[:, None]).x
    measured = {"displacement": x[:, 0], "velocity": x[:, 1]}
    still = np.count_nonzero(np.diff(x[:, 0]) == 0.0)
    assert still > 100
    names = model.inputs, model.states, dict(model.units)
    assert "held_readings" not in checked(model, ModelData(t, u[:, None], measured, None, *names, "stage.csv"))[1]


def test_zeros_of_a_held_command_that_never_reached_the_drive() -> None:
    record = motor()
    told = record.u[:, 0].copy()
    for k in range(40, SAMPLES - 40, 30):
        told[k : k + 4] = 0.0
    after, found = checked(MOTOR, with_channel(record, "voltage", told))
    assert found["two_sources"][0].cure == "hold_voltage"
    assert found["two_sources"][0].open
    after, _ = checked(MOTOR, with_channel(record, "voltage", told), "hold_voltage")
    wrong = [np.mean((u - record.u[:, 0]) ** 2) for u in (after.u[:, 0], told)]
    assert wrong[0] < 0.1 * wrong[1]  # what is left: small levels, and where a level changed meanwhile


def test_readings_that_failed_together_leave_the_input_as_it_was() -> None:
    record = motor(QUASI_STATIC)
    measured = {name: values.copy() for name, values in record.measured.items()}
    for k in range(43, SAMPLES - 40, 37):
        for values in measured.values():
            values[k : k + 5] = 0.0
    after, found = checked(QUASI_STATIC, replace(record, measured=measured))
    assert found["two_sources"][0].applied
    held = record.u[np.searchsorted(record.t, after.t), 0]
    assert np.array_equal(after.u[:, 0], held)
    changes = np.flatnonzero(np.diff(record.u[:, 0]))
    assert np.isin(record.t[changes + 1], after.t).all()


def test_a_wrapped_angle_with_lost_readings_is_unwrapped() -> None:
    model = Model.load("mass_spring_damper").without_effect("coulomb_friction").with_parameters(k=0.0)
    t = np.arange(SAMPLES) * STEP
    q = 9.0 * np.sin(0.7 * t) + 0.03 * np.random.default_rng(1).normal(size=SAMPLES)
    told, at = with_spikes(np.mod(q, 2.0 * np.pi), 50.0, 6)
    units = {**model.units, "force": "N·m", "displacement": "rad", "velocity": "rad/s"}
    u = np.cos(0.7 * t)[:, None]
    record = ModelData(t, u, {"displacement": told}, None, model.inputs, model.states, units, "arm.csv")
    after, found = checked(model, record)
    assert "6 samples far from their neighbours aside" in found["wrapped_angle"][0].said
    rest = after.measured["displacement"] - q[np.isin(t, after.t)]
    there = np.isfinite(rest)
    assert np.ptp(rest[there]) < 1e-9
    assert at.size == SAMPLES - there.sum()


def test_the_current_of_a_winding_without_inductance_has_its_own_row() -> None:
    base = linear_base(QUASI_STATIC)
    assert base is not None
    row, direct, _ = base.rows["current"]
    R, K = QUASI_STATIC.parameters["R_a"], QUASI_STATIC.parameters["K_m"]
    assert (row[0], direct[0]) == pytest.approx((-K / R, 1.0 / R))


def test_a_unit_and_a_sign_at_once_are_told_together() -> None:
    record = motor(QUASI_STATIC)
    wrong = replace(record, measured={"current": 1e3 * record.measured["current"], "speed": -record.measured["speed"]})
    _, found = checked(QUASI_STATIC, wrong)
    cures = [f.cure for f in found["unit_or_sign"]]
    assert "current_in_mA_reverse_speed" in cures
    after, _ = checked(QUASI_STATIC, wrong, "current_in_mA_reverse_speed")
    assert after.measured["current"] == pytest.approx(record.measured["current"])


def test_an_input_whose_unit_is_assumed_may_be_nothing(tmp_path) -> None:
    record = motor()
    rows = [f"{t:g},1e-310,{w:g}" for t, w in zip(record.t, record.measured["speed"], strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(["t,voltage,speed [rad/s]", *rows]))
    _, found = checked(MOTOR, read_for_model(tmp_path / "a.csv", MOTOR))
    assert found["nothing_measured"][0].open
    rows = [f"{t:g},nan,{w:g}" for t, w in zip(record.t, record.measured["speed"], strict=True)]
    (tmp_path / "b.csv").write_text("\n".join(["t,voltage,speed [rad/s]", *rows]))
    with pytest.raises(RecordError, match="nothing measures it; map the column of what drives it, --signal voltage="):
        read_for_model(tmp_path / "b.csv", MOTOR)


def test_the_only_force_of_an_imposed_motion_must_be_something() -> None:
    record = with_channel(damper(), "force", np.zeros(SAMPLES))
    _, found = checked(DAMPER, record)
    (finding,) = found["frozen_channel"]
    assert finding.open
    assert "--signal force=COLUMN" in finding.said
