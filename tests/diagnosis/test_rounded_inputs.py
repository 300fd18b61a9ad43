"""A torque that a drive logs in steps of a thousandth of its rating: that is a noise which the motion gathers."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.diagnosis import diagnose
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from tests.drawn_tones import as_data, drawn_tones, noisy_states

STEP, NOISE = 0.0027, (2e-4, 4e-3)
AXIS = Model.from_yaml(
    "/**: {ros__parameters: {plant: mass_spring_damper, parameters: {m: 0.05, c: 0.08, k: 0.0}, "
    "tolerance: {m: 0.2, c: 0.5}}}",
    "axis",
)


def logged(seed: int, drag: float = 0.0) -> ModelData:
    """Return 6 s of an axis with Coulomb friction, and a drag of ``drag`` v|v|; the force is rounded."""
    random, t = np.random.default_rng(seed), np.arange(1500) * 0.004
    force = drawn_tones(random, t, count=9, band=(0.3, 6.0), fall=0.3, deviation=0.6)
    machine = AXIS.with_effect("coulomb_friction", mu=0.25)
    if drag:
        machine = machine.with_effect("quadratic_drag", c2=drag)
    return as_data(AXIS, t, np.round(force / STEP) * STEP, noisy_states(random, machine, t, force, NOISE))


def test_a_right_law_is_named_where_the_input_is_rounded():
    """The displacement erred by 1.4 times its noise, with structure: the right law "explained a part"."""
    found = diagnose(AXIS, logged(1), validation=logged(2))
    assert found.verdict == "missing"
    assert [one.effect for one in found.ranking if one.status == "confirmed"] == ["coulomb_friction"]
    assert found.model.effects["coulomb_friction"].parameters["mu"] == pytest.approx(0.25, rel=0.01)


def test_rounding_covers_no_law_beside_it():
    found = diagnose(AXIS, logged(1, drag=4e-3), validation=logged(2, drag=4e-3))
    confirmed = {one.effect for one in found.ranking if one.status == "confirmed"}
    assert confirmed == {"coulomb_friction", "quadratic_drag"}
