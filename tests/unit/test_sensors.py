"""Sensor effects: what a model file may say of them, and what the model then knows of its sensors."""

import re

import numpy as np
import pytest

from signlin_ros.errors import ModelError
from signlin_ros.linearization import linearize
from signlin_ros.model import Model
from signlin_ros.sensors import Sensor
from signlin_ros.simulation import simulate

MOTOR = Model.load("dc_motor")
MASS = Model.load("mass_spring_damper")
ELEMENT = Model.load("force_element")


def with_effects(model, **effects):
    return Model.from_dict({**model.to_dict(), "effects": effects})


# -------------------------------------------------------------------- a sensor


def test_a_sensor_shows_gain_times_the_true_value_plus_offset():
    sensor = Sensor(gain=2.0, offset=0.5, delay=0.01)
    assert sensor.show(3.0) == 6.5
    assert sensor.true(6.5) == 3.0
    np.testing.assert_array_equal(sensor.show(np.array([0.0, -1.0])), [0.5, -1.5])
    np.testing.assert_array_equal(sensor.true(np.array([0.5, -1.5])), [0.0, -1.0])


def test_a_perfect_sensor_changes_no_bit():
    values = np.random.default_rng(1).normal(0.0, 1e3, 1000)
    np.testing.assert_array_equal(Sensor().true(Sensor().show(values)), values)
    assert Sensor() == Sensor(1.0, 0.0, 0.0)


# -------------------------------------------------------------------- in a model


def test_sensors_by_channel_and_perfect_ones_elsewhere():
    model = with_effects(
        MOTOR,
        sensor_offset={"speed": 0.1},
        sensor_gain={"speed": 1.02, "current": 0.9},
        sensor_delay={"current": 0.002},
    )
    assert model.sensors == {"current": Sensor(0.9, 0.0, 0.002), "speed": Sensor(1.02, 0.1, 0.0)}
    assert MOTOR.sensors == {"current": Sensor(), "speed": Sensor()}


def test_effects_on_the_same_channel_add_up():
    model = with_effects(
        MOTOR,
        first={"type": "sensor_offset", "speed": 0.1},
        second={"type": "sensor_offset", "speed": 0.2},
        third={"type": "sensor_gain", "speed": 2.0},
        fourth={"type": "sensor_gain", "speed": 3.0},
        fifth={"type": "sensor_delay", "speed": 0.25},
        sixth={"type": "sensor_delay", "speed": 0.5},
    )
    assert model.sensors["speed"] == Sensor(6.0, 0.1 + 0.2, 0.75)


def test_outputs_have_sensors_too():
    model = with_effects(ELEMENT, sensor_gain={"effort": 1.1, "position": 0.9})
    assert model.sensors == {"displacement": Sensor(gain=0.9), "force": Sensor(gain=1.1)}
    assert model.par_declarations()["effects.sensor_gain.force"].unit == "-"
    offset = ELEMENT.with_effect("sensor_offset", force=3.0)
    assert offset.par_declarations()["effects.sensor_offset.force"].unit == "N"


def test_aliases_become_the_plants_own_names():
    model = with_effects(MASS, sensor_offset={"position": 0.001, "velocity": 0.01})
    assert model.effects["sensor_offset"].parameters == {"displacement": 0.001, "velocity": 0.01}
    assert with_effects(MOTOR, sensor_offset={"velocity": 0.1}) == with_effects(MOTOR, sensor_offset={"speed": 0.1})


def test_a_motor_whose_position_has_a_sensor_has_a_position():
    model = MOTOR.with_effect("sensor_offset", position=0.2)
    assert model.states == ("current", "speed", "position")
    assert model.sensors["position"].offset == 0.2
    assert MOTOR.with_effect("sensor_offset").states == ("current", "speed")


def test_own_states_of_effects_have_perfect_sensors():
    model = MOTOR.with_effect("dahl_presliding").with_effect("sensor_gain", speed=2.0)
    assert model.sensors["dahl_presliding.z"] == Sensor()
    assert list(model.sensors) == list(model.states)


def test_states_shown_and_true_ones():
    model = with_effects(MOTOR, sensor_offset={"speed": 0.5}, sensor_gain={"current": 2.0})
    x = np.array([[1.0, 10.0], [-1.0, 0.0], [0.0, -3.0]])
    shown = model.shown_states(x)
    np.testing.assert_array_equal(shown, [[2.0, 10.5], [-2.0, 0.5], [0.0, -2.5]])
    np.testing.assert_array_equal(model.true_states(shown), x)
    np.testing.assert_array_equal(model.true_states(shown[0]), x[0])


def test_neither_simulation_nor_linearization_knows_of_sensors():
    t = np.linspace(0.0, 0.2, 21)
    u = np.full((21, 1), 2.0)
    model = with_effects(
        MOTOR,
        coulomb_friction={"mu": 0.033},
        sensor_offset={"speed": 0.5},
        sensor_gain={"current": 2.0},
        sensor_delay={"speed": 0.01},
    )
    np.testing.assert_array_equal(simulate(model, t, u).x, simulate(MOTOR, t, u).x)
    np.testing.assert_array_equal(linearize(model, [0.4, 5.0]).A, linearize(MOTOR, [0.4, 5.0]).A)
    assert model.delay == 0.0


# -------------------------------------------------------------------- changing, writing


def test_changes():
    model = MOTOR.with_effect("sensor_offset", speed=0.1)
    assert model.value("sensor_offset.speed") == model.value("effects.sensor_offset.velocity") == 0.1
    assert model.with_parameters({"sensor_offset.speed": 0.2}).sensors["speed"].offset == 0.2
    assert model.with_parameters({"sensor_offset.velocity": 0.2}).sensors["speed"].offset == 0.2
    assert model.with_parameters({"sensor_offset.current": 0.3}).sensors["current"].offset == 0.3
    assert model.without_effect("sensor_offset") == MOTOR
    twice = model.with_effect("sensor_offset", "second", velocity=0.2)
    assert twice.sensors["speed"].offset == pytest.approx(0.3)


def test_yaml_without_loss(tmp_path):
    model = with_effects(
        MOTOR,
        sensor_offset={"speed": -1 / 3, "position": 1e-7},
        encoder={"type": "sensor_gain", "position": 1 + 2**-52},
        sensor_delay={"speed": 1e-3},
    )
    model.save(tmp_path / "m.yaml")
    again = Model.load(tmp_path / "m.yaml")
    assert again == model
    assert again.sensors == model.sensors
    assert Model.from_dict(model.to_dict()) == model


@pytest.mark.parametrize(
    ("effects", "words"),
    [
        ({"sensor_offset": {"sped": 0.1}}, ["effects.sensor_offset.sped: unknown channel", "did you mean 'speed'"]),
        ({"sensor_offset": {"velocty": 0.1}}, ["unknown channel", "did you mean 'velocity'"]),
        ({"sensor_offset": {"voltage": 0.1}}, ["unknown channel", "known: current, position, speed"]),
        ({"sensor_offset": {"effort": 0.1}}, ["unknown channel", "known: current, position, speed"]),
        ({"sensor_offset": {"offset": 0.1}}, ["unknown channel", "known: current, position, speed"]),
        ({"sensor_offset": {}}, ["effects.sensor_offset: names no channel", "current, position, speed"]),
        ({"sensor_offset": None}, ["names no channel"]),
        ({"sensor_offset": 0.1}, ["effects.sensor_offset", "0.1", "a mapping"]),
        ({"sensor_offset": {"speed": "much"}}, ["sensor_offset.speed", "'much'", "a number in [-1e+09, 1e+09] rad/s"]),
        ({"sensor_offset": {"speed": float("inf")}}, ["sensor_offset.speed", "inf"]),
        ({"sensor_offset": {"speed": 0.1, "velocity": 0.1}}, ["speed is given twice", "velocity"]),
        ({"sensor_gain": {"speed": 0.0}}, ["sensor_gain.speed", "found 0", "(0, 10]"]),
        ({"sensor_gain": {"velocity": 10.5}}, ["sensor_gain.velocity", "found 10.5", "(0, 10]"]),
        ({"sensor_delay": {"speed": -0.1}}, ["sensor_delay.speed", "found -0.1", "[0, 1] s"]),
        ({"sensor_delay": {"speed": 1.5}}, ["sensor_delay.speed", "found 1.5", "[0, 1] s"]),
        ({"sensor_of": {"speed": 1.5}}, ["unknown effect", "did you mean 'sensor_offset'"]),
    ],
)
def test_what_is_refused(effects, words):
    with pytest.raises(ModelError) as caught:
        with_effects(MOTOR, **effects)
    for word in words:
        assert word in str(caught.value)


def test_the_current_of_a_motor_without_inductance_is_a_channel():
    """It is no state, but a sensor is on it all the same."""
    quick = MOTOR.with_parameters(L_a=0.0)
    assert "current" not in quick.states
    assert quick.with_effect("sensor_offset", current=0.1).sensors["current"].offset == 0.1


@pytest.mark.parametrize(
    "change",
    [
        lambda m: m.value("sensor_offset.current"),
        lambda m: m.value("sensor_offset.sped"),
        lambda m: m.with_parameters({"sensor_offset.sped": 0.1}),
        lambda m: m.with_parameters({"sensor_gain.speed": 1.1}),
    ],
)
def test_unknown_parameters_name_the_nearest(change):
    with pytest.raises(ModelError, match=re.escape("did you mean 'sensor_offset.speed'")):
        change(MOTOR.with_effect("sensor_offset", speed=0.1))


def test_a_sensor_effect_of_ones_own_has_one_parameter(tmp_path):
    text = "from signlin_ros.effects import SensorEffect\nclass A(SensorEffect):\n    name = equation = 'drift'\n"
    (tmp_path / "drift.py").write_text(text)
    with pytest.raises(ModelError, match="0 parameters; a SensorEffect has one"):
        Model.from_dict({**MOTOR.to_dict(), "effect_files": ["drift.py"]}, folder=tmp_path)
