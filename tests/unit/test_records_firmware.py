"""What firmware and test scripts print: banners, clocks with a prefix, one quantity in two units, torque_nm."""

import numpy as np
import pytest

from signlin_ros.errors import RecordError
from signlin_ros.model import Model
from signlin_ros.records import read_for_model, read_record

T = 0.005 * np.arange(60)
ANGLE = np.sin(9.0 * T)
AXIS = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 0.002, "c": 0.0004, "k": 0.0}})


def written(path, header, *columns, before=""):
    rows = "\n".join(",".join(f"{value:.6f}" for value in row) for row in zip(*columns, strict=True))
    path.write_text(f"{before}{header}\n{rows}\n")
    return path


def test_a_header_in_a_comment_below_a_banner(tmp_path):
    path = written(tmp_path / "a.csv", "# time,vel,iq", T, ANGLE, 2 * ANGLE, before="OK: Stream ON\n")
    record = read_record(path)
    assert list(record.signals) == ["vel", "iq"]
    np.testing.assert_allclose(record.signals["iq"].values, 2 * ANGLE, atol=1e-6)


@pytest.mark.parametrize("name", ["Teensy_time_s", "capture_time_s", "motor_timestamp_s", "log_clock_s"])
def test_a_clock_with_a_prefix(name, tmp_path):
    record = read_record(written(tmp_path / "a.csv", f"{name},q", 12.5 + T, ANGLE))
    np.testing.assert_allclose(record.t - record.t[0], T, atol=1e-6)


UNITS = [("ms", 1e3), ("us", 1e6), ("usec", 1e6), ("nsec", 1e9), ("Milliseconds", 1e3), ("microsecond", 1e6)]


@pytest.mark.parametrize(("name", "scale"), UNITS)
def test_a_clock_that_is_called_by_its_unit(name, scale, tmp_path):
    record = read_record(written(tmp_path / "a.csv", f"{name},goal,pos", scale * (1.5 + T), ANGLE, ANGLE))
    np.testing.assert_allclose(record.t - record.t[0], T, atol=1e-6)
    assert list(record.signals) == ["goal", "pos"]


def test_a_clock_that_is_called_by_its_unit_may_overflow(tmp_path):
    us = np.mod(1e6 * T + 2.0**32 - 1e5, 2.0**32)
    record = read_record(written(tmp_path / "a.csv", "us,goal,pos", us, ANGLE, ANGLE))
    np.testing.assert_allclose(record.t - record.t[0], T, atol=1e-6)


def test_a_speed_that_is_called_by_its_unit_is_no_clock(tmp_path):
    with pytest.raises(RecordError, match="no time column"):
        read_record(written(tmp_path / "a.csv", "ms,q", ANGLE, ANGLE))


def test_seconds_that_are_no_clock_are_none(tmp_path):
    with pytest.raises(RecordError, match="no time column"):
        read_record(written(tmp_path / "a.csv", "pulse_s,q", 12.5 + T, ANGLE))


def test_one_quantity_in_two_units_is_no_question(tmp_path):
    path = written(tmp_path / "a.csv", "t,q_rad,q_deg", T, ANGLE, np.degrees(ANGLE))
    record = read_record(path)
    np.testing.assert_allclose(record.signals[record.find("q")].values, ANGLE, atol=1e-6)


def test_two_quantities_of_one_name_stay_a_question(tmp_path):
    record = read_record(written(tmp_path / "a.csv", "t,q_rad,q_deg", T, ANGLE, np.degrees(1.01 * ANGLE)))
    with pytest.raises(RecordError, match="'q' is ambiguous: 'q_rad', 'q_deg'"):
        record.find("q")


@pytest.mark.parametrize("torque", ["torque_nm", "torque_Nm", "torque [Nm]"])
def test_a_torque_in_small_letters_is_no_length(torque, tmp_path):
    """It was read as nanometres, and refused beside an angle."""
    path = written(tmp_path / "a.csv", f"t,{torque},angle_rad", T, 0.1 * ANGLE, ANGLE)
    data = read_for_model(path, AXIS, {"force": torque, "displacement": "angle_rad"})
    assert data.units["force"] == "N·m"
    np.testing.assert_allclose(data.u[:, 0], 0.1 * ANGLE, atol=1e-6)
