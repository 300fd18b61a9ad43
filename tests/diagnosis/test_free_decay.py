"""A machine that nothing drives: forces are known beside its inertia only."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from signlin_ros.diagnosis import diagnose
from signlin_ros.fitting.prepare import prepared
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

STEP, HIDDEN = 0.005, {"gravity_load.A": 0.35, "quadratic_drag.c2": 6e-4, "coulomb_friction.mu": 0.004}
PENDULUM = Model.from_dict(
    {
        "plant": "mass_spring_damper",
        "axis": "rotary",
        "parameters": {"m": 0.012, "c": 4e-4, "k": 0.0},
        "tolerance": {"m": 0.1, "c": 1.0},
    }
)


def decay(seed: int, angle: float) -> ModelData:
    """Return 20 s of a pendulum that is let go at an ``angle`` in rad: an encoder of 4096 steps, a rate gyro."""
    random, t, model = np.random.default_rng(seed), np.arange(4000) * STEP, PENDULUM
    for name, value in HIDDEN.items():
        effect, _, parameter = name.partition(".")
        model = model.with_effect(effect, **{parameter: value})
    x = simulate(model, t, np.zeros(t.size), [angle, 0.0]).x
    steps = 2 * np.pi / 4096
    measured = {"displacement": np.round(x[:, 0] / steps) * steps, "velocity": x[:, 1] + random.normal(0, 0.02, t.size)}
    return ModelData(t, np.zeros((t.size, 1)), measured, None, model.inputs, PENDULUM.states, dict(PENDULUM.units))


@pytest.mark.slow
def test_what_slows_a_pendulum_that_nothing_drives():
    """UNEXPLAINED, "110 % of the inertial force": the band of the forces was chosen beside an effort of nothing, and
    held none of them. Then the inertia ended three tolerances off, with all that is known beside it.
    """
    found = diagnose(PENDULUM, decay(7, 2.6), validation=decay(8, 2.1))
    assert found.verdict == "missing"
    assert {e.effect for e in found.missing} == {name.partition(".")[0] for name in HIDDEN}
    inertia = found.model.value("m")
    assert inertia == pytest.approx(PENDULUM.value("m"), rel=0.03)
    for name, value in HIDDEN.items():
        effect, _, parameter = name.partition(".")
        told = found.model.effects[effect].parameters[parameter]
        assert told / inertia == pytest.approx(value / PENDULUM.value("m"), rel=0.05)


def coasting(model: Model, seed: int, speed: float, seconds: float, resolution: float, noise: float) -> ModelData:
    """Return a record, at 10 Hz, of what coasts down from a speed in rad/s or m/s; its unit is ``resolution``."""
    random, t = np.random.default_rng(seed), np.arange(round(10 * seconds)) * 0.1
    v = simulate(model, t, np.zeros(t.size), [0.0, speed])["velocity"] + noise * random.normal(size=t.size)
    measured, names = {"velocity": np.round(v / resolution) * resolution}, (model.inputs, model.states)
    return ModelData(t, np.zeros((t.size, 1)), measured, None, *names, dict(model.units))


def test_a_motion_reverses_where_one_of_its_records_does():
    slide = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.1, "k": 0.0}})
    one_way = coasting(slide, 1, 3.0, 20.0, 0.01, 0.001)
    back = replace(one_way, measured={"velocity": np.sin(one_way.t)})
    for data, reverses in (([one_way], False), ([one_way, back], True)):
        assert prepared(slide, data, data)[0].reverses is reverses


def coast_down(parameters: dict[str, float], hidden: dict[str, float], speeds: tuple[float, float], **how: float):
    """Diagnose two coast-downs with hidden effects; return the names, and the diagnosis."""
    bare = Model.from_dict(
        {"plant": "mass_spring_damper", "parameters": parameters, "tolerance": {"m": 0.05, "c": 0.5}}
    )
    true = bare
    for name, value in hidden.items():
        effect, _, parameter = name.partition(".")
        true = true.with_effect(effect, **{parameter: value})
    found = diagnose(bare, *(coasting(true, i, v, **how) for i, v in enumerate(speeds)))
    return {one.effect for one in found.missing}, found


def test_a_flywheel_that_comes_to_rest_has_friction_and_no_load():
    """MISSING constant load, quadratic drag and *cogging*: while it turned one way forces could not tell a load from
    friction, and what had stopped was asked of the motion for the load alone.
    """
    hidden = {"coulomb_friction.mu": 0.35, "quadratic_drag.c2": 4e-5}
    how = {"seconds": 90.0, "resolution": 2 * np.pi / 60, "noise": 0.0}
    names, found = coast_down({"m": 0.18, "c": 2e-3, "k": 0.0}, hidden, (260.0, 190.0), **how)
    assert (found.verdict, names) == ("missing", {name.partition(".")[0] for name in hidden})
    assert {n: found.parameters[n].value for n in hidden} == pytest.approx(hidden, rel=0.03)


def test_a_vehicle_that_coasts_has_drag_and_rolls():
    """Dahl presliding, "explains a part": of five blocks of forces the first two said what all did."""
    hidden = {"coulomb_friction.mu": 165.0, "quadratic_drag.c2": 0.42}
    how = {"seconds": 60.0, "resolution": 0.01 / 3.6, "noise": 0.1 / 3.6}
    names, found = coast_down({"m": 1400.0, "c": 0.0, "k": 0.0}, hidden, (33.0, 27.0), **how)
    assert found.verdict == "missing"
    assert names in ({"constant_load", "quadratic_drag"}, {"coulomb_friction", "quadratic_drag"})
    assert found.parameters["quadratic_drag.c2"].value == pytest.approx(0.42, rel=0.03)
    (rest,) = (one for one in found.ranking if one.effect in names - {"quadratic_drag"})
    assert rest.status == "ambiguous"  # nobody saw it turn round
