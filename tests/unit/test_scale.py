"""How large a parameter is in a record, by its unit."""

from __future__ import annotations

import pytest

from signlin_ros.plants.dc_motor import DcMotor
from signlin_ros.plants.mass_spring_damper import MassSpringDamper
from signlin_ros.recording.trace import resolve_unit, rotary_unit
from signlin_ros.scale import Scale

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


def test_an_inertia_is_in_the_unit_of_an_inertia():
    """ "An inertia of 2.27 N·m·s²/rad" beside the plant's in kg·m²."""
    assert resolve_unit("F·s²/Q", DcMotor) == resolve_unit("F·s²/Q", MassSpringDamper, rotary=True) == "kg·m²"
    assert resolve_unit("F·s²/Q", MassSpringDamper) == "kg"


def test_units_of_a_plant_that_stands_for_a_rotary_one_are_rotary_at_any_power():
    assert rotary_unit("N·s²/m²") == "N·m·s²/rad²"
    assert rotary_unit("N/m³") == resolve_unit("F/Q³", MassSpringDamper, rotary=True) == "N·m/rad³"
    assert rotary_unit("1/m") == "1/rad"
    assert [rotary_unit(u) for u in ("kg", "A", "1/K", "N·m")] == ["kg·m²", "A", "1/K", "N·m"]
