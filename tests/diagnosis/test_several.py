"""Several plain effects at once: a lift with a weight, a cable that pulls and dry friction."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from signlin_ros.diagnosis.rank import applicable
from signlin_ros.diagnosis.search import prepared
from signlin_ros.diagnosis.several import best_sets
from signlin_ros.diagnosis.verdict import diagnose

from signlin_ros.diagnosis import search
from signlin_ros.diagnosis.data import Stretch
from signlin_ros.diagnosis.inverse import Efforts
from signlin_ros.model import Model
from signlin_ros.noise import Noise
from signlin_ros.records import ModelData
from signlin_ros.simulate import simulate
from tests.diagnosis.test_traps import proposed

STEP, FINE = 0.01, 20
TRUE = {"m": 20.0, "c": 300.0}
NOMINAL = Model.from_dict(
    {"plant": "mass_spring_damper", "parameters": {"m": 21.0, "c": 290.0, "k": 0.0}, "tolerance": 0.06}
)
WEIGHT, CABLE, FRICTION = -160.0, 200.0, 130.0


def lift(seed: int, friction: Callable[[float], float] = lambda v: FRICTION) -> ModelData:
    """Return force and height of a lift that moves between heights under a controller, with dry friction by speed.

    Small steps with the friction clipped at standstill.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(round(25.0 / STEP)) * STEP
    at = np.cumsum(rng.uniform(1.5, 4.0, 40))
    wanted = gaussian_filter1d(rng.uniform(0.02, 0.33, 40)[np.searchsorted(at, t)], 40)
    u, shown = np.empty_like(t), np.empty_like(t)
    q, v, h = wanted[0], 0.0, STEP / FINE
    for k in range(t.size):
        shown[k] = q + rng.normal(0.0, 2e-5)
        u[k] = 9000.0 * (wanted[k] - shown[k]) - 600.0 * v + 150.0
        for _ in range(FINE):
            slips = v + h * (u[k] - TRUE["c"] * v + WEIGHT - CABLE * q) / TRUE["m"]
            v = np.copysign(max(abs(slips) - h * friction(abs(v)) / TRUE["m"], 0.0), slips)
            q += h * v
    return ModelData(t, u[:, None], {"displacement": shown}, None, ("force",), ("displacement",), {})


def efforts(data: ModelData) -> Efforts:
    """Return the efforts of a record, with the noise that it has."""
    (stretch,), noise = prepared(NOMINAL, [data], [data])[0].segments, Noise(2e-5)
    found = Efforts.of(NOMINAL, [Stretch(stretch.t, stretch.u, stretch.y, "", 0, 0)], ("displacement",), [noise])
    assert found is not None
    return found


def test_sets_are_told_from_the_measured_force():
    problem, _ = prepared(NOMINAL, [lift(1)], [lift(2)])
    sets = [{t.effect: v for t, v in one} for one in best_sets(problem, applicable(problem)[0])]
    (found,) = (s for s in sets if set(s) == {"coulomb_friction", "constant_load", "linear_stiffness"})
    assert found["coulomb_friction"]["mu"] == pytest.approx(FRICTION, rel=0.05)
    assert found["constant_load"]["F0"] == pytest.approx(WEIGHT, rel=0.05)
    assert found["linear_stiffness"]["k"] == pytest.approx(CABLE, rel=0.25)


def test_no_sets_without_a_measured_force():
    """A voltage tells nothing of the torque."""
    motor = Model.load("dc_motor")
    t = np.arange(400) * 0.005
    voltage = np.sin(7.0 * t)[:, None]
    data = simulate(motor, t, voltage)
    speed = ModelData(t, voltage, {"speed": data.x[:, motor.states.index("speed")]}, None, ("voltage",), ("speed",), {})
    problem, _ = prepared(motor.without_effect("coulomb_friction"), [speed], [speed])
    assert best_sets(problem, applicable(problem)[0]) == []


def test_what_a_model_computes_is_linear_where_all_slides():
    found, dry = efforts(lift(3)), {mu: NOMINAL.with_effect("coulomb_friction", mu=mu) for mu in (0.0, 50.0, 100.0)}
    none, half, whole = (found.computed(model, True) for model in dry.values())
    np.testing.assert_allclose(whole - none, 2.0 * (half - none), atol=1e-6)
    none, half, whole = (found.computed(model) for model in dry.values())
    assert np.abs(whole - 2.0 * half + none).max() > 10.0
    moves = found.moving(NOMINAL)
    assert 0.2 < moves.mean() < 0.9


def test_three_plain_effects_are_not_taken_for_a_rich_one():
    """One after the other, hysteresis came first, and the rest was patched."""
    found = diagnose(NOMINAL, lift(5), lift(6))
    assert found.verdict == "missing"
    assert proposed(found) == {"coulomb_friction", "constant_load", "linear_stiffness"}
    assert found.parameters["coulomb_friction.mu"].value == pytest.approx(FRICTION, rel=0.01)
    assert found.parameters["constant_load.F0"].value == pytest.approx(WEIGHT, rel=0.01)
    assert found.parameters["linear_stiffness.k"].value == pytest.approx(CABLE, rel=0.03)


def test_three_plain_effects_do_not_stand_for_what_is_not_listed():
    found = diagnose(NOMINAL, *(lift(seed, lambda v: FRICTION * (1.0 + v**0.5)) for seed in (7, 8)))
    assert found.verdict == "unexplained"


def test_a_pair_shows_the_way_to_its_part(monkeypatch):
    problem, unseen = prepared(NOMINAL, [lift(1)], [lift(2)])
    with ThreadPoolExecutor(1) as run:
        sought = search._Search(problem, unseen, run, lambda what, done: None, 3, None)
    weight, friction = (replace(sought.base, effects=(n,)) for n in ("constant_load", "coulomb_friction"))
    singles = [replace(weight, evidence=-100.0), replace(friction, evidence=-90.0)]
    pair = replace(sought.base, effects=("constant_load", "coulomb_friction"), evidence=-500.0)
    parts = {"coulomb_friction": replace(weight, evidence=-400.0), "constant_load": replace(friction, evidence=-91.0)}
    monkeypatch.setattr(search, "without", lambda problem, r, effect: parts[effect])
    with ThreadPoolExecutor(1) as run:
        sought.executor = run
        found = sought._reached_by([pair], singles)
    assert found == [parts["coulomb_friction"]]
    assert singles == [parts["coulomb_friction"], replace(friction, evidence=-90.0)]
