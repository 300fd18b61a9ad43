"""Every check in both directions: the fault is found and its cure undoes it; nothing is found where there is none."""

from __future__ import annotations

import functools
import json
import os
from collections.abc import Callable
from dataclasses import replace
from importlib import resources
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from numpy.typing import NDArray

from signlin_ros.checks import CHECKS, Finding, check, require_sound, to_json
from signlin_ros.checks.base import values_of, with_channel
from signlin_ros.checks.direction import with_direction
from signlin_ros.checks.exchanged import exchanged
from signlin_ros.checks.factors import other_units
from signlin_ros.checks.integer_overflow import IntegerOverflow
from signlin_ros.checks.look import Look
from signlin_ros.checks.observer import LinearPrediction
from signlin_ros.cli import main
from signlin_ros.errors import InputError, RecordError
from signlin_ros.model import Model
from signlin_ros.records import ModelData, read_for_model
from signlin_ros.records.notes import Note
from signlin_ros.simulation import simulate

Array = NDArray[np.float64]
FIELD = Path(os.environ.get("SIGNLIN_DATA", "../shared/data")) / "field"
field = pytest.mark.skipif(not FIELD.is_dir(), reason=f"no records at {FIELD} (set SIGNLIN_DATA)")

STEP, SAMPLES = 0.01, 1600
NOISE = {"current": 0.02, "speed": 0.1, "position": 0.005, "displacement": 0.002, "velocity": 0.01}


def record(model: Model, u: Array, seed: int = 1, quantum: float = 0.0) -> ModelData:
    """Return what a model does, with noise on its sensors; ``quantum``: the step of its position."""
    rng = np.random.default_rng(seed)
    t = np.arange(u.size) * STEP
    x = simulate(model, t, u[:, None]).x
    measured = {n: x[:, i] + NOISE[n] * rng.normal(size=u.size) for i, n in enumerate(model.states)}
    if quantum:
        measured["position"] = quantum * np.round(x[:, model.states.index("position")] / quantum)
    return ModelData(t, u[:, None], measured, None, model.inputs, model.states, dict(model.units), "run.csv")


def multisine(scale: float = 1.0) -> Array:
    t = np.arange(SAMPLES) * STEP
    return scale * (3.0 * np.sin(2.1 * t) + 2.0 * np.sin(5.3 * t + 1.0) + 1.0 * np.sin(11.0 * t + 2.0))


@functools.cache
def motor() -> tuple[Model, ModelData]:
    """Return a motor without friction, and the record of one with friction."""
    base = Model.load("dc_motor").without_effect("coulomb_friction").with_options(with_position=True)
    return base, record(base.with_effect("coulomb_friction", mu=0.033), multisine())


@functools.cache
def oscillator() -> tuple[Model, ModelData]:
    base = Model.load("mass_spring_damper")
    return base, record(base, multisine(4.0))


def changed(name: str, change: Callable[[Array], Array]) -> tuple[Model, ModelData]:
    """Return the motor, and its record with one signal changed."""
    model, data = motor()
    values = data.measured[name] if name in data.measured else data.u[:, 0]
    return model, with_channel(data, name, change(values))


def found(model: Model, data: ModelData, cures: tuple[str, ...] = ()) -> tuple[ModelData, dict[str, Finding]]:
    (record,), findings = check(model, [data], cures)
    return record, {finding.check: finding for finding in findings}


def the(name: str, model: Model, data: ModelData) -> Finding:
    """Return the finding of one check, which must be the only one that is not a note."""
    _, findings = found(model, data)
    assert name in findings, findings
    assert {n for n, f in findings.items() if f.severity != "note"} <= {name}
    return findings[name]


def nothing_but_notes(findings: dict[str, Finding]) -> bool:
    return all(f.severity == "note" and not f.applied for f in findings.values())


# ------------------------------------------------------------------ nothing where there is nothing


@pytest.mark.slow
@pytest.mark.parametrize("drive", [motor, oscillator])
def test_a_clean_record_is_left_alone(drive: Callable[[], tuple[Model, ModelData]]) -> None:
    model, data = drive()
    after, findings = found(model, data)
    assert findings == {}
    assert after is data


def test_a_coarse_encoder_is_neither_clipped_nor_slow() -> None:
    base = motor()[0]
    after, findings = found(base, record(base, multisine(0.3), quantum=0.05))
    assert nothing_but_notes(findings), findings
    assert np.isfinite(after.measured["position"]).all()


def test_steps_and_binary_inputs_are_not_clipped() -> None:
    base = motor()[0]
    steps = np.repeat(np.random.default_rng(3).uniform(-5, 5, SAMPLES // 40), 40)
    binary = np.repeat(np.random.default_rng(4).choice([-4.0, 4.0], SAMPLES // 20), 20)
    for u in (steps, binary):
        assert found(base, record(base, u))[1] == {}


# ------------------------------------------------------------------ wraps and overflows


@pytest.mark.parametrize("turn", [2 * np.pi, 4096 * 0.003])
def test_what_wraps_is_unwrapped(turn: float) -> None:
    model, data = motor()
    q = 3.0 * data.measured["position"]
    wrapped = replace(data, measured={"position": (q + 1.0) % turn - 1.0})
    after, findings = found(model, wrapped)
    assert findings["wrapped_angle"].applied
    np.testing.assert_allclose(np.diff(after.measured["position"]), np.diff(q), atol=1e-3 * turn)


def test_a_position_that_jumps_is_not_unwrapped() -> None:
    """A square wave between two stops jumps by its whole range, too, but does not go on through it."""
    model, data = motor()
    q = np.where(np.arange(SAMPLES) // 100 % 2, 2.0, -2.0) + 0.005 * np.random.default_rng(1).normal(size=SAMPLES)
    after, findings = found(model, replace(data, measured={"position": q}))
    assert "wrapped_angle" not in findings
    np.testing.assert_array_equal(after.measured["position"], q)


def test_an_integer_that_overflows_is_continued() -> None:
    step = 0.25
    model, whole = changed("speed", lambda v: step * np.round(v / step))
    v = whole.measured["speed"]
    half = 128 * step
    data = with_channel(whole, "speed", (v + half) % (2 * half) - half)
    assert np.ptp(v) > 2 * half  # else nothing overflows
    after, findings = found(model, data)
    assert findings["integer_overflow"].applied
    np.testing.assert_allclose(after.measured["speed"], v, atol=1e-9)


def test_a_drive_that_is_switched_off_by_about_a_power_of_its_steps_does_not_overflow() -> None:
    model, data = changed("voltage", np.zeros_like)
    rng = np.random.default_rng(1)
    u = np.where(np.arange(SAMPLES) // 200 % 2, 65.1, 0.0) + 0.1 * rng.normal(size=SAMPLES)
    switched = replace(data, u=0.001 * np.round(u / 0.001)[:, None])
    assert not [*IntegerOverflow().find(Look(model, switched))]
    held = replace(switched, u=np.maximum(switched.u, 0.0))  # such as 16 bits without a sign can hold
    assert [*IntegerOverflow().find(Look(model, held))]


def test_a_column_that_states_a_wrong_unit_is_named_beside_the_force_s(tmp_path: Path) -> None:
    model = Model.load("mass_spring_damper").with_parameters(k=0.0)
    t = np.arange(SAMPLES) * STEP
    u = multisine(4.0)
    x = simulate(model, t, u[:, None]).x
    lines = [f"{a:.2f},{b:.6f},{c:.8f}" for a, b, c in zip(t, u, x[:, 0], strict=True)]
    (tmp_path / "run.csv").write_text("\n".join(["t,force [N],displacement [mm]", *lines]))
    _, findings = found(model, read_for_model(tmp_path / "run.csv", model))
    assert "'displacement [mm]') is not in the unit that its column states" in findings["unit_or_sign"].sentence


# ------------------------------------------------------------------ sources, sensors


def test_zeros_of_a_second_publisher_are_left_out() -> None:
    model, data = motor()
    zeros = np.arange(SAMPLES) % 3 == 2
    mixed = {n: np.where(zeros, 0.0, v) for n, v in data.measured.items()}
    after, findings = found(model, replace(data, measured=mixed))
    assert findings["two_sources"].applied
    assert len(after) <= SAMPLES - zeros.sum() + 10
    for name, values in after.measured.items():
        kept = np.isfinite(values)
        expected = np.interp(after.t[kept], data.t, data.measured[name])
        assert np.abs(values[kept] - expected).max() < 1e-9


def test_a_source_that_repeats_one_value_is_left_out_too() -> None:
    model, data = changed("position", lambda q: np.where(np.arange(q.size) % 5 == 2, 50.0, q))
    after, findings = found(model, data)
    assert findings["two_sources"].applied
    assert np.nanmax(after.measured["position"]) < 50.0


def test_zeros_in_an_input_are_refused_until_it_is_said_what_they_are() -> None:
    model, data = motor()
    mixed = with_channel(data, "voltage", np.where(np.arange(SAMPLES) % 4 == 1, 0.0, data.u[:, 0]))
    finding = the("two_sources", model, mixed)
    assert finding.open
    assert finding.cure == "hold_voltage"
    after, findings = found(model, mixed, ("hold_voltage",))
    assert findings["two_sources"].applied
    assert np.abs(after.u - data.u).max() < np.abs(np.diff(data.u[:, 0])).max() + 1e-12


def test_two_curves_by_turns_are_refused() -> None:
    model, data = changed("speed", lambda v: np.where(np.arange(v.size) % 2, v, 20.0 - 0.5 * v))
    assert "two_sources" in found(model, data)[1]


def test_pulses_of_an_input_are_no_second_source() -> None:
    base = motor()[0]
    on_off = 5.0 * (np.arange(SAMPLES) % 3 != 2)
    assert "two_sources" not in found(base, record(base, on_off))[1]


def test_a_slow_sensor_is_taken_at_its_own_rate() -> None:
    model, data = changed("current", lambda i: np.repeat(i[::4], 4))
    after, findings = found(model, data)
    assert findings["repeated_values"].applied
    assert np.isfinite(after.measured["current"]).sum() == SAMPLES // 4
    np.testing.assert_array_equal(after.measured["current"][::4], data.measured["current"][::4])


def test_a_slow_sensor_with_noise_on_what_it_holds_is_taken_at_its_own_rate() -> None:
    rng = np.random.default_rng(2)

    def holds(x: Array) -> Array:
        """9.93 samples a value, each change within two samples, a little noise on all of it."""
        at = np.arange(x.size)
        change = np.floor(at / 9.93)
        last, now = x[(change * 9.93).astype(int)], x[np.maximum((change - 1) * 9.93, 0).astype(int)]
        share = np.clip(at - change * 9.93, 0.5, 1.0)
        return share * last + (1 - share) * now + 1e-4 * np.std(x) * rng.normal(size=x.size)

    model, data = changed("position", holds)
    after, findings = found(model, data)
    assert findings["repeated_values"].channel == "position"
    assert "for 9.93 samples, with noise on it" in findings["repeated_values"].sentence
    assert np.isfinite(after.measured["position"]).sum() == pytest.approx(SAMPLES / 9.93, abs=2)


def test_a_slow_sensor_of_what_rests_now_and_then() -> None:
    """Seven or eight rows a value, for a hundred rows the same one: a tenth of the runs was too long."""
    rng = np.random.default_rng(3)
    lengths = [32, 7, 7, 7, 44, 7, 8, 7, 7, 40]
    current = np.repeat(np.round(rng.normal(size=10), 2), lengths)
    other = np.repeat(np.round(rng.normal(size=10), 2), [32, 4, 11, 2, 44, 9, 17, 5, 2, 40])
    t, model = np.arange(current.size) * 0.013, Model.load("mass_spring_damper")
    for values, slow in ((current, True), (other, False)):
        measured = {"displacement": values}
        data = ModelData(t, np.sin(t)[:, None], measured, None, model.inputs, (), dict(model.units), "run.csv")
        assert ("repeated_values" in found(model, data)[1]) == slow


def test_what_a_held_input_drives_is_no_slow_sensor() -> None:
    """A current that follows a voltage of a new level every ten samples, with noise on it."""
    rng = np.random.default_rng(4)
    base = motor()[0]
    u = np.repeat(rng.normal(size=SAMPLES // 10 + 1), 10)[:SAMPLES]
    data = record(base, u)
    jumps = with_channel(data, "current", u + 1e-3 * rng.normal(size=SAMPLES))
    assert "repeated_values" not in found(base, jumps)[1]


def test_steps_of_a_sensor_at_a_steady_speed_are_no_slow_sensor() -> None:
    """Up and down on grids that lie apart: no common step would tell."""
    half, step = SAMPLES // 2, 0.05
    up = step * (np.arange(half) // 6)
    model, data = changed("position", lambda x: np.concatenate([up, up[-1] - 0.3 * step - up])[: x.size])
    assert "repeated_values" not in found(model, data)[1]


def test_a_stage_that_rests_is_no_slow_sensor() -> None:
    def rests(x: Array) -> Array:
        held = np.arange(x.size) % (x.size // 4)
        return np.where(held < x.size // 10, x[np.arange(x.size) - held], x)

    model, data = changed("position", rests)
    assert "repeated_values" not in found(model, data)[1]


def test_a_dead_channel_is_left_out() -> None:
    model, data = changed("speed", np.zeros_like)
    after, findings = found(model, data)
    assert findings["frozen_channel"].channel == "speed"
    assert "speed" not in after.measured
    assert "position" in after.measured


@pytest.mark.parametrize("part", [0.6, 0.9])
def test_a_clipped_channel_is_offered_to_be_blanked(part: float) -> None:
    limit = part * np.abs(motor()[1].measured["speed"]).max()
    model, data = changed("speed", lambda v: np.clip(v, -limit, limit))
    _, findings = found(model, data)
    assert findings["clipped"].cure == "blank_speed"
    after, _ = found(model, data, ("blank_speed",))
    kept = np.isfinite(after.measured["speed"])
    assert np.abs(after.measured["speed"][kept]).max() <= limit
    assert not kept.all()


def test_an_axis_that_rests_at_its_target_is_not_clipped() -> None:
    """To and fro in steps of 0.01 mm, 70 rows a second: it slows down before, and rests for 45 rows."""
    way = [1.72, 1.71, 1.67, 1.6, 1.43, 1.35, 1.14, 0.98, 0.78, 0.62, 0.39, 0.23, 0.02, -0.15, -0.31, -0.54, -0.74]
    way += [-0.93, -1.12, -1.27, -1.38, -1.53, -1.61, -1.66, -1.72]
    back = [-1.75, -1.69, -1.62, -1.46, -1.37, -1.23, -1.1, -0.89, -0.75, -0.57, -0.36, -0.22, -0.02, 0.13, 0.3, 0.5]
    rests = np.array([*[1.72] * 20, *way, *[-1.76] * 45, *back, *np.arange(0.7, 1.5, 0.19), 1.6, 1.66, 1.7])
    rests = np.concatenate([rests, [1.72] * 7, [1.71] * 6, [1.72] * 34, 1.72 - 0.1 * np.arange(9) ** 1.5])
    cut = np.clip(2.5 * np.cos(np.arange(rests.size) * 0.05), -1.76, 1.9)
    model = Model.load("mass_spring_damper")
    t = np.arange(rests.size) * 0.014

    def clipped(q: Array) -> set[str]:
        data = ModelData(t, np.sin(t)[:, None], {"displacement": q}, None, model.inputs, (), dict(model.units), "run")
        return {f.channel for f in check(model, [data])[1] if f.check == "clipped"}

    assert clipped(cut) == {"displacement"}
    assert not clipped(rests)


def test_an_axis_whose_velocity_says_that_it_stands_is_not_clipped() -> None:
    """Ten samples a second show no braking: an axis came to its end at full pace, and stood there."""
    t = 0.1 * np.arange(1200)
    way = np.clip(1.6 * np.arcsin(np.sin(0.25 * t)), -1.0, 1.0) + 0.002 * np.sin(0.9 * t) * (np.cos(0.25 * t) > 0.8)
    way = np.round(np.clip(way, -1.0, 1.0), 6)
    model = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.5, "k": 0.0}})
    u, measured = np.ones((t.size, 1)), {"displacement": way}
    data = ModelData(t, u, measured, None, model.inputs, model.states, dict(model.units))

    def clipped(measured: ModelData) -> list[Finding]:
        return [f for f in check(model, [measured])[1] if f.check == "clipped" and f.channel == "displacement"]

    (finding,) = clipped(data)
    assert "a stop, or the end of its sensor's range" in finding.sentence
    assert not clipped(replace(data, measured={**data.measured, "velocity": np.gradient(way, 0.1)}))
    assert clipped(replace(data, measured={**data.measured, "velocity": 0.4 * np.cos(0.25 * t)}))


def test_a_machine_that_friction_holds_wherever_it_comes_to_rest_is_not_clipped() -> None:
    """From place to place at full pace, abruptly held at each: the farthest places are no stops."""
    t, places = 0.01 * np.arange(2400), np.random.default_rng(5).uniform(0.2, 0.9, 25)
    way = np.interp(t, np.sort([*np.arange(25.0), *(np.arange(1, 25) - 0.3)]), np.repeat(places, 2)[:-1])
    model = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.5, "k": 0.0}})

    def clipped(way: Array) -> set[str]:
        q = {"displacement": np.round(way, 4)}
        data = ModelData(t, np.ones((t.size, 1)), q, None, model.inputs, model.states, dict(model.units))
        return {f.channel for f in check(model, [data])[1] if f.check == "clipped"}

    assert not clipped(way)
    assert clipped(np.minimum(way, np.sort(places)[-4])) == {"displacement"}


def test_a_drive_that_friction_holds_where_it_turns_back_is_not_clipped() -> None:
    base = motor()[0]
    stuck = base.with_effect("coulomb_friction", mu=0.2)
    u = 4.0 * np.interp(np.arange(SAMPLES) / SAMPLES, [0.0, 0.1, 0.4, 0.9, 1.0], [0.0, 1.0, 1.0, -1.0, -1.0])
    data = record(stuck, u, quantum=2 * np.pi / 2400)
    q = data.measured["position"]
    assert np.count_nonzero(q == q.max()) > 0.05 * q.size
    assert not [f for f in check(base, [data])[1] if f.check == "clipped" and f.channel == "position"]


@pytest.mark.parametrize("top", [0.8, 0.9, 1.0, 1.2])
def test_a_smooth_motion_rests_for_a_step_of_its_sensor_where_it_turns_back(top: float) -> None:
    """Steps of 0.0254 mm, smoothed where they change, 128 values a second: 1 to 4 % of the time at the turn."""
    step, t, fine = 0.0254, np.arange(390) / 128, np.arange(0.0, 3.1, 1e-4)

    def motion(t: Array) -> Array:
        return 2.8 * np.sin(2.0 * t + 0.5) + 0.1 * np.sin(9.3 * t) + (63 + top) * step

    smooth = np.convolve(np.pad(step * np.round(motion(fine) / step), 80, "edge"), np.full(161, 1 / 161), "valid")
    values = np.interp(t, fine, np.round(smooth, 7))
    base = Model.load("mass_spring_damper")

    def clipped(q: Array) -> set[str]:
        data = ModelData(t, np.zeros((t.size, 1)), {"displacement": q}, None, base.inputs, (), dict(base.units), "run")
        return {f.channel for f in check(base, [data])[1] if f.check == "clipped"}

    assert np.count_nonzero(values == values.max()) > 3
    assert not clipped(values)
    assert clipped(np.minimum(motion(t), 4.0)) == {"displacement"}
    assert clipped(np.minimum(values, 160 * step)) == {"displacement"}


def test_a_coarse_force_that_turns_at_full_pace_is_not_clipped() -> None:
    """Levels 25 lbf apart, rounded to 5, that creep up to a reversal and fall at once: "rests at 1956 N"."""
    up = [-150, -45, 65, 155, 200, 245, 270, 295, 320, 345, 345, 370, 395, 370, 395, 415, 395, 415, 440, 440, 440, 440]
    down = [370, 320, 270, 220, 200, 175, 65]
    force = np.array(2 * [*up, *down, *(-x for x in up), *(-x for x in down)], dtype=float)
    t = np.arange(force.size) * 0.1
    model = Model.from_dict({"plant": "force_element", "parameters": {"c": 0.0, "k": 1e5}})
    v = np.gradient(force, t)

    def clipped(force: Array) -> bool:
        data = ModelData(t, v[:, None], {"force": force}, None, model.inputs, (), dict(model.units), "run.csv")
        return any((f.check, f.channel) == ("clipped", "force") for f in check(model, [data])[1])

    assert not clipped(force)
    assert clipped(np.clip(force + np.sin(97.0 * t), -200.0, 200.0))


def test_no_unit_is_asked_for_where_a_guess_of_the_model_would_do_as_well() -> None:
    """A load and dry friction, and a damping that is a guess, and too large: "the force fits if it is in lbf"."""
    rng, t = np.random.default_rng(5), np.arange(400) * 0.01
    v = np.interp(t, [0.0, 2.0, 2.3, 4.0], [-0.0125, -0.01, 0.004, 0.006])
    force = 247.0 + 7.0 * np.sign(v) + 0.05 * rng.normal(size=t.size)
    model = Model.from_dict({"plant": "force_element", "parameters": {"c": 3000.0, "k": 0.0}, "tolerance": 1.0})
    measured = {"force": force, "displacement": np.cumsum(v) * 0.01}
    data = ModelData(t, v[:, None], measured, None, model.inputs, model.states, dict(model.units), "run.csv")
    assert "unit_or_sign" not in found(model, data)[1]


def test_a_force_of_the_speed_alone_has_no_state_to_observe() -> None:
    """ "DGGES ... lwork=0": a damper's force and speed, without the displacement."""
    t = np.arange(400) * 0.01
    v = 0.1 * np.sin(3.0 * t)
    model = Model.from_dict({"plant": "force_element", "parameters": {"c": 3000.0, "k": 0.0}, "tolerance": 0.5})
    data = ModelData(t, v[:, None], {"force": 3000.0 * v}, None, model.inputs, (), dict(model.units), "run.csv")
    assert not [f for f in check(model, [data])[1] if f.severity != "note"]


def test_an_input_at_its_limit_is_noted_only() -> None:
    base = motor()[0]
    finding = found(base, record(base, np.clip(multisine(), -3.0, 3.0)))[1]["clipped"]
    assert finding.severity == "note"
    assert not finding.cure


# ------------------------------------------------------------------ units and signs


@pytest.mark.parametrize(
    ("name", "factor", "cure"),
    [
        ("current", 1e3, "current_in_mA"),
        ("voltage", 1e3, "voltage_in_mV"),
        ("voltage", -1.0, "reverse_voltage"),
        ("speed", -1.0, "reverse_speed"),
        ("current", -1.0, "reverse_current"),
        ("speed", 60 / (2 * np.pi), "speed_in_rpm"),
        ("speed", 180 / np.pi, "speed_in_deg_s"),
        ("position", 180 / np.pi, "position_in_degrees"),
        ("position", 1 / (2 * np.pi), "position_in_turns"),
    ],
)
def test_a_channel_in_another_unit_is_named_and_cured(name: str, factor: float, cure: str) -> None:
    model, data = changed(name, lambda values: factor * values)
    _, findings = found(model, data)
    assert [f.cure for f in findings.values() if f.severity != "note"] == [cure]
    after, _ = found(model, data, (cure,))
    np.testing.assert_allclose(after.u, motor()[1].u, rtol=1e-3)
    for channel, values in after.measured.items():
        np.testing.assert_allclose(values, motor()[1].measured[channel], rtol=1e-3)
    assert found(model, after)[1] == {}


@pytest.mark.parametrize("kept", [("speed",), ("current", "speed"), ("position",)])
def test_the_unit_is_told_by_few_channels_too(kept: tuple[str, ...]) -> None:
    model, data = changed(kept[-1], lambda values: values * 180 / np.pi)
    _, findings = found(model, replace(data, measured={n: data.measured[n] for n in kept}))
    assert kept[-1] in findings["unit_or_sign"].channel


@pytest.mark.parametrize(("name", "factor"), [("force", 1e-3), ("force", 1 / 4.4482216), ("displacement", 1e3)])
def test_the_units_of_an_oscillator(name: str, factor: float) -> None:
    model, data = oscillator()
    values = data.measured[name] if name in data.measured else data.u[:, 0]
    _, findings = found(model, with_channel(data, name, factor * values))
    assert name in {f.channel for f in findings.values()} or "displacement" in str(findings), findings


def test_parameters_off_by_tens_of_per_cent_are_no_unit() -> None:
    model, data = motor()
    off = model.with_parameters(J=0.0030, K_t=0.06, R_a=1.1)
    assert "unit_or_sign" not in found(off, data)[1]


def test_a_refusal_says_the_way_out() -> None:
    model, data = changed("speed", lambda v: 60 / (2 * np.pi) * v)
    _, findings = check(model, [data])
    with pytest.raises(RecordError, match=r"run\.csv: the speed fits.* in rpm.*--cure speed_in_rpm.*--cure none"):
        require_sound(findings)
    require_sound(findings, ("none",))
    require_sound(check(model, [data], ("speed_in_rpm",))[1])


def test_none_leaves_a_record_as_it_is() -> None:
    model, data = changed("position", lambda q: (q + 1.0) % (2 * np.pi))
    after, findings = found(model, data, ("none",))
    assert after is data
    assert findings["wrapped_angle"].severity == "offer"
    assert not findings["wrapped_angle"].applied


def test_a_cure_that_nothing_offers_is_refused() -> None:
    model, data = changed("speed", lambda v: 60 / (2 * np.pi) * v)
    with pytest.raises(InputError, match=r"speed_in_rpn.*speed_in_rpm"):
        check(model, [data], ("speed_in_rpn",))


def test_an_input_without_a_sign_is_refused() -> None:
    model, data = changed("voltage", np.abs)
    finding = the("unsigned_input", model, replace(data, unused=("dir",)))
    assert finding.open
    assert "'dir'" in finding.sentence
    assert "sign(dir)" in finding.sentence


@pytest.mark.parametrize("order", [("current", "speed"), ("voltage", "speed"), ("voltage", "current", "speed")])
def test_columns_that_are_mixed_up_are_named_and_put_right(order: tuple[str, ...]) -> None:
    model, data = motor()
    model, data = Model.load("dc_motor"), replace(data, measured={n: data.measured[n] for n in ("current", "speed")})
    mixed = exchanged(data, order)
    back = (order[0], *reversed(order[1:]))
    finding = the("exchanged", model, mixed)
    assert finding.severity == "refuse"
    assert set(finding.about) == set(order)
    right, left = found(model, mixed, (finding.cure,))
    assert left["exchanged"].applied
    for name in order:
        np.testing.assert_array_equal(values_of(right, name), values_of(data, name))
        np.testing.assert_array_equal(values_of(exchanged(mixed, back), name), values_of(data, name))


def test_columns_of_a_model_that_fits_no_order_are_not_said_to_be_mixed_up() -> None:
    model, data = motor()
    noise = np.random.default_rng(3).normal(size=len(data))
    _, findings = found(model, with_channel(data, "current", noise))
    assert "exchanged" not in findings


@field
def test_the_column_of_the_direction_is_found() -> None:
    file = str(FIELD / "csv" / "sign_column.csv")
    model = Model.load("dc_motor")
    assert with_direction(model, file, {"voltage": "pwm"}, "voltage") == {"voltage": "sign(dir) * pwm"}
    assert with_direction(model, str(FIELD / "channels" / "plain.csv"), {}, "voltage") is None


def test_a_one_way_input_of_a_drive_that_swings_back_is_right() -> None:
    base = oscillator()[0]
    assert found(base, record(base, 40.0 + multisine(4.0)))[1] == {}


@pytest.mark.parametrize("friction", [0.3, 0.0])
def test_a_short_swing_that_lacks_gravity_is_in_its_own_unit(friction: float) -> None:
    """150 samples that begin far from rest: "the force fits if it is in kgf", which stood for the observer's start."""
    base = Model.from_dict(
        {"plant": "mass_spring_damper", "parameters": {"m": 0.15, "c": 0.1, "k": 0.0}, "axis": "rotary"}
    )
    rng, t = np.random.default_rng(1), np.arange(150) * 0.005
    swing = base.with_effect("gravity_load", A=2.83)
    swing = swing.with_effect("coulomb_friction", mu=friction) if friction else swing
    u = np.where(t < 0.14, -0.9, 0.9)
    x = simulate(swing, t, u[:, None], x0=[-0.4, -0.5]).x
    measured = {
        "displacement": 0.0029 * np.round(x[:, 0] / 0.0029),
        "velocity": x[:, 1] + 0.1 * rng.normal(size=t.size),
    }
    data = ModelData(t, u[:, None], measured, None, base.inputs, base.states, dict(base.units), "run.csv")
    assert nothing_but_notes(found(base, data)[1])
    if not friction:  # beside friction of any size the swing hardly needs its torque, and tells of no unit
        assert found(base, replace(data, u=1000.0 * data.u))[1]["unit_or_sign"].cure == "force_in_mNm"


# ------------------------------------------------------------------ position and velocity


@pytest.mark.parametrize("tolerance", [0.05, 1.0])
def test_a_gear_is_refused_where_the_model_is_known_and_offered_where_it_is_guessed(tolerance: float) -> None:
    model, data = changed("position", lambda q: q / 5.0)
    _, findings = found(model.with_options(tolerance=tolerance), data)
    (finding,) = (f for f in findings.values() if f.severity != "note")
    assert finding.cure == "scale_position"
    assert finding.open == (tolerance < 0.5)
    after, _ = found(model, data, ("scale_position",))
    np.testing.assert_allclose(after.measured["position"], motor()[1].measured["position"], rtol=0.15, atol=1e-9)


def test_units_are_those_of_the_kind_of_axis_that_is_known() -> None:
    assert {"lbf", "lbf·in"} <= set(other_units("N"))
    assert "lbf·in" not in other_units("N", turns=False)
    assert "lbf" not in other_units("N", turns=True)
    assert "rpm" in other_units("rad/s", turns=True)


def test_position_and_speed_in_degrees_are_a_reason_to_refuse_beside_guesses_too() -> None:
    model, data = motor()
    guess = model.with_options(tolerance=0.5)
    turned = data
    for name in ("position", "speed"):
        turned = with_channel(turned, name, np.degrees(data.measured[name]))
    finding = the(
        "unit_or_sign", guess, replace(turned, measured={n: turned.measured[n] for n in ("position", "speed")})
    )
    assert {"position", "speed"} == set(finding.about)
    assert finding.severity == "refuse"


def test_two_channels_in_other_units_are_told_together() -> None:
    model, data = changed("current", lambda i: 1e3 * i)
    both = with_channel(data, "speed", 60 / (2 * np.pi) * data.measured["speed"])
    _, findings = found(model, replace(both, measured={n: both.measured[n] for n in ("current", "speed")}))
    assert {"current", "speed"} == set(findings["unit_or_sign"].about)
    assert "rpm" in findings["unit_or_sign"].sentence
    assert "mA" in findings["unit_or_sign"].sentence


def test_of_two_explanations_one_is_enough() -> None:
    """A force that is 1000 times too small moves the mass by as much as a displacement in mm."""
    model, data = oscillator()
    small = with_channel(data, "force", 1e-3 * data.u[:, 0])
    only = replace(small, measured={"displacement": small.measured["displacement"]})
    _, findings = check(model, [only])
    assert len(findings) > 1
    assert all(f.open for f in findings)
    _, findings = check(model, [only], (findings[0].cure,))
    assert [f.applied for f in findings] == [True]


def test_a_velocity_of_another_axis_is_refused() -> None:
    rng = np.random.default_rng(2)
    other = 20.0 * np.convolve(rng.normal(size=SAMPLES + 50), np.ones(51) / 7.0, "valid")
    model, data = changed("speed", lambda _: other)
    _, findings = found(model, replace(data, measured={n: data.measured[n] for n in ("speed", "position")}))
    assert findings["position_velocity"].cure == "leave_out_speed"
    assert findings["position_velocity"].open


def swinging(t: Array, seed: int = 1) -> ModelData:
    """Return a short swing that grows, at times t (T,): displacement in steps and a noisy velocity, rotary."""
    rng = np.random.default_rng(seed)
    q, v = 0.3 * t * np.sin(5.0 * t), 0.3 * np.sin(5.0 * t) + 1.5 * t * np.cos(5.0 * t)
    base = Model.load("mass_spring_damper")
    measured = {"displacement": 0.003 * np.round(q / 0.003), "velocity": v + 0.05 * rng.normal(size=t.size)}
    return ModelData(t, np.zeros((t.size, 1)), measured, None, base.inputs, base.states, dict(base.units), "run.csv")


@pytest.mark.parametrize("kept", [140, 100, 60])
def test_nobody_knows_the_velocity_in_a_gap(kept: int) -> None:
    """ "The velocity is 0.34 times the displacement's rate": integrated over a gap of 0.76 s."""
    t = np.arange(152) * 0.005
    data = swinging(np.where(np.arange(t.size) < kept, t, t + 0.76))
    assert "position_velocity" not in found(Model.load("mass_spring_damper"), data)[1]
    wrong = with_channel(data, "velocity", data.measured["velocity"] / 3.0)
    assert found(Model.load("mass_spring_damper"), wrong)[1]["position_velocity"].cure == "scale_velocity"


def test_a_velocity_that_lags_is_noted() -> None:
    model, data = changed("speed", lambda v: np.concatenate([np.full(8, v[0]), v[:-8]]))
    _, findings = found(model, data)
    assert findings["position_velocity"].severity == "note"
    assert "0.08 s behind" in findings["position_velocity"].sentence


def test_a_factor_is_told_of_fast_motion_in_few_samples() -> None:
    """The drive of an exoskeleton: what it does between samples looked like noise, though the two agreed to 2 %."""
    base, data = motor()
    t, waves = 0.05 * np.arange(160), (5.0, 14.0, 25.0)
    q = sum(np.sin(w * t + i) / w for i, w in enumerate(waves))
    v = 1.84 * sum(np.cos(w * t + i) for i, w in enumerate(waves))
    logged = replace(data, t=t, u=np.cos(3.0 * t)[:, None], measured={"position": q, "speed": v})
    assert Look(base, logged).travel.clear < 10.0
    finding = found(base, logged)[1]["position_velocity"]
    assert finding.cure == "scale_speed"
    assert 1.8 < float(finding.sentence.split("is ")[1].split()[0]) < 1.9


@pytest.mark.parametrize("offset", [0.0, 0.02, -0.5, 2.0])
def test_an_offset_of_the_velocity_is_noted(offset: float) -> None:
    """A feed axis that reads 4 mm/s at rest; what is a tenth of the velocity is for a diagnosis."""
    base, data = motor()
    wrong = with_channel(data, "speed", data.measured["speed"] + offset * np.std(data.measured["speed"]))
    findings = found(base, wrong)[1]
    if abs(offset) < 0.1:
        assert "position_velocity" not in findings
        return
    size = abs(offset) * np.std(data.measured["speed"])
    said = findings["position_velocity"].sentence
    assert findings["position_velocity"].severity == "note"
    assert float(said.split("reads ")[1].split()[0]) == pytest.approx(size, rel=0.05)
    assert f"rad/s {'more' if offset > 0 else 'less'} than the position changes" in said


def test_a_velocity_that_was_derived_from_the_position_lags_behind_nothing() -> None:
    """A wall on an uneven time base: "the displacement lags 0.213 s behind the velocity", which nobody had recorded."""
    model, data = changed("speed", lambda v: np.concatenate([np.full(8, v[0]), v[:-8]]))
    derived = replace(data, notes=(*data.notes, Note("speed is the derivative of position", "derived", "speed")))
    assert "position_velocity" not in found(model, derived)[1]


def test_a_velocity_that_lags_by_less_than_two_samples_is_noted() -> None:
    """Waves at 53 Hz, a sample every ms, a speed 1.75 ms late: 40 % of its variance are gone, and nothing was said."""
    t = np.arange(4000) * 1e-3
    data = swinging(t)
    turn = lambda at: 4.5 * at + 0.01 * np.sin(330.0 * at)  # noqa: E731
    rate = lambda at: 4.5 + 3.3 * np.cos(330.0 * at)  # noqa: E731
    noise = 0.1 * np.random.default_rng(1).normal(size=t.size)
    for late, told in ((0.00175, True), (0.0, False)):
        record = replace(data, measured={"displacement": turn(t), "velocity": rate(t - late) + noise})
        findings = found(Model.load("mass_spring_damper"), record)[1]
        assert ("position_velocity" in findings) == told
        if told:
            assert float(findings["position_velocity"].sentence.split()[3]) == pytest.approx(late, rel=0.03)


# ------------------------------------------------------------------ time


def test_an_input_behind_its_effect_is_told() -> None:
    model, data = changed("voltage", lambda u: np.concatenate([np.full(20, u[0]), u[:-20]]))
    finding = the("mixed_clocks", model, data)
    assert finding.cure == "advance_voltage"
    assert finding.open


def test_an_input_before_its_effect_is_none_of_its_business() -> None:
    model, data = changed("voltage", lambda u: np.concatenate([u[6:], np.full(6, u[-1])]))
    assert "mixed_clocks" not in found(model, data)[1]


def test_jitter_is_noted() -> None:
    model, data = motor()
    late = data.t + STEP * 0.3 * np.random.default_rng(1).uniform(size=SAMPLES)
    assert found(model, replace(data, t=late))[1]["jitter"].severity == "note"
    even = data.t + STEP * 0.02 * np.random.default_rng(1).uniform(size=SAMPLES)
    assert "jitter" not in found(model, replace(data, t=even))[1]


def test_two_rates_one_after_the_other_are_no_jitter() -> None:
    """A force curve on a cell: 2048 Hz while the piezo moves, 256 Hz while it holds."""
    model, data = motor()
    half = SAMPLES // 2
    steps = np.where(np.arange(SAMPLES) < half, 1 / 256, 1 / 2048)
    late = STEP * 0.03 * np.random.default_rng(1).uniform(size=SAMPLES)

    def said(t: Array) -> str:
        return found(model, replace(data, t=t))[1]["jitter"].sentence

    assert said(np.cumsum(steps)) == (
        "two rates, one after the other: steps of 0.00391 s and of 0.000488 s, which change once"
    )
    assert said(np.cumsum(steps[::-1])).endswith("steps of 0.000488 s and of 0.00391 s, which change once")
    assert "jitter" in said(np.cumsum(steps) + late)
    assert "jitter" in said(np.cumsum(np.tile([0.01, 0.02, 0.01, 0.01], SAMPLES // 4)))


def test_slow_samples_are_noted_and_impossible_ones_refused() -> None:
    model, data = motor()
    fifth = replace(data, t=data.t[::5], u=data.u[::5], measured={n: v[::5] for n, v in data.measured.items()})  # 50 ms
    finding = found(model, fifth)[1]["slow_sampling"]
    assert finding.severity != "refuse"
    assert "current" in finding.sentence
    nothing = {n: np.sin(2 * np.pi * 0.2 * np.arange(SAMPLES)) for n in data.measured}
    assert found(model, replace(data, t=1e3 * data.t, measured=nothing))[1]["slow_sampling"].open


def test_whose_time_has_a_unit_is_asked_after_the_parameters() -> None:
    model, data = motor()
    nothing = {n: np.sin(2 * np.pi * 0.2 * np.arange(SAMPLES)) for n in data.measured}
    slow = replace(data, t=1e3 * data.t, measured=nothing)
    asked = found(model, slow)[1]["slow_sampling"].sentence
    assert "is the time in another unit? Name it, as t [ms]" in asked
    known = replace(slow, notes=(Note("time from 't_ms', converted from ms to s", "clock", "t"),))
    sentence = found(model, known)[1]["slow_sampling"].sentence
    assert "unit" not in sentence
    for one in (asked, sentence):
        assert "are the model's parameters the machine's, R_a = 0.764, " in one


def test_a_time_whose_unit_is_said_needs_no_question_after_it(tmp_path: Path) -> None:
    """A servo of a finger, logged every 52 ms, and a guess of its inertia that is a thousandth of a motor's."""
    path = tmp_path / "finger.csv"
    path.write_text("stamp,q,tau\n" + "".join(f"{0.052 * i:.3f},{np.sin(i)},{np.cos(i)}\n" for i in range(200)))
    model = Model.from_dict({
        "plant": "mass_spring_damper", "axis": "rotary", "parameters": {"m": 0.002, "c": 0.3, "k": 0.0},
        "operating_range": {"velocity": 5.0}, "signals": {"displacement": "q", "force": "tau"},
    })  # fmt: skip
    for said, unit in (({}, True), ({"t": "stamp [s]"}, False)):
        finding = found(model, read_for_model(path, model, said))[1]["slow_sampling"]
        assert finding.severity == "refuse"
        assert ("another unit" in finding.sentence) == unit
        assert "m = 0.002, c = 0.3?" in finding.sentence
    model.save(tmp_path / "finger.yaml")
    files = [str(tmp_path / "finger.yaml"), str(path)]
    assert main(["check", *files]) == 0  # it tells; those that conclude stop
    assert main(["compare", *files]) == 2


@pytest.mark.parametrize("held", [True, False])
def test_slow_samples_of_an_input_that_goes_on_in_between_are_told(held: bool) -> None:
    """A drive's log at 20 Hz: 0.0227 N m of dry friction where 0.033 are, as if its voltage stood for 50 ms."""
    model, t = motor()[0], np.arange(SAMPLES) * STEP
    u = 3.0 * np.sin(2.1 * t) + 2.0 * np.sin(9.3 * t + 1.0) + 1.0 * np.sin(23.0 * t + 2.0)
    data = record(model.with_effect("coulomb_friction", mu=0.033), np.repeat(u[::5], 5)[: u.size] if held else u)
    fifth = replace(data, t=data.t[::5], u=data.u[::5], measured={n: v[::5] for n, v in data.measured.items()})
    finding = found(model, fifth)[1]["slow_sampling"]
    assert finding.severity == ("note" if held else "offer")
    if not held:
        cured, findings = found(model, fifth, ("input_between",))
        assert findings["slow_sampling"].applied
        assert cured.acts is not None
        np.testing.assert_allclose(cured.acts, fifth.t - 0.5 * (fifth.t[1] - fifth.t[0]))


def test_a_short_record_is_noted() -> None:
    model, data = motor()
    assert "short_record" in found(model, data.part(0, 150))[1]
    both = [data.part(0, 150), data.part(150, 300)]
    assert "short_record" not in {finding.check for finding in check(model, both, validated=True)[1]}


@pytest.mark.parametrize(("c", "slow"), [(0.3, 0.66), (0.0, 0.66), (19.0, 0.105), (60.0, 0.645)])
def test_an_oscillation_takes_its_period(c: float, slow: float) -> None:
    """A period of 0.66 s whose envelope dies out in 6.67 s: a part of 0.7 s shows it, one of 0.6 s does not."""
    model = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": c, "k": 90.63}})
    for share in (0.9, 1.1):
        t = np.linspace(0.0, 3 * share * slow, 600)
        decay = np.exp(-0.5 * c * t) * np.cos(9.52 * t)
        data = ModelData(t, np.zeros((600, 1)), {"displacement": decay}, None, model.inputs, model.states, model.units)
        sentence = next((f.sentence for f in check(model, [data])[1] if f.check == "short_record"), "")
        assert (f"slowest motion ({slow:.3g} s)" in sentence) == (share < 1.0), sentence


# ------------------------------------------------------------------ motion


def test_what_never_moves_is_refused() -> None:
    model, data = motor()
    rng = np.random.default_rng(5)
    still = {n: NOISE[n] * rng.normal(size=SAMPLES) for n in data.measured}
    finding = the("no_motion", model, replace(data, measured=still))
    assert finding.open
    assert "never moved" in finding.sentence


def test_a_drive_that_runs_at_one_speed_is_refused_and_not_said_to_stand() -> None:
    """ "Never moved (the velocity stays within ±0.22 rad/s)", of a wheel that turned at 2.4 rad/s all the time."""
    model, data = motor()
    rng = np.random.default_rng(5)
    steady = {n: NOISE[n] * rng.normal(size=SAMPLES) for n in data.measured}
    steady["speed"] = steady["speed"] + 50.0 * NOISE["speed"]
    finding = the("no_motion", model, replace(data, measured={"speed": steady["speed"]}))
    assert "at one speed all the time" in finding.sentence
    assert f"the speed stays within {50.0 * NOISE['speed']:.2g}"[:-1] in finding.sentence


def test_little_motion_is_motion() -> None:
    base = motor()[0]
    assert "no_motion" not in found(base, record(base, multisine(0.02)))[1]


# ------------------------------------------------------------------ as a whole


def test_every_check_says_what_it_does() -> None:
    names = [kind.name for kind in CHECKS]
    assert len(set(names)) == len(names)
    for kind in CHECKS:
        assert "Test:" in (kind.__doc__ or "")
        assert "Cure:" in (kind.__doc__ or "")


def test_findings_follow_the_schema() -> None:
    schema = json.loads((resources.files("signlin_ros") / "schemas" / "check.json").read_text(encoding="utf-8"))
    model, data = changed("speed", lambda v: 60 / (2 * np.pi) * v)
    jsonschema.validate(to_json(check(model, [data])[1]), schema)
    jsonschema.validate({"findings": []}, schema)


CASES = {
    "plain": (),
    "encoder_wrap": (("wrapped_angle", True),),
    "rpm": (("unit_or_sign", False),),
    "mA": (("unit_or_sign", False),),
    "sign_reversed": (("unit_or_sign", False),),
    "no_motion": (("no_motion", False),),
    "hz20": (("slow_sampling", False),),
}


@field
@pytest.mark.parametrize("case", CASES)
def test_channels_of_the_field(case: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = [str(FIELD / "channels" / "nominal.yaml"), str(FIELD / "channels" / f"{case}.csv")]
    assert main(["check", *arguments, "--json"]) == 0
    findings = json.loads(capsys.readouterr().out)["findings"]
    assert tuple((f["check"], f["applied"]) for f in findings) == CASES[case]


BAG = ("--signal", "voltage=/cmd.data", "--signal", "speed=/joint_states.velocity[wheel]",
       "--signal", "position=/joint_states.position[wheel]")  # fmt: skip
BAGS = {"wrapped_position": "wrapped_angle", "velocity_zero": "frozen_channel", "two_publishers_4s": "two_sources"}


@field
@pytest.mark.parametrize("case", BAGS)
def test_bags_of_the_field(case: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "dc_motor", str(FIELD / "bags" / case), *BAG, "--json"]) == 0
    findings = json.loads(capsys.readouterr().out)["findings"]
    (finding,) = (f for f in findings if f["check"] != "excitation")  # without the current some move together
    assert finding["check"] == BAGS[case]
    assert finding["applied"]


@field
def test_the_sign_column_of_the_field(capsys: pytest.CaptureFixture[str]) -> None:
    file = str(FIELD / "csv" / "sign_column.csv")
    assert main(["compare", "dc_motor", file, "--signal", "voltage=pwm"]) == 2
    assert "the voltage never changes sign while the speed does" in capsys.readouterr().err


@field
def test_nothing_is_concluded_from_rpm(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = [str(FIELD / "channels" / "nominal.yaml"), str(FIELD / "channels" / "rpm.csv")]
    for verb in ("compare", "diagnose"):
        assert main([verb, *arguments]) == 2
        assert "the speed fits if it is in rpm" in capsys.readouterr().err


# ------------------------------------------------------------------ what a record could tell


def test_a_drive_at_one_speed_tells_friction_from_a_load_no_more() -> None:
    base = Model.load("mass_spring_damper").with_parameters(k=0.0, c=2.0)
    free, rich = record(base, np.full(SAMPLES, 4.0)), record(base, multisine(4.0))
    told = found(base, free)[1]["excitation"]
    assert "viscous friction, Coulomb friction and a constant load only together" in told.sentence
    assert told.severity == "note"
    assert "excitation" not in found(base, rich)[1]


def test_an_imposed_motion_at_one_speed_tells_no_friction_from_another() -> None:
    model = Model.from_dict({"plant": "force_element", "parameters": {"c": 0.0, "k": 200.0}})
    t = np.arange(400) * 0.1
    steady, swinging = np.where(t % 20.0 < 10.0, 1e-3, -1e-3), 1e-3 * np.sin(0.3 * t)

    def told(v: Array) -> str:
        q = np.concatenate([[0.0], np.cumsum(v[:-1]) * 0.1])
        measured = {"displacement": q, "force": 200.0 * q + 0.5 * np.sign(v)}
        data = ModelData(t, v[:, None], measured, None, model.inputs, model.states, dict(model.units), "run.csv")
        return found(model, data)[1]["excitation"].sentence if "excitation" in found(model, data)[1] else ""

    assert told(steady) == "this record tells viscous friction and Coulomb friction only together"
    assert told(np.abs(steady)).endswith("viscous friction, Coulomb friction and a constant load only together")
    assert not told(swinging)


def test_a_motion_that_is_too_slow_tells_nothing_of_the_damping() -> None:
    base = oscillator()[0]
    slow = record(base, np.sin(0.4 * np.arange(SAMPLES) * STEP))
    assert "nothing of c" in found(base, slow)[1]["excitation"].sentence


def test_parameters_that_move_together_are_named() -> None:
    """Without the current nothing tells a weak motor of much resistance from a strong one of little."""
    model, data = motor()
    alone = replace(data, measured={n: data.measured[n] for n in ("speed", "position")})
    assert "R_a, K_t and J only together" in found(model, alone)[1]["excitation"].sentence


# ------------------------------------------------------------------ what the reader did


class Said(str):
    """A note as a reader writes it."""

    kind, channel = "", ""


def said(text: str, kind: str) -> Note:
    return Note(text, kind)


def test_faults_that_the_reader_put_right_are_told() -> None:
    model, data = motor()
    notes = (said("the clock jumps back at row 200: two runs", "cut"), said("rpm are converted", "converted"), "plain")
    (finding,) = found(model, replace(data, notes=notes))[1].values()
    assert (finding.check, finding.severity) == ("cut", "note")
    assert finding.sentence.startswith("the clock jumps back")


@pytest.mark.parametrize("friction", [1.0, 3.0])
def test_a_drive_that_is_mostly_friction_is_in_its_own_unit(friction):
    """Friction of the size of the effort makes a smaller effort fit better: that tells of no unit."""
    base = Model.from_dict(
        {"plant": "mass_spring_damper", "parameters": {"m": 0.02, "c": 0.02, "k": 0.0}, "axis": "rotary"}
    )
    effort = multisine(friction) + 1.5 * friction * np.sign(np.sin(2.1 * np.arange(SAMPLES) * STEP))
    data = record(base.with_effect("coulomb_friction", mu=friction), effort)
    assert "unit_or_sign" not in found(base, data)[1]
    for factor, cures in (
        (1000.0, {"force_in_mNm"}),
        (8.85, {"force_in_lbfin"}),
        (-1.0, {"reverse_force", "reverse_displacement_and_velocity"}),
    ):
        assert found(base, replace(data, u=factor * data.u))[1]["unit_or_sign"].cure in cures


@pytest.mark.slow
def test_what_is_told_about_the_record_is_no_note_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, data = motor()
    kept = np.delete(np.arange(SAMPLES), slice(700, 750))
    columns = np.column_stack([data.t, data.u, data.measured["current"], data.measured["speed"]])[kept]
    file, page = tmp_path / "run.csv", tmp_path / "report.html"
    np.savetxt(file, columns, delimiter=",", header="t,voltage,current,speed", comments="")
    assert main(["compare", "dc_motor", str(file), "--report", str(page)]) == 0
    shown = capsys.readouterr().out
    assert shown.count("1 gap in the time stamps") == 1
    assert "note: gap: 1 gap in the time stamps" in shown
    assert "every run starts anew after the gap" in shown
    assert page.read_text(encoding="utf-8").count("1 gap in the time stamps") == 1


def test_what_the_reader_asks_must_be_answered() -> None:
    model, data = motor()
    notes = (said("is the time in ms?", "unit_of_time"),)
    finding = found(model, replace(data, notes=notes))[1]["time_unit"]
    assert finding.open
    assert finding.sentence == "is the time in ms?"


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_the_unit_of_the_time_is_told_by_the_model(unit: str, factor: float) -> None:
    model, data = motor()
    other = replace(data, t=factor * data.t)
    finding = the("time_unit", model, other)
    assert finding.open
    assert finding.cure == f"t_in_{unit}"
    after, _ = found(model, other, (finding.cure,))
    np.testing.assert_allclose(after.t, data.t, atol=1e-9)


def test_a_log_sampled_once_in_a_time_constant_is_in_seconds() -> None:
    """Positions of a hobby servo every 20 ms, and of a digger's cylinder at 19 Hz, were refused as times in ms."""
    t, rng = 0.02 * np.arange(300), np.random.default_rng(1)
    model = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 0.005, "c": 0.3, "k": 0.0}})
    u = np.repeat(rng.uniform(-1.0, 1.0, 30), 10)
    q = np.cumsum(np.clip(u, -0.1, 0.1)) * 0.02 / 0.3 + 5e-4 * rng.standard_normal(t.size)  # its input saturates
    data = ModelData(t, u[:, None], {"displacement": q}, None, model.inputs, model.states, model.units)
    assert "time_unit" not in found(model, data)[1]


def test_a_slow_log_of_a_valve_on_its_spring_is_in_seconds() -> None:
    """At 20 Hz it was refused as a time in ms: after 50 us a position is where it was, whatever the model says."""
    t, rng = 0.05 * np.arange(2000), np.random.default_rng(2)
    model = Model.from_dict(
        {"plant": "mass_spring_damper", "parameters": {"m": 1.4, "c": 900.0, "k": 1e5}, "tolerance": {"c": 1.0}}
    )
    u = 1500.0 + 700.0 * np.sin(2 * np.pi * 0.02 * t) + 300.0 * np.sin(2 * np.pi * 0.057 * t)
    q = simulate(model.with_effect("coulomb_friction", mu=200.0), t, u).x[:, 0] + 2e-5 * rng.standard_normal(t.size)
    findings = found(
        model, ModelData(t, u[:, None], {"displacement": q}, None, model.inputs, model.states, model.units)
    )
    assert "time_unit" not in findings[1]
    assert findings[1]["slow_sampling"].severity == "note"
    assert "only forces at rest are known" in findings[1]["slow_sampling"].sentence


def test_a_pendulum_that_is_let_go_is_driven_by_nothing() -> None:
    """Noise of its velocity at the turns made small peaks between the large ones: "the driver does not report it"."""
    t, rng = 0.005 * np.arange(4000), np.random.default_rng(3)
    model = Model.from_dict(
        {"plant": "mass_spring_damper", "axis": "rotary", "parameters": {"m": 0.012, "c": 4e-4, "k": 0.0}}
    )
    hung = model.with_effect("gravity_load", A=0.35).with_effect("coulomb_friction", mu=0.004)
    x = simulate(hung, t, np.zeros(t.size), [2.0, 0.0]).x + rng.standard_normal((t.size, 2)) * (3e-4, 0.02)
    measured = {"displacement": x[:, 0], "velocity": x[:, 1]}
    data = ModelData(t, np.zeros((t.size, 1)), measured, None, model.inputs, model.states, model.units)
    finding = found(model, data)[1]["nothing_measured"]
    assert finding.severity == "note"
    assert "nothing drives the machine" in finding.sentence


def test_a_channel_that_is_seldom_measured_is_noted() -> None:
    model, data = changed("position", lambda q: np.where(np.arange(q.size) % 50 == 0, q, np.nan))
    assert found(model, data)[1]["sparse_channel"].channel == "position"
    model, data = changed("position", lambda q: np.where(np.arange(q.size) % 4 == 0, q, np.nan))
    assert "sparse_channel" not in found(model, data)[1]


@pytest.mark.parametrize("verb", ["check", "simulate", "compare", "diagnose", "add", "refine"])
def test_every_verb_that_reads_data_takes_cures(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([verb, "--help"]) == 0
    assert "--cure" in capsys.readouterr().out


def test_what_is_too_short_to_look_at_is_left_to_what_comes_next() -> None:
    model, data = motor()
    assert check(model, [data.part(0, 5)])[1] == []
    (finding,) = check(model, [replace(data, measured={})])[1]
    assert (finding.check, finding.severity) == ("nothing_measured", "refuse")
    assert "must stand in one file" in finding.sentence


def test_what_an_observer_is_left_nothing_of_is_no_fault():
    """A speed that never changes its sign: dry friction is a constant, which observers forget ("Singular matrix")."""
    grams = np.zeros((1, 4, 4))
    grams[0, :2, :2] = [[2.0, 0.3], [0.3, 1.0]]
    sources = ("voltage", "speed", "load", "dry friction")
    found = LinearPrediction(("speed",), sources, grams, np.ones(1), 1000, {"load": "", "dry friction": "speed"})
    assert found.left() == pytest.approx(np.sqrt(3.6))


def test_a_unit_that_one_of_two_files_contradicts_holds_for_the_other_alone() -> None:
    model, data = motor()
    first = replace(with_channel(data, "speed", data.measured["speed"] * 30 / np.pi), source="a.csv")
    findings = check(model, [first, replace(data, source="b.csv")])[1]
    (told,) = [f for f in findings if f.check == "unit_or_sign"]
    assert (told.source, told.cure) == ("a.csv", "speed_in_rpm")
    assert "not so in b.csv" in told.sentence
    cured = check(model, [first, replace(data, source="b.csv")], ("speed_in_rpm",))[0]
    for one in cured:
        np.testing.assert_allclose(one.measured["speed"], data.measured["speed"])


def stuck(stick: float, slide: float, quickly: float) -> tuple[Model, ModelData]:
    """Return a light axis without friction, and a record of one that moves against friction only, in steps."""
    base = Model.from_dict(
        {"plant": "mass_spring_damper", "parameters": {"m": 1.8, "c": 300.0, "k": 0.0}, "axis": "linear"}
    )
    t = np.arange(4000) * STEP
    rng = np.random.default_rng(5)
    v = 0.006 * np.repeat(rng.uniform(-1.0, 1.0, 20), 200) ** 3
    v = np.convolve(v, np.ones(20) / 20, "same")
    x = np.cumsum(v) * STEP
    force = (
        1.8 * np.gradient(v, STEP) + 300.0 * v + np.sign(v) * (slide + (stick - slide) * np.exp(-((v / quickly) ** 2)))
    )
    force = np.where(np.abs(v) < 1e-5, 0.7 * stick * np.sin(t), force) + 0.1 * rng.normal(size=t.size)
    shown = {"displacement": 5e-7 * np.round(x / 5e-7)}
    units = {**base.units}
    return base, ModelData(t, force[:, None], shown, None, base.inputs, base.states, units, "run.csv")


@pytest.mark.parametrize("slide", [9.0, 14.0])
def test_friction_that_is_most_of_the_force_tells_of_no_unit(slide):
    """A syringe pump was offered "the force divided by 17.8", a valve "in kgf·cm"."""
    base, data = stuck(14.0, slide, 0.0008)
    assert "unit_or_sign" not in found(base, data)[1]


def unsigned_motor(with_position: bool) -> tuple[Model, ModelData]:
    base, data = motor()
    measured = {**data.measured, "speed": np.abs(data.measured["speed"])}
    if with_position:
        return base, replace(data, measured=measured)
    base = base.with_options(with_position=False)
    return base, replace(data, measured={"speed": measured["speed"]}, states=base.states)


@pytest.mark.parametrize("with_position", [False, True])
def test_a_speed_without_a_direction_is_refused(with_position):
    base, data = unsigned_motor(with_position)
    told = found(base, data)[1]["unsigned_speed"]
    assert (told.severity, told.channel) == ("refuse", "speed")
    assert "no direction" in told.sentence
    assert told.cure == ("leave_out_speed" if with_position else "")


def test_a_speed_that_goes_one_way_is_none_without_a_direction():
    base, _ = motor()
    for u in (8.0 + multisine(0.5), np.where(np.arange(SAMPLES) // 200 % 2, -1.5, 8.0)):
        data = record(base.with_effect("coulomb_friction", mu=0.033), u)
        one_way = {**data.measured, "speed": np.maximum(data.measured["speed"], 0.0)}
        for measured in (one_way, {"speed": one_way["speed"]}):
            assert "unsigned_speed" not in found(base, replace(data, measured=measured))[1]
