"""A winding that settles within a sample is no state of what the record can tell."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from signlin_ros.diagnosis import add, diagnose
from signlin_ros.effects import EFFECTS
from signlin_ros.fitting.settled import MIN_STEP_OVER_SETTLING, reads_before, restored, with_settled
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

STEP = 0.01
VALUES = {"R_a": 0.8, "L_a": 0.0, "K_t": 0.06, "K_m": 0.06, "B": 4e-4, "J": 2.1e-3}
FRICTION = {"coulomb_friction": {"mu": 0.03}}
NAMES = ("current", "speed", "position")


def motor(**parameters):
    return Model.from_dict({"plant": "dc_motor", "parameters": {**VALUES, **parameters}})


def logged(seed, current="now", seconds=12.0):
    """Return a record of a motor with friction; its ``current`` read with the voltage of its row, or of the one before.

    Voltages are held for four samples: then rows tell which one a current belongs to.
    """
    rng, t = np.random.default_rng(seed), np.arange(0.0, seconds, STEP)
    u = np.repeat(rng.uniform(-6.0, 6.0, t.size // 4), 4)[:, None]
    true = Model.from_dict({"plant": "dc_motor", "parameters": VALUES, "effects": FRICTION, "with_position": True})
    run = simulate(true, t, u, kind="exact").to_frame()
    measured = {name: run[name].to_numpy().copy() for name in NAMES}
    if current == "before":
        measured["current"][1:] = (u[:-1, 0] - VALUES["K_m"] * measured["speed"][1:]) / VALUES["R_a"]
    for name, level in zip(NAMES, (0.02, 0.1, 1e-3), strict=True):
        measured[name] += rng.normal(0.0, level, t.size)
    units = dict(zip(("voltage", *NAMES), ("V", "A", "rad/s", "rad"), strict=True))
    return ModelData(t, u, measured, None, ("voltage",), NAMES, units)


def without(record, name):
    return replace(record, measured={n: values for n, values in record.measured.items() if n != name})


def test_a_winding_that_settles_within_a_sample_follows_at_once():
    given = motor(L_a=1e-4)
    settled, acting, (note,) = with_settled(given, [logged(1)])
    assert settled.parameters["L_a"] == 0.0
    assert note == "current follows at once: it settles in 0.00013 s, a sample takes 0.01 s"
    assert acting(logged(1)).acts is None
    assert restored(settled, given).to_dict() == given.to_dict()


def test_a_winding_that_a_record_tells_of_stays_as_it_is():
    given = motor(L_a=1.1 * VALUES["R_a"] * STEP / MIN_STEP_OVER_SETTLING)
    settled, _, notes = with_settled(given, [logged(1)])
    assert settled is given
    assert notes == ()


@pytest.mark.parametrize("when", ["now", "before"])
def test_the_record_tells_which_voltage_a_current_belongs_to(when):
    assert reads_before(motor(), [logged(2, when)]) is (when == "before")


@pytest.mark.parametrize("when", ["now", "before"])
def test_noise_of_a_slow_speed_is_not_taken_for_the_voltage(when):
    """From sample to sample the speed changes by less than its noise; its own regression halves its coefficient."""
    rng, t = np.random.default_rng(10), np.arange(0.0, 16.0, STEP)
    u = 6.0 * np.sin(2.0 * t) + 2.0 * np.sin(5.0 * t + 1.0)
    speed = lfilter([STEP / 0.2], [1.0, STEP / 0.2 - 1.0], np.concatenate([[0.0], u[:-1]])) / VALUES["K_m"]
    acting = u if when == "now" else np.concatenate([[0.0], u[:-1]])
    current = (acting - VALUES["K_m"] * speed) / VALUES["R_a"]
    measured = {"current": current + rng.normal(0.0, 0.01, t.size), "speed": speed + rng.normal(0.0, 0.8, t.size)}
    units = {"voltage": "V", "current": "A", "speed": "rad/s"}
    record = ModelData(t, u[:, None], measured, None, ("voltage",), ("current", "speed"), units)
    assert reads_before(motor(), [record]) is (when == "before")


def test_a_current_that_was_read_before_its_voltage_acted_keeps_its_equation():
    given = motor(L_a=1e-6)
    settled, _, notes = with_settled(given, [logged(3, "before")])
    assert settled is given
    assert notes == ()


def test_the_lag_of_a_current_that_is_not_measured_is_a_delay_of_the_voltage():
    """To the square of the time constant over the step: the error of leaving it out is of first order."""
    given = motor(L_a=0.99 * VALUES["R_a"] * STEP / MIN_STEP_OVER_SETTLING)
    record = without(logged(4), "current")
    settled, acting, _ = with_settled(given, [record])
    t, u = record.t, record.u
    whole, late, at_once = (
        simulate(model, t, u, kind="exact", acts=acts, rtol=1e-9).to_frame()["speed"].to_numpy()
        for model, acts in ((given, None), (settled, acting(record).acts), (settled, None))
    )
    assert np.std(late - whole) < 0.3 * np.std(at_once - whole)


def test_friction_is_named_beside_a_winding_that_no_sample_tells_of():
    given = motor(L_a=1e-4)
    found = diagnose(given, logged(5), logged(6))
    assert found.verdict == "missing"
    assert [entry.effect for entry in found.ranking if entry.status == "confirmed"] == ["coulomb_friction"]
    value = found.parameters["coulomb_friction.mu"]
    assert abs(value.value - 0.03) < 3 * value.std
    assert found.parameters["R_a"].value == pytest.approx(VALUES["R_a"], rel=0.01)
    assert found.model.parameters["L_a"] == 1e-4


def test_a_current_tells_of_the_resistance_where_there_is_no_inductance():
    given = motor(R_a=0.85)
    found = add("coulomb_friction", given, logged(7), logged(8))
    assert found.parameters["R_a"].value == pytest.approx(VALUES["R_a"], rel=0.005)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_record_of_few_samples_tells_no_order(count):
    assert not reads_before(motor(), [logged(9).part(0, count)])
    with_settled(motor(L_a=1e-4), [logged(9).part(0, count)])


@pytest.mark.parametrize(("steps", "resolved"), [(0.005, False), (0.02, True), (1.5, True)])
def test_a_delay_of_next_to_nothing_of_a_sample_is_none(steps, resolved):
    assert EFFECTS["input_delay"].is_resolved({"T": steps * STEP}, STEP) is resolved
