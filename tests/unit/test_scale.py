"""How large a parameter is in a record, by its unit."""

from __future__ import annotations

import pytest

from signlin_ros.plants.dc_motor import DcMotor
from signlin_ros.scale import Scale
from signlin_ros.trace import resolve_unit

SCALE = Scale(force=2.0, travel=3.0, velocity=5.0, acceleration=7.0, current=0.5, input=11.0, step=0.01, duration=16.0)


@pytest.mark.parametrize(
    ("unit", "size"),
    [
        ("F", 2.0),
        ("Q", 3.0),
        ("Q/s", 5.0),
        ("F/Q", 2 / 3),
        ("F/Q³", 2 / 27),
        ("F/Q⁵", 2 / 243),
        ("F·s/Q", 2 / 5),
        ("F·s²/Q²", 2 / 25),
        ("F·s²/Q", 2 / 7),
        ("1/A²", 4.0),
        ("U", 11.0),
    ],
)
def test_sizes_follow_from_the_unit(unit, size):
    assert SCALE.of(unit) == pytest.approx(size)


def test_units_of_any_power_are_written_as_the_plant_has_them():
    assert resolve_unit("F/Q⁵", DcMotor) == "N·m/rad⁵"
    assert resolve_unit("F·s²/Q²", DcMotor) == "N·m·s²/rad²"
