"""From columns to a model's inputs and measurements."""

import pickle
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest

from signlin_ros.errors import ModelError, RecordError
from signlin_ros.model import Model
from signlin_ros.records import ModelData, Record, Signal, read_for_model, read_record
from signlin_ros.records.header import heading

MOTOR = {
    "plant": "dc_motor",
    "parameters": {"R_a": 0.764, "L_a": 0.0026, "K_t": 0.0805, "K_m": 0.0805, "B": 0.0, "J": 0.0022},
}
OSCILLATOR = {"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.6, "k": 40.0}}
ELEMENT = {"plant": "force_element", "parameters": {"c": 800.0, "k": 0.0}}
ROWS = np.arange(12.0).reshape(4, 3)


def motor(**more: object) -> Model:
    return Model.from_dict({**MOTOR, **more})


def oscillator(**more: object) -> Model:
    return Model.from_dict({**OSCILLATOR, **more})


def element(**more: object) -> Model:
    return Model.from_dict({**ELEMENT, **more})


def record(**columns: object) -> Record:
    """A record of four samples: name=value, or name=(value, unit)."""
    signals = {}
    for name, column in columns.items():
        values, unit = column if isinstance(column, tuple) else (column, "")
        signals[name] = Signal(np.broadcast_to(np.asarray(values, dtype=float), (4,)), unit)
    return Record(np.arange(4) / 10, signals)


@pytest.fixture
def csv(tmp_path: Path) -> Callable[[str], Path]:
    def write(text: str) -> Path:
        (tmp_path / "run.csv").write_text(text)
        return tmp_path / "run.csv"

    return write


def test_everything_there() -> None:
    data = record(speed=[3, 4, 5, 6], voltage=[1, 2, 3, 4], current=[5, 6, 7, 8], temperature=0).for_model(motor())
    np.testing.assert_array_equal(data.u, [[1], [2], [3], [4]])
    assert list(data.measured) == ["current", "speed"]
    assert data.x0 is not None
    np.testing.assert_array_equal(data.x0, [5, 3])
    np.testing.assert_array_equal(data.x[:, 1], [3, 4, 5, 6])
    assert (data.inputs, data.states, data.unused) == (("voltage",), ("current", "speed"), ("temperature",))
    assert data.notes == ()
    assert data.units["speed"] == "rad/s"


def test_any_subset_of_the_states() -> None:
    data = record(voltage=1, speed=[3, 4, 5, 6]).for_model(motor())
    assert list(data.measured) == ["speed"]
    assert data.x0 is None
    assert np.isnan(data.x[:, 0]).all()
    assert record(voltage=1).for_model(motor()).measured == {}


def test_the_result_cannot_be_changed_but_travels() -> None:
    data = record(voltage=1, speed=[3, 4, 5, 6]).for_model(motor())
    for array in (data.t, data.u, data.measured["speed"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    with pytest.raises(FrozenInstanceError):
        data.u = data.x  # type: ignore[misc]
    again: ModelData = pickle.loads(pickle.dumps(data))
    np.testing.assert_array_equal(again.u, data.u)


def test_parts() -> None:
    data = record(voltage=[1, 2, 3, 4], speed=[3, 4, 5, 6], current=[5, 6, 7, 8]).for_model(motor())
    part = data.part(1, 3)
    assert len(part) == 2
    np.testing.assert_array_equal(part.u[:, 0], [2, 3])
    assert part.x0 is not None
    np.testing.assert_array_equal(part.x0, [6, 4])
    assert not part.measured["speed"].flags.writeable


def test_precedence() -> None:
    found = record(u=1, cmd=2, voltage=3)
    assert found.for_model(motor(), {"voltage": "u"}).u[0, 0] == 1
    assert found.for_model(motor(signals={"voltage": "cmd"})).u[0, 0] == 2
    assert found.for_model(motor(signals={"voltage": "cmd"}), {"voltage": "u"}).u[0, 0] == 1
    assert found.for_model(motor()).u[0, 0] == 3


def test_aliases_come_last() -> None:
    data = record(force=1, position=[1, 2, 3, 4], velocity=[5, 6, 7, 8]).for_model(oscillator())
    np.testing.assert_array_equal(data.measured["displacement"], [1, 2, 3, 4])
    both = record(force=1, position=[1, 2, 3, 4], displacement=[9, 9, 9, 9]).for_model(oscillator())
    assert both.measured["displacement"][0] == 9
    assert both.unused == ("position",)
    assert record(voltage=1, velocity=[1, 2, 3, 4]).for_model(motor()).measured["speed"][1] == 2
    assert record(effort=7, position=0).for_model(oscillator()).u[0, 0] == 7


def test_an_effort_is_no_current() -> None:
    assert record(voltage=1, effort=[1, 2, 3, 4]).for_model(motor()).measured == {}


def test_aliases_in_mappings() -> None:
    data = record(f=1, q=[1, 2, 3, 4]).for_model(oscillator(), {"position": "q", "effort": "f"})
    assert list(data.measured) == ["displacement"]
    with pytest.raises(RecordError, match="displacement twice"):
        record(f=1, q=0).for_model(oscillator(), {"position": "q", "displacement": "q", "force": "f"})
    with pytest.raises(ModelError, match="'sped'"):
        record(voltage=1, w=0).for_model(motor(), {"sped": "w"})


def test_a_position_needs_a_motor_that_has_one() -> None:
    found = record(voltage=1, q=[1, 2, 3, 4])
    with pytest.raises(ModelError, match=r"signal position=q: .*with_position: true"):
        found.for_model(motor(), {"position": "q"})
    assert found.for_model(motor(with_position=True), {"position": "q"}).measured["position"][3] == 4


def test_the_time_column_is_mapped_by_the_model_or_beside_it(csv: Callable[[str], Path]) -> None:
    file = csv("zeit,voltage,uhr\n0,1,0\n0.01,1,1\n0.02,2,2\n")
    mapped = motor(signals={"t": "zeit"})
    np.testing.assert_array_equal(read_for_model(file, mapped).t, [0, 0.01, 0.02])
    np.testing.assert_array_equal(read_for_model(file, motor(), {"t": "zeit"}).t, [0, 0.01, 0.02])
    np.testing.assert_array_equal(read_for_model(file, mapped, {"time": "uhr"}).t, [0, 1, 2])
    with pytest.raises(RecordError, match="the time twice, to 'zeit' and to 'uhr'"):
        read_for_model(file, motor(), {"t": "zeit", "time": "uhr"})


def test_missing_inputs() -> None:
    found = Record(
        np.arange(4) / 10,
        {"u_motor": Signal(np.ones(4), "V", "u_motor [V]"), "speed": Signal(np.ones(4))},
        "run.csv",
    )
    with pytest.raises(RecordError) as error:
        found.for_model(motor())
    message = str(error.value)
    for part in (
        "run.csv",
        "'voltage'",
        "'u_motor [V]'",
        "'speed'",
        "--signal voltage=COLUMN",
        "signals: {voltage: COLUMN}",
    ):
        assert part in message
    assert "in V or the like: 'u_motor [V]'" in message
    with pytest.raises(RecordError, match="did you mean 'voltag'"):
        record(voltag=1).for_model(motor())
    data = found.for_model(motor(), require="none")
    np.testing.assert_array_equal(data.u, 0)
    assert data.notes == ("no input voltage in the record: taken as 0",)
    with pytest.raises(RecordError, match="'inputs' or 'none'"):
        found.for_model(motor(), require="all")


def test_the_load_torque_may_be_missing() -> None:
    data = record(voltage=2).for_model(motor(with_load_torque=True))
    np.testing.assert_array_equal(data.u, [[2, 0]] * 4)
    assert "load_torque" in data.notes[0]
    np.testing.assert_array_equal(
        record(voltage=2, load_torque=3).for_model(motor(with_load_torque=True)).u, [[2, 3]] * 4
    )


def test_a_mapping_of_the_model_may_name_a_load_torque_that_it_does_not_use() -> None:
    model = motor(signals={"voltage": "u", "load_torque": "T"})
    np.testing.assert_array_equal(record(u=2, T=3).for_model(model).u, [[2]] * 4)


def test_a_mapping_of_the_model_that_does_not_fit_the_record() -> None:
    model = motor(signals={"voltage": "/cmd.data[0]", "speed": "omega"})
    data = record(voltage=2).for_model(model)
    assert len(data.notes) == 2
    assert "'/cmd.data[0]', which is not in this record; 'voltage' is used" in data.notes[0]
    assert "speed to 'omega', which is not in this record" in data.notes[1]
    with pytest.raises(RecordError, match=r"mapped to voltage\) 'x'; it has 'voltage'"):
        record(voltage=2).for_model(model, {"voltage": "x"})


@pytest.mark.parametrize(
    ("spec", "instead"),
    [("c1", "displacement: 1"), ("c1 [mm]", "displacement: '1 [mm]'"), ("0.001 * c1", "displacement: '0.001 * #1'")],
)
def test_a_column_of_a_file_with_names_is_not_called_by_the_number_that_it_has_without(
    csv: Callable[[str], Path], spec: str, instead: str
) -> None:
    """Curves as MCalibration writes them: the names stand in a comment, and lines end with a comma."""
    path = csv("# Data\n# way-x, way-y,\n" + "".join(f"{0.1 * i:.1f}, {i}.5,\n" for i in range(30)))
    said = {"t": "0.1", "force": "2"}
    for signals, more in (({"displacement": spec}, {}), ({}, {"displacement": spec})):
        with pytest.raises(RecordError, match=r"'c1.*it has 'way-x', 'way-y'.*the file has names") as error:
            read_for_model(path, element(signals={**said, **signals}), more)
        assert f"a column may be taken by its number, {instead}" in str(error.value)
        assert ("model file's signals" in str(error.value)) == bool(signals)
    taken = instead.partition(": ")[2].strip("'")
    data = read_for_model(path, element(signals={**said, "displacement": taken}))
    np.testing.assert_allclose(data.measured["displacement"], 0.1 * np.arange(30) * (1.0 if spec == "c1" else 1e-3))


def test_a_number_that_the_file_does_not_have_is_told_too(csv: Callable[[str], Path]) -> None:
    path = csv("t,x,f\n" + "".join(f"{0.1 * i:.1f},{i},1\n" for i in range(30)))
    data = read_for_model(path, element(signals={"displacement": "x", "force": "c7"}))
    (note,) = (note for note in data.notes if note.kind == "missing")
    assert note.endswith(
        "the file has names, and none of them is c7; a column may be taken by its number, as in force: 2"
    )
    with pytest.raises(RecordError, match=r"no signal \(mapped to force\) 'c9'; it has 'c2', 'c3'\Z"):
        read_for_model(csv("0,1,2\n1,2,3\n2,3,4\n"), element(), {"displacement": "c2", "force": "c9"})


def test_why_the_model_s_own_mapping_of_an_input_does_not_hold_is_told() -> None:
    with pytest.raises(
        RecordError, match=r"no signal \(mapped to voltage\) 'u'; it has 'U_mot'.*--signal voltage=COLUMN"
    ):
        record(U_mot=2).for_model(motor(signals={"voltage": "u"}))
    with pytest.raises(RecordError, match=r"voltage: '2 \* \(U_mot': a \) is missing"):
        record(U_mot=2).for_model(motor(signals={"voltage": "2 * (U_mot"}))


def test_units_are_converted() -> None:
    found = record(voltage=([1, 2, 3, 4], "mV"), speed=([60, 0, 0, 0], "rpm"), current=([1, 2, 3, 4], "mA"))
    data = found.for_model(motor())
    np.testing.assert_array_equal(data.u[:, 0], [0.001, 0.002, 0.003, 0.004])
    assert data.measured["speed"][0] == pytest.approx(2 * np.pi)
    np.testing.assert_array_equal(data.measured["current"], [0.001, 0.002, 0.003, 0.004])


def test_the_bracket_of_a_heading_is_no_unit_of_the_formula(csv: Callable[[str], Path]) -> None:
    path = csv("t,i [A],q [rad]\n0,1,2\n0.1,2,3\n0.2,3,5\n0.3,1,2\n")
    signals = {"force": "1.5 * i [A]", "displacement": "-1 * q [rad]"}
    data = read_for_model(path, Model.from_dict({**OSCILLATOR, "axis": "rotary"}), signals)
    np.testing.assert_allclose(data.u[:, 0], [1.5, 3.0, 4.5, 1.5])
    np.testing.assert_allclose(data.measured["displacement"], [-2.0, -3.0, -5.0, -2.0])
    assert data.units["force"] == "N·m"
    with pytest.raises(RecordError, match="force is in 'A'"):
        read_for_model(path, oscillator(), {"force": "1.5 * #2 [A]", "displacement": "q"})


def test_units_that_do_not_fit() -> None:
    with pytest.raises(RecordError, match=r"speed is in 'm/s' \(column 'speed'\), the model in 'rad/s'"):
        record(voltage=1, speed=(1, "m/s")).for_model(motor())
    with pytest.raises(RecordError, match="'0/1'"):
        record(voltage=(1, "0/1")).for_model(motor())


def test_rotary_records_of_translational_models() -> None:
    data = record(force=(1, "N·m"), displacement=([90, 0, 0, 0], "deg")).for_model(oscillator())
    assert data.measured["displacement"][0] == pytest.approx(np.pi / 2)
    assert (data.units["displacement"], data.units["velocity"], data.units["force"]) == (
        "rad",
        "rad/s",
        "N·m",
    )
    assert any("rotary" in note for note in data.notes)
    with pytest.raises(RecordError, match="force is in 'N' but displacement is in 'deg'"):
        record(force=(1, "N"), displacement=(1, "deg")).for_model(oscillator())


def test_where_the_model_says_that_its_axis_is_rotary_nothing_is_assumed() -> None:
    model = Model.from_dict({**oscillator().to_dict(), "axis": "rotary"})
    data = record(force=(1, "N·m"), displacement=([90, 0, 0, 0], "deg")).for_model(model)
    assert data.measured["displacement"][0] == pytest.approx(np.pi / 2)
    assert data.units == {"displacement": "rad", "velocity": "rad/s", "force": "N·m"}
    assert not [note for note in data.notes if note.kind == "assumed"]
    throughout = record(displacement=1, force=1).for_model(model, {"force": "0.5"})
    assert "force is 0.5 N·m throughout, as said" in throughout.notes


def test_assumed_units_of_a_rotary_record_are_rotary() -> None:
    columns = {"force": (1, "N·m"), "displacement": (1, "deg"), "w": 1}

    def assumed(spec: str, **more: object) -> list[str]:
        notes = record(**{**columns, **more}).for_model(oscillator(), {"velocity": spec}).notes
        return [note for note in notes if "no unit" in note]

    assert assumed("w") == ["no unit is stated for velocity beside others that have one: taken in rad/s"]
    assert assumed("6.283185307 * w") == assumed("w [rad/s]") == []
    silent = record(force=1, displacement=(1, "rad"), velocity=(1, "rad/s")).for_model(oscillator())
    assert "no unit is stated for force beside others that have one: taken in N·m" in silent.notes
    linear = record(force=1, displacement=(1, "mm")).for_model(oscillator())
    assert "no unit is stated for force beside others that have one: taken in N" in linear.notes


def test_missing_samples() -> None:
    nan = np.nan
    data = record(voltage=[1, nan, 3, nan], speed=[nan, 1, 2, 3], current=nan).for_model(motor())
    np.testing.assert_array_equal(data.u[:, 0], [1, 1, 3, 3])
    assert np.isnan(data.measured["speed"][0])
    assert list(data.measured) == ["speed"]
    assert data.x0 is None
    assert any("voltage: 2 missing samples hold the value before them, the first at t = 0.1 s" in n for n in data.notes)
    assert any("current holds no sample" in note for note in data.notes)


def test_missing_samples_of_a_measured_input_lie_between_their_neighbours(csv: Callable[[str], Path]) -> None:
    """Two torques of 3000 were missing, and held: the right laws "explained a part"."""
    rows = enumerate(("0", "0.9", "2.1", "", "3.9", "5", "", ""))
    data = read_for_model(csv("t,voltage,speed\n" + "".join(f"{i / 10},{u},{i}\n" for i, u in rows)), motor())
    np.testing.assert_allclose(data.u[:, 0], [0.0, 0.9, 2.1, 3.0, 3.9, 5.0, 5.0, 5.0])
    said = "voltage: 3 missing samples lie on the line between their neighbours, the first at row 4"
    assert any(said in note for note in data.notes)


def test_inputs_missing_too_often_are_refused_with_their_row(csv: Callable[[str], Path]) -> None:
    def text(gap: int) -> str:
        cells = ["1"] * 3 + [""] * gap + ["2"] * 3
        return "t,voltage\n" + "".join(f"{i},{cell}\n" for i, cell in enumerate(cells))

    assert read_for_model(csv(text(5)), motor()).u[7, 0] == 1
    with pytest.raises(
        RecordError, match=r"run.csv: row 4 \(line 5\): the input 'voltage' is missing more than 5 times"
    ):
        read_for_model(csv(text(6)), motor())
    with pytest.raises(RecordError, match=r"row 1 \(line 2\): the input 'voltage' is missing before its first value"):
        read_for_model(csv("t,voltage\n0,\n1,2\n"), motor())


def test_a_formula_that_divides_by_zero_is_named_with_the_row_and_what_to_do(csv: Callable[[str], Path]) -> None:
    """Force = power / speed of a bicycle, which stands now and then."""

    def text(first: int, last: int, power: int = 0) -> str:
        rows = ((i, *((power, 0) if first <= i < last else (200, 4)), i) for i in range(30))
        return "t [s],P,v,x\n" + "".join(",".join(map(str, row)) + "\n" for row in rows)

    bike = oscillator(signals={"displacement": "x", "force": "P / v"})
    said = "force = P / v has no value where it divides by zero, in {} rows, the first {}; add a small number"
    with pytest.raises(RecordError) as error:
        read_for_model(csv(text(0, 2)), bike)
    assert "row 1 (line 2): the input 'force' has no value before its first value" in str(error.value)
    assert said.format(2, "row 1 (line 2)") in str(error.value)
    for last, power in ((16, 0), (16, 5), (28, 0)):
        with pytest.raises(RecordError) as error:
            read_for_model(csv(text(10, last, power)), bike)
        assert "row 11 (line 12): the input 'force' has no value more than 5 times in a row" in str(error.value)
        assert said.format(last - 10, "row 11 (line 12)") in str(error.value)
    data = read_for_model(csv(text(10, 12)), bike)
    np.testing.assert_array_equal(data.u[:, 0], 50)
    assert [note.kind for note in data.notes if note.channel == "force"] == ["mapped", "undefined", "filled"]
    whole = read_for_model(csv(text(0, 20)), oscillator(signals={"displacement": "x", "force": "P / (v + 0.001)"}))
    assert whole.u[0, 0] == 0


def test_columns_that_the_model_does_not_use_do_no_harm(csv: Callable[[str], Path]) -> None:
    path = csv("t,voltage,mode,load\n0,1,idle,inf\n1,2,3,4\n")
    assert read_for_model(path, motor()).u[1, 0] == 2
    with pytest.raises(RecordError, match="'idle' is not a number"):
        read_for_model(path, motor(), {"speed": "mode"})


def test_the_time_column_can_be_mapped(csv: Callable[[str], Path]) -> None:
    path = csv("clock [ms],voltage\n0,1\n5,2\n")
    np.testing.assert_array_equal(read_for_model(path, motor(), {"t": "clock"}).t, [0, 0.005])


def test_an_imposed_motion_recorded_as_displacement() -> None:
    found = record(displacement=([0, 100, 400, 900], "mm"), force=(5, "N"))
    data = found.for_model(element())
    np.testing.assert_allclose(data.u[:, 0], [1, 2, 4, 5])
    assert any("velocity is the derivative of a spline through displacement" in note for note in data.notes)
    assert set(data.measured) == {"displacement", "force"}
    with_velocity = record(displacement=1, velocity=7, force=5).for_model(element())
    np.testing.assert_array_equal(with_velocity.u[:, 0], 7)


def test_ambiguous_names(csv: Callable[[str], Path]) -> None:
    path = csv("t,voltage,speed [rad/s],speed [rpm]\n0,1,2,3\n1,2,3,4\n")
    with pytest.raises(RecordError, match="ambiguous"):
        read_for_model(path, motor())
    assert read_for_model(path, motor(), {"speed": "speed [rad/s]"}).measured["speed"][0] == 2
    assert read_record(path).find("voltage") == "voltage"


def test_a_plant_says_itself_which_inputs_may_be_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = motor(with_load_torque=True)
    data = record(voltage=1, speed=[3, 4, 5, 6]).for_model(loaded)
    np.testing.assert_array_equal(data.u, [[1, 0]] * 4)
    assert "no input load_torque in the record: taken as 0" in data.notes
    monkeypatch.setattr(loaded.plant, "optional_inputs", {"voltage": "V"})
    with pytest.raises(RecordError, match="no column for input 'load_torque'"):
        record(voltage=1, speed=[3, 4, 5, 6]).for_model(loaded)


@pytest.mark.parametrize("inductance", [0.0, 0.0026])
def test_a_current_is_read_with_inductance_and_without(inductance) -> None:
    model = motor(parameters=MOTOR["parameters"] | {"L_a": inductance}, signals={"current": "shunt"})
    assert record(voltage=2, speed=1, shunt=3).for_model(model).measured["current"][0] == 3


@pytest.mark.parametrize("name", ["speed", "voltage"])
def test_what_no_sensor_says_is_refused_by_row_and_column(csv: Callable[[str], Path], name: str) -> None:
    last = {"voltage": "1", "speed": "1", name: "-1e300"}
    text = "t,voltage,speed [rpm],other\n0,1,2,1e300\n0.1,1,3,1e300\n"
    file = csv(f"{text}0.2,{last['voltage']},{last['speed']},1e300\n")
    with pytest.raises(RecordError, match=rf"run.csv: row 3 \(line 4\), column '{name}.*': -1e\+300 is no measurement"):
        read_for_model(file, motor())
    data = read_for_model(csv("t,voltage,speed,other\n0,1,2,1e300\n0.1,1,3,1e300\n"), motor())
    assert data.unused == ("other",)


def test_memory_that_was_never_written_is_missing(csv: Callable[[str], Path]) -> None:
    rows = [f"{0.01 * k:.2f},1,{'1.2e308' if k == 2 else k}" for k in range(200)]
    data = read_for_model(csv("t,voltage,speed\n" + "\n".join(rows) + "\n"), motor())
    assert np.flatnonzero(np.isnan(data.measured["speed"])).tolist() == [2]
    assert any(
        "row 3 (line 4), column 'speed': 1.2e+308 is no measurement: it is taken for missing" in n for n in data.notes
    )


@pytest.mark.parametrize("held", [True, False])
def test_a_rate_that_was_held_is_told_from_a_smooth_one_by_the_force(held: bool) -> None:
    t = np.arange(400) * 0.005
    velocity = 0.3 * np.sin(9.0 * t) + 0.2 * np.cos(23.0 * t)
    smooth = -0.3 * np.cos(9.0 * t) / 9.0 + 0.2 * np.sin(23.0 * t) / 23.0
    stepped = np.concatenate([[0.0], np.cumsum(velocity[:-1]) * 0.005])
    shown = {"displacement": Signal(stepped if held else smooth, "m"), "force": Signal(80.0 * velocity + 3.0, "N")}
    data = Record(t, shown).for_model(element())
    assert any("held in between" in note for note in data.notes) is held
    error = np.abs(data.u[:-1, 0] - velocity[:-1]).max()
    assert error < (1e-9 if held else 5e-3)


def test_formulas_that_begin_alike_do_not_take_one_for_a_column_of_the_other(csv: Callable[[str], Path]) -> None:
    rows = "\n".join(f"{0.1 * k:.1f},{500 + k},{510 + 2 * k}" for k in range(30))
    model = oscillator(signals={"force": "0.25 * (goal - 500)", "displacement": "0.25 * (present - 500)"})
    data = read_for_model(csv(f"t,goal,present\n{rows}"), model)
    np.testing.assert_allclose(data.u[:, 0], 0.25 * np.arange(30))
    np.testing.assert_allclose(data.measured["displacement"], 2.5 + 0.5 * np.arange(30))


@pytest.mark.parametrize(
    ("head", "unit"),
    [
        ("Current [Iq] [A]", "A"),
        ("Speed [raw] (m/s)", "m/s"),
        ("v (tick / second)", "tick / second"),
        ("v (counts)", "counts"),
        ("v [x] (left)", "x"),
    ],
)
def test_the_bracket_that_holds_the_unit(head: str, unit: str) -> None:
    assert heading(head).unit == unit
