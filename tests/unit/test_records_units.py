"""Units and column heads of records."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from signlin_ros import units
from signlin_ros.records.header import Heading, heading


@pytest.mark.parametrize(
    ("found", "wanted", "factor"),
    [
        ("mm", "m", 1e-3),
        ("mm/s", "m/s", 1e-3),
        ("cm/s", "m/s", 1e-2),
        ("um", "m", 1e-6),
        ("µm", "m", 1e-6),
        ("deg", "rad", math.pi / 180),
        ("°", "rad", math.pi / 180),
        ("deg/s", "rad/s", math.pi / 180),
        ("rpm", "rad/s", 2 * math.pi / 60),
        ("rev/min", "rad/s", 2 * math.pi / 60),
        ("rad s^-1", "rad/s", 1.0),
        ("rad·s⁻¹", "rad/s", 1.0),
        ("ms", "s", 1e-3),
        ("us", "s", 1e-6),
        ("ns", "s", 1e-9),
        ("mA", "A", 1e-3),
        ("mV", "V", 1e-3),
        ("kN", "N", 1e3),
        ("N·mm", "N·m", 1e-3),
        ("N*mm", "N·m", 1e-3),
        ("N mm", "N·m", 1e-3),
        ("Nmm", "N·m", 1e-3),
        ("Nm", "N·m", 1.0),
        ("mNm", "N·m", 1e-3),
        ("N.m", "N·m", 1.0),
        ("m/s²", "m/s^2", 1.0),
        ("kg*m/s2", "N", 1.0),
        ("V/rad*s", "V", None),
        ("Hz", "rad/s", None),
        ("V", "A", None),
        ("degC", "K", 1.0),
        ("degC", "V", None),
        ("degF", "K", 5.0 / 9.0),
        ("0/1", "1", None),
        ("", "V", 1.0),
        ("V", "V", 1.0),
        ("mm", "m or rad", 1e-3),
        ("deg", "m or rad", math.pi / 180),
    ],
)
def test_conversion(found: str, wanted: str, factor: float | None) -> None:
    how = units.conversion(found, wanted)
    if factor is None:
        assert how is None
    else:
        assert how is not None
        assert how[0] == pytest.approx(factor, rel=1e-14)


@pytest.mark.parametrize(
    ("found", "wanted", "unit", "factor"),
    [
        ("rad", "m", "rad", 1.0),
        ("deg/s", "m/s", "rad/s", math.pi / 180),
        ("N·m", "N", "N·m", 1.0),
        ("mN·m", "N", "N·m", 1e-3),
    ],
)
def test_a_translational_model_takes_rotary_columns(found: str, wanted: str, unit: str, factor: float) -> None:
    how = units.conversion(found, wanted)
    assert how is not None
    assert how[0] == pytest.approx(factor)
    assert how[1] == unit


def test_a_rotary_model_takes_no_translational_columns() -> None:
    assert units.conversion("mm", "rad") is None
    assert units.conversion("N", "N·m") is None


@given(st.integers(min_value=-(10**12), max_value=10**12))
def test_a_thousandth_is_rounded_once(n: int) -> None:
    assert units.scaled(np.array([float(n)]), 1e-3)[0] == n / 1000


@pytest.mark.parametrize(
    ("text", "name", "unit"),
    [
        ("voltage", "voltage", ""),
        ("  q_meas [m] ", "q_meas", "m"),
        ("force [N] (=gtau*u)", "force", "N"),
        ("duty [-] (=int16(load)/885)", "duty", "-"),
        ("torque_enable [0/1]", "torque_enable", "0/1"),
        ("pulse_added [V] (file calls it pulses_N)", "pulse_added", "V"),
        ("torque [N·m]", "torque", "N·m"),
        ("t[s]", "t", "s"),
        ("voltage (V)", "voltage", "V"),
        ("speed (filtered)", "speed", ""),
        ("/cmd.data[0]", "/cmd.data[0]", ""),
        ("/cmd.data[0] [V]", "/cmd.data[0]", "V"),
        ("q[1]", "q[1]", ""),
        ("/joint_states.velocity[wheel]", "/joint_states.velocity[wheel]", ""),
        ("motor speed [rpm]", "motor speed", "rpm"),
        ("a []", "a", ""),
        ("lugre_friction.z", "lugre_friction.z", ""),
        ("rpm", "rpm", "rpm"),
        ("mA", "mA", "mA"),
        ("A", "A", ""),
        ("in", "in", ""),
    ],
)
def test_heading(text: str, name: str, unit: str) -> None:
    head = heading(text)
    assert (head.name, head.unit) == (name, unit)
    assert head.label == " ".join(text.split())


@pytest.mark.parametrize(
    ("text", "time"),
    [
        ("t", (0, "")),
        ("Time [ms]", (1, "ms")),
        ("timestamp_ns", (2, "ns")),
        ("stamp [us]", (3, "us")),
        ("temp", None),
        ("time_constant", None),
    ],
)
def test_time_columns(text: str, time: tuple[int, str] | None) -> None:
    assert heading(text).time == time


def test_a_heading_is_a_value() -> None:
    assert heading("a [V]") == Heading("a [V]", "a", "V")
