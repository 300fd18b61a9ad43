"""An axis that is said to be linear has no angle: what goes with its place is no weight of an arm."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.machines.families import MACHINES
from signlin_ros.diagnosis import diagnose
from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
from signlin_ros.diagnosis.output_error import FitCache, estimator_of
from signlin_ros.fitting.prepare import held_out, prepared
from signlin_ros.follow.data import load_sides
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

AXIS = {"plant": "mass_spring_damper", "parameters": {"m": 6.0, "c": 310.0, "k": 0.0}, "tolerance": 0.15}
WAVE = {"A": 900.0, "N": 1.0, "phi": 0.2}
"""A force in N that goes with the sine of the place in m."""


def pushed(seed: int) -> ModelData:
    """Return a record of a mass that is pushed from place to place against that force."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, 8.0, 0.01)
    wanted = np.interp(t, np.arange(0.0, 8.75, 0.75), rng.uniform(0.05, 1.3, 12))
    u = (WAVE["A"] * np.sin(wanted + WAVE["phi"]) + 300.0 * np.gradient(wanted, t))[:, None]
    built = Model.from_dict({**AXIS, "effects": {"cogging_torque": WAVE}})
    q = simulate(built, t, u, x0=np.array([wanted[0], 0.0]), kind="exact").to_frame()["displacement"].to_numpy()
    seen = {"displacement": q + rng.normal(0.0, 1e-5, t.size)}
    return ModelData(t, u, seen, None, ("force",), ("displacement",), {"displacement": "m", "force": "N"})


@pytest.mark.parametrize(("said", "sought"), [({}, True), ({"axis": "linear"}, False)])
def test_a_weight_of_an_arm_is_sought_where_the_axis_may_turn(said, sought):
    given = Model.from_dict({**AXIS, **said})
    found = estimator_of(*prepared(given, *held_out([pushed(1)])), DEFAULT_CRITERIA, FitCache(), jobs=1)
    assert ("gravity_load" in found.candidates) is sought
    wave = found.fitted(["cogging_torque"], given.with_effect("cogging_torque", **WAVE))
    assert wave.model.value("cogging_torque.N") == pytest.approx(1.0, abs=0.02)
    assert any("gravity_load" in one.effects for one in found.simplified(wave)) is sought


@pytest.mark.long
def test_a_loop_that_cannot_be_gives_way_to_the_next_laws(tmp_path: Path) -> None:
    """By the force alone a loop takes away the most; fitted by simulation it gives energy, and no spring was named."""
    model, training, validation = MACHINES["spring_return"].write(tmp_path)
    found = diagnose(*load_sides(Model.load(model), [training], [validation]))
    assert found.verdict == "missing"
    assert set(found.ladder[-1].effects) == {"constant_load", "linear_stiffness"}
