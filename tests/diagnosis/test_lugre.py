"""LuGre's friction beside the simpler laws of its family: six numbers, of which a record seldom tells all."""

from __future__ import annotations

import pytest

from benchmarks.hidden.generator import draw, write
from signlin_ros.diagnosis import diagnose
from signlin_ros.effects.lugre_friction import LuGreFriction
from tests.diagnosis.test_hidden_effects import records
from tests.diagnosis.test_traps import AXIS, proposed, recorded


def test_lugre_friction_is_found_from_dahls(tmp_path):
    own = {"sigma0": 1.5e4, "sigma1": 20.0, "sigma2": 5.0, "F_c": 12.0, "F_s": 20.0, "v_s": 0.02}
    found = diagnose(*recorded(tmp_path, AXIS, {"lugre_friction": own}, only=("displacement",), level=1e-3))
    assert proposed(found) == {"lugre_friction"}
    assert found.parameters["lugre_friction.F_c"].value == pytest.approx(12.0, rel=0.1)


@pytest.mark.parametrize("index", [25, 68])
def test_lugre_friction_is_named_where_its_stribeck_speed_is_hardly_known(tmp_path, index):
    """Bristles, their damping and their level leave nothing but noise; Dahl's law did not, and had its place, since a
    breakaway level and a speed of which one makes good the other are known to no better than half.
    """
    record = draw("weak", index, {25: 61, 68: 59}[index])
    assert record.truth["laws"] == ["lugre_friction"]
    found = diagnose(*records(write(record, tmp_path)))
    assert proposed(found) == {"lugre_friction"}
    level, true = found.parameters["lugre_friction.F_c"], record.truth["values"]["lugre_friction"]["F_c"]
    assert level.value == pytest.approx(true, rel=0.1)


def test_a_curve_that_rises_with_the_speed_is_gone_on_from_as_viscous_friction():
    rising = {"sigma0": 100.0, "sigma1": 0.1, "sigma2": 0.2, "F_c": 2.0, "F_s": 1.5, "v_s": 10.0}
    (found,) = LuGreFriction.nearby(rising)
    assert (found["sigma0"], found["sigma1"]) == (100.0, 0.1)
    assert found["F_s"] > found["F_c"] == rising["F_s"]
    assert found["F_c"] + found["sigma2"] * 10.0 == pytest.approx(rising["F_c"] + rising["sigma2"] * 10.0)
    assert LuGreFriction.nearby(found) == []
