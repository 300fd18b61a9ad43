"""Servos in closed loop: their motion is small and smooth, and rich laws imitate several simple ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from signlin_ros.diagnosis import diagnose
from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
from signlin_ros.diagnosis.dataset import dataset_of
from signlin_ros.diagnosis.evidence import evidence_of
from signlin_ros.diagnosis.output_error import FitCache
from signlin_ros.diagnosis.progress import Progress
from signlin_ros.diagnosis.results import Diagnosis
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from tests.diagnosis.test_traps import proposed

STEP, FINE = 0.005, 50
ARM = {"R_a": 3.93, "L_a": 0.0, "K_t": 0.62, "K_m": 0.573, "B": 0.0103, "J": 0.00393}
UNSURE = "two effects of a servo in closed loop are unexplained rather than named; 50 s of processor time each"
NOMINAL = {"R_a": 4.0, "L_a": 0.0, "K_t": 0.6, "K_m": 0.6, "B": 0.01, "J": 0.004}


def steps(rng: np.random.Generator, t: np.ndarray) -> np.ndarray:
    """Return angles that are held for a while each, one after the other."""
    at = np.cumsum(rng.uniform(0.25, 0.8, 200))
    return rng.uniform(-1.2, 1.2, at.size)[np.searchsorted(at, t)]


def sines(rng: np.random.Generator, t: np.ndarray) -> np.ndarray:
    """Return angles that swing slowly."""
    tones, phases = 2 * np.pi * np.array([0.5, 1.7]) * rng.uniform(0.9, 1.1, 2), rng.uniform(0, 6, 2)
    return (np.array([0.7, 0.35]) * np.sin(tones * t[:, None] + phases)).sum(axis=1)


def arm(seed: int, wanted: Callable, friction: Callable[[float], float], load: Callable[[float], float]) -> ModelData:
    """Return voltage and position of a servo that moves an arm, with dry friction by speed and a load by position, N·m.

    Small steps with the friction clipped at standstill.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(round(20.0 / STEP)) * STEP
    angles, u, shown = wanted(rng, t), np.empty_like(t), np.empty_like(t)
    q, v, h = 0.0, 0.0, STEP / FINE
    for k in range(t.size):
        shown[k] = q + rng.normal(0.0, 0.002)
        u[k] = np.clip(25.0 * (angles[k] - shown[k]) - 0.5 * v, -9.0, 9.0)
        for _ in range(FINE):
            torque = ARM["K_t"] / ARM["R_a"] * (u[k] - ARM["K_m"] * v) - ARM["B"] * v + load(q)
            slips, stops = v + h * torque / ARM["J"], h * friction(abs(v)) / ARM["J"]
            v = np.copysign(max(abs(slips) - stops, 0.0), slips)
            q += h * v
    recorded = u + rng.normal(0.0, 0.01, u.size)
    units = {"position": "rad", "voltage": "V"}
    return ModelData(t, recorded[:, None], {"position": shown}, None, ("voltage",), ("position",), units)


def diagnosed(seed: int, friction: Callable[[float], float], load: Callable[[float], float]) -> Diagnosis:
    """Return the diagnosis on steps, validated on sines."""
    model = Model.from_dict({"plant": "dc_motor", "parameters": NOMINAL, "tolerance": 0.06})
    return diagnose(model, *(arm(seed, wanted, friction, load) for wanted in (steps, sines)))


@pytest.mark.long
def test_one_rich_law_is_not_named_for_two_simple_ones():
    found = diagnosed(1, lambda v: 0.06, lambda q: -0.16 * np.sin(q))
    assert found.verdict == "missing"
    assert "coulomb_friction" in proposed(found)
    assert len(proposed(found)) == 2
    other = next(e for e in found.missing if e.effect != "coulomb_friction")
    assert "gravity_load" in (other.effect, *other.indistinguishable_from)


@pytest.mark.limit(UNSURE)
def test_cogging_is_sought_in_what_gravity_leaves():
    found = diagnosed(1, lambda v: 0.0, lambda q: -0.16 * np.sin(q) - 0.05 * np.sin(12 * q + 0.4))
    assert found.verdict == "missing"
    assert proposed(found) == {"gravity_load", "cogging_torque"}
    assert found.parameters["cogging_torque.N"].value == pytest.approx(12.0, abs=0.1)


def joint(seed: int) -> ModelData:
    """Return torque and position of a joint that follows slowly in a loop: a weight, friction, and a load in time."""
    rng, step, fine = np.random.default_rng(seed), 0.01, 10
    t, h = np.arange(3000) * step, step / fine
    tones, phases = 2 * np.pi * rng.uniform(0.03, 0.2, 4), rng.uniform(0, 6, 4)
    sizes, slow = rng.uniform(0.15, 0.35, 4), 2 * np.pi * rng.uniform(0.3, 0.8, 2)
    at = t[:, None] + h * np.arange(fine)
    angles = (sizes * np.sin(tones * at[..., None] + phases)).sum(axis=-1)
    loads = 0.25 * np.sin(slow[0] * at) * np.sign(np.sin(slow[1] * at))
    q, v, torque, shown = angles[0, 0], 0.0, np.empty_like(t), np.empty_like(t)
    for k in range(t.size):
        shown[k] = q
        for i in range(fine):
            weight = 1.6 * np.sin(q + 1.2)
            u = 60.0 * (angles[k, i] - q) - 6.0 * v + weight
            torque[k] = u if i == 0 else torque[k]
            v += h * (u - 2.7 * v - weight - 0.35 * np.tanh(v / 0.01) - loads[k, i]) / 0.25
            q += h * v
    measured = {"displacement": shown + rng.normal(0.0, 5e-5, t.size)}
    units = {"displacement": "rad", "force": "N·m"}
    return ModelData(t, torque[:, None], measured, None, ("force",), ("displacement", "velocity"), units)


GUESS = {
    "plant": "mass_spring_damper",
    "parameters": {"m": 1.0, "c": 1.5, "k": 0.0},
    "tolerance": {"m": 1.0, "c": 1.0},
    "axis": "rotary",
    "update_period": 0.02,
}


def test_a_base_that_the_forces_contradict_is_held_at_what_they_tell():
    """What moves slowly in a loop is followed best with an inertia so large that forces hardly act."""
    dataset = dataset_of(Model.from_dict(GUESS), joint(3), joint(4))
    found = evidence_of(dataset, DEFAULT_CRITERIA, FitCache(), Progress(), 1)
    held = found.grounded()
    assert held.contradicted is found.base
    assert 0.1 < held.base.model.value("m") < 0.1 * found.base.model.value("m")  # 0.25 is right
    first, last = (one.percent_of_effort(one.force_mse_as_written(one.base)) for one in (found, held))
    assert last < 100.0 < first
    assert "gravity_load" in held.equation_error.effects


@pytest.mark.long
def test_a_base_that_the_forces_contradict_is_no_reference():
    """The weight is named, as a part: friction and a load in time are there, too, and the residual goes with both."""
    found = diagnose(Model.from_dict(GUESS), joint(3), joint(4))
    assert (found.verdict, proposed(found)) == ("unexplained", {"gravity_load"})
    assert found.sentence.startswith("Gravity load explains a part")
    assert found.parameters["gravity_load.A"].value == pytest.approx(1.6, rel=0.1)
    assert found.parameters["m"].note == "held"
    assert any("the forces contradict" in note for note in found.notes)
    base, final = found.ladder[0], found.ladder[-1]
    assert final.validation.over_noise < 0.5 * base.validation.over_noise
    assert final.force < 20.0 < 60.0 < base.force
