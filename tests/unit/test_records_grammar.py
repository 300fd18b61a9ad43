"""Mappings that state what a column is."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from signlin_ros.errors import RecordError
from signlin_ros.model import Model
from signlin_ros.records import Record, Signal, read_for_model
from signlin_ros.records.grammar import is_formula, parse, split_unit, words
from signlin_ros.records.table import Series

COLUMNS = {
    "a": np.array([1.0, -2.0, 3.0]),
    "b [m]": np.array([4.0, 5.0, -6.0]),
    "/cmd.data[0]": np.array([7.0, 8.0, 9.0]),
}
NAMES = {"a": "a", "b": "b [m]", "b [m]": "b [m]", "/cmd.data[0]": "/cmd.data[0]"}
A, B, C = COLUMNS.values()
MOTOR = Model.load("dc_motor")
OSCILLATOR = Model.load("mass_spring_damper")


@pytest.mark.parametrize(
    ("text", "right"),
    [
        ("-0.5 * a", -0.5 * A),
        ("a - b", A - B),
        ("a-b", A - B),
        ("2*(a + b [m])/4", (A + B) / 2),
        ("- -a", A),
        ("1e-3*/cmd.data[0]", C / 1000),
        ("/cmd.data[0]/2", C / 2),
        ("'b [m]' * 2", 2 * B),
        ("sign(a) * abs(b)", np.sign(A) * np.abs(B)),
        ("A * 2", 2 * A),
        ("signbit(a + 1029, 10)", [-6.0, -3.0, -8.0]),
        ("int8(a * 100)", [100.0, 56.0, 44.0]),
    ],
)
def test_formulas(text: str, right: np.ndarray) -> None:
    np.testing.assert_allclose(parse(text, NAMES, "x").evaluate(COLUMNS), right)


REFUSED = ["a +", "(a", "a b", "sin(a)", "__import__('os')", "a.b", "a[0]", "signbit(a)", "signbit(a, b)", "x * 2"]
REFUSED += ["a ** 2", "a if a else b", "(" * 100 + "a" + ")" * 100, "-" * 1000 + "a"]


@pytest.mark.parametrize("text", REFUSED)
def test_anything_else_is_refused_with_the_formula(text: str) -> None:
    with pytest.raises(RecordError, match=r"^x: ['\"].*allowed: numbers, columns"):
        parse(text, NAMES, "x")


@given(st.text(alphabet="ab()+-*/.,0123456789e [m]'\"sign", max_size=30))
def test_no_text_breaks_it(text: str) -> None:
    try:
        node = parse(text, NAMES, "x")
    except RecordError:
        return
    assert set(node.columns()) <= set(COLUMNS)


def test_units_and_words() -> None:
    assert split_unit("meas [rpm]") == ("meas", "rpm")
    assert split_unit("/joint_states.velocity[wheel]")[1] == ""
    assert split_unit("(a + b)[mm]") == ("(a + b)", "mm")
    assert words('2 * /odom.twist.twist.linear.x + "pos (5)" - u') == ["pos (5)", "/odom.twist.twist.linear.x", "u"]
    assert words("2 * #2 - u") == ["#2", "u"]
    assert not is_formula("/joint_states.velocity[left_wheel]")
    assert is_formula("sign(dir) * pwm")


def test_where_a_formula_divides_by_zero() -> None:
    columns = {"p": np.array([0.0, 1.0, np.nan, 4.0]), "v": np.array([0.0, 0.0, 0.0, 2.0])}
    names = {name: name for name in columns}
    for text, lost in (("p / v", [1, 1, 1, 0]), ("2 - abs(p / (v - 2))", [0, 0, 0, 1]), ("p / 2 + v", [0, 0, 0, 0])):
        node = parse(text, names, "force")
        assert np.broadcast_to(node.undefined(columns), 4).tolist() == [bool(one) for one in lost]


def record(**signals: Signal) -> Record:
    return Record(np.arange(3) / 100, signals, "run.csv")


def test_a_factor_states_the_conversion_a_sign_does_not() -> None:
    rpm = Signal(np.array([30.0, 60.0, -30.0]), "rpm", "meas_rpm")
    found = record(voltage=Signal(np.ones(3)), meas_rpm=rpm)
    stated = found.for_model(MOTOR, {"speed": "-0.10472 * meas_rpm"})
    np.testing.assert_allclose(stated.measured["speed"], -0.10472 * rpm.values)
    turned = found.for_model(MOTOR, {"speed": "-meas_rpm"})
    np.testing.assert_allclose(turned.measured["speed"], -np.pi / 30 * rpm.values)
    geared = found.for_model(MOTOR, {"speed": "meas_rpm / 10 [rpm]"})
    np.testing.assert_allclose(geared.measured["speed"], np.pi / 300 * rpm.values)
    for data in (stated, turned, geared):
        assert any(note.kind == "mapped" and note.channel == "speed" for note in data.notes)


@pytest.mark.parametrize("factor", [1.0, -1.0, 1.001])
def test_a_factor_of_one_is_the_conversion_of_a_unit_that_does_not_fit(factor: float) -> None:
    label = "Angle, Ch 3+4"
    found = record(**{label: Signal(np.array([1.0, 2.0, 3.0]), "Ch 3+4", label)})
    data = found.for_model(OSCILLATOR, {"force": f'{factor} * "{label}"'})
    np.testing.assert_allclose(data.u[:, 0], factor * np.array([1.0, 2.0, 3.0]))
    assert any("the columns' numbers as they stand" in note for note in data.notes)


@pytest.mark.parametrize("spec", ["-1 * meas", "1.0 * meas", "meas / 1", "-meas"])
def test_a_factor_of_one_leaves_a_unit_that_fits(spec: str) -> None:
    found = record(voltage=Signal(np.ones(3)), meas=Signal(np.full(3, 30.0), "rpm", "meas [rpm]"))
    np.testing.assert_allclose(np.abs(found.for_model(MOTOR, {"speed": spec}).measured["speed"]), np.pi)


def test_what_a_refusal_says_of_a_formula_can_be_said() -> None:
    found = record(**{"Angle, Ch 3+4": Signal(np.array([1.0, 2.0, 3.0]), "Ch 3+4", "Angle, Ch 3+4")})
    with pytest.raises(RecordError) as error:
        found.for_model(OSCILLATOR, {"force": '-"Angle, Ch 3+4"'})
    one, two = re.findall(r"--signal 'force = (.*?)'", str(error.value))
    assert found.for_model(OSCILLATOR, {"force": one.replace("UNIT", "kN")}).u[1, 0] == -2000.0
    assert found.for_model(OSCILLATOR, {"force": two.replace("FACTOR", "3")}).u[1, 0] == -6.0


def test_a_unit_may_be_stated_for_a_column_that_has_none() -> None:
    found = record(voltage=Signal(np.ones(3)), meas=Signal(np.ones(3)))
    np.testing.assert_allclose(found.for_model(MOTOR, {"speed": "meas [rpm]"}).measured["speed"], np.pi / 30)


def test_different_units_are_not_added() -> None:
    found = record(voltage=Signal(np.ones(3)), a=Signal(np.ones(3), "rpm"), b=Signal(np.ones(3), "rad/s"))
    with pytest.raises(RecordError, match=r"adds different units \('a' in rpm, 'b' in rad/s\)"):
        found.for_model(MOTOR, {"speed": "a + b"})


def test_a_direction_pin() -> None:
    found = record(pwm=Signal(np.array([1.0, 2.0, 3.0])), dir=Signal(np.array([0.0, 1.0, 0.0])))
    data = found.for_model(MOTOR, {"voltage": "sign(dir) * pwm"})
    np.testing.assert_array_equal(data.u[:, 0], [-1, 2, -3])
    assert any("only 0 and 1" in note for note in data.notes)


def test_a_unit_that_does_not_fit_says_what_to_say() -> None:
    found = record(voltage=Signal(np.ones(3), "counts", "adc [counts]"))
    with pytest.raises(RecordError, match=r"'counts', which is no unit that is known.*voltage = FACTOR \* adc"):
        found.for_model(MOTOR)
    unsure = record(voltage=Signal(np.ones(3)), speed_m=Signal(np.ones(3), "m", "speed_m"))
    np.testing.assert_array_equal(unsure.for_model(MOTOR).measured["speed"], 1.0)


@pytest.mark.parametrize(
    ("said", "right"), [("0", 0.0), ("0.0", 0.0), ("-2.5", -2.5), ("0.5 [kN]", 500.0), ("3.0", 3.0)]
)
def test_an_input_may_be_a_number_throughout(said: str, right: float) -> None:
    """A free motion has no column of its force."""
    found = record(displacement=Signal(np.array([3.0, 2.0, 1.0]), "m", "displacement [m]"))
    data = found.for_model(OSCILLATOR, {"force": said})
    np.testing.assert_array_equal(data.u, np.full((3, 1), right))
    assert f"force is {right:g} N throughout, as said" in data.notes
    assert not any("no unit is stated" in note for note in data.notes)
    assert data.unused == ()


def test_the_model_file_takes_a_number_for_an_input() -> None:
    model = Model.from_dict({**OSCILLATOR.to_dict(), "signals": {"force": 0.0}})
    assert Model.from_dict(model.to_dict()).signals == model.signals
    found = record(displacement=Signal(np.array([3.0, 2.0, 1.0]), "deg"), force=Signal(np.ones(3)))
    data = found.for_model(model)
    np.testing.assert_array_equal(data.u, 0.0)
    assert "force is 0 N·m throughout, as said" in data.notes
    assert found.for_model(model, {"force": "force"}).u[0, 0] == 1.0


def test_what_is_measured_is_no_number() -> None:
    found = record(force=Signal(np.ones(3)))
    with pytest.raises(RecordError, match=r"run.csv: displacement = 0.0: displacement is measured, no input"):
        found.for_model(OSCILLATOR, {"displacement": "0.0"})
    with pytest.raises(RecordError, match=r"force = 1 / 0: inf is no value of an input"):
        found.for_model(OSCILLATOR, {"force": "1 / 0"})


def test_a_whole_number_is_that_of_a_column() -> None:
    numbered = record(c1=Signal(np.ones(3), "", "c1", 1), c2=Signal(np.full(3, 7.0), "", "c2", 2))
    assert numbered.for_model(OSCILLATOR, {"force": "2", "displacement": "1"}).u[0, 0] == 7.0
    with pytest.raises(RecordError, match=r"force = 3: names no column.*has a decimal point, 3\.0"):
        numbered.for_model(OSCILLATOR, {"force": "3"})


@pytest.mark.parametrize("head", ["position [m]\n", ""])
def test_a_free_motion_is_a_file_of_one_column(head: str, tmp_path: Path) -> None:
    file = tmp_path / "free.csv"
    file.write_text(head + "3.5\n2.5\n1.5\n")
    data = read_for_model(file, OSCILLATOR, {"t": "0.01", "force": "0", "displacement": "position" if head else "c1"})
    np.testing.assert_array_equal(data.measured["displacement"], [3.5, 2.5, 1.5])
    np.testing.assert_array_equal(data.u, np.zeros((3, 1)))


def test_a_number_in_a_bag_takes_the_stamps_of_what_is_measured() -> None:
    t = np.arange(5) / 50
    series = {"/x.data": Series(t, t + 1.0, "m", "/x.data")}
    one = Record(t, {"/x.data": Signal(t + 1.0, "m", "/x.data")}, "bag", series=series)
    data = one.for_model(OSCILLATOR, {"force": "0", "displacement": "/x.data"})
    np.testing.assert_array_equal(data.u, np.zeros((5, 1)))


@pytest.mark.parametrize(("angle", "force"), [("deg", "N·m"), ("mm", "N"), ("", "N")])
def test_the_unit_that_a_refusal_names_is_of_the_record_s_kind(angle: str, force: str) -> None:
    """A force in newtons beside an angle would be the next refusal."""
    found = record(force=Signal(np.ones(3), "V", "force [V]"), displacement=Signal(np.array([1.0, 2.0, 3.0]), angle))
    with pytest.raises(RecordError, match=f"the model in '{force}'; say what it is"):
        found.for_model(OSCILLATOR)
    assert found.for_model(OSCILLATOR, {"force": f"force [{force}]"}).u[0, 0] == 1.0


def test_the_unit_that_a_refusal_names_is_of_the_model_s_axis() -> None:
    found = record(force=Signal(np.ones(3), "V", "force [V]"), displacement=Signal(np.ones(3)))
    with pytest.raises(RecordError, match="the model in 'N·m'"):
        found.for_model(Model.from_dict({**OSCILLATOR.to_dict(), "axis": "rotary"}))


def test_the_model_file_takes_formulas_and_a_step() -> None:
    model = MOTOR.with_options(signals={"voltage": "2 * u", "speed": "w [deg/s]"})
    found = record(u=Signal(np.ones(3)), w=Signal(np.full(3, 180.0)))
    data = found.for_model(model)
    assert data.u[0, 0] == 2.0
    assert data.measured["speed"][0] == pytest.approx(np.pi)


@pytest.mark.parametrize(
    ("spec", "expected"), [("2 * c1", 200.0), ("2 * #1", 200.0), ("2 * t", 0.2), ("c2 + 0.01 * c1", 1.0)]
)
def test_a_formula_may_use_the_time(tmp_path: Path, spec: str, expected: float) -> None:
    """A drive at constant speed was recorded with its torque alone: its position is speed x time ("unknown: 'c1'")."""
    file = tmp_path / "run.csv"
    file.write_text("".join(f"{100 + 10 * i}\t{0.5 * i}\n" for i in range(30)))
    model = Model.from_dict({"plant": "force_element", "parameters": {"c": 1.0, "k": 0.0}})
    signals = {"t": "c1 [ms]", "displacement": spec, "velocity": "2.0", "force": "c2"}
    data = read_for_model(file, model, signals)
    assert data.measured["displacement"][0] == pytest.approx(expected)
    assert data.t[0] == pytest.approx(0.1)
    with pytest.raises(RecordError, match="no signal"):
        read_for_model(file, model, {**signals, "displacement": "c1"})


def test_a_column_called_t_is_taken_before_the_time() -> None:
    found = record(t=Signal(np.full(3, 7.0)), force=Signal(np.ones(3)))
    assert found.for_model(OSCILLATOR, {"displacement": "2 * t"}).measured["displacement"][0] == 14.0


def test_a_number_is_no_column_that_is_called_so() -> None:
    """An oscilloscope calls its channels 1 and 2; what a refusal says to say takes them in quotes."""
    scope = record(
        **{"1": Signal(np.arange(3.0), "V", "1 [V]", 2), "2": Signal(np.array([5.0, 7.0, 9.0]), "V", "2 [V]", 3)}
    )
    motor = Model.load("dc_motor")
    with pytest.raises(RecordError, match=r"--signal 'speed = \"2\" \[UNIT\]'") as refused:
        scope.for_model(motor, {"voltage": "#2", "speed": "2"})
    assert 'FACTOR * "2"' in str(refused.value)
    for said, factor in (('"2" [rad/s]', 1.0), ('3 * "2"', 3.0), ("2 * #3", 2.0)):
        found = scope.for_model(motor, {"voltage": "#2", "speed": said})
        np.testing.assert_allclose(found.measured["speed"], factor * np.array([5.0, 7.0, 9.0]))
