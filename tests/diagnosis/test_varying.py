"""Friction that varies along the way is told, with its waves; constant friction and plain waves are not."""

from __future__ import annotations

import numpy as np
import pytest
from signlin_ros.diagnosis.varying import along_a_wave, varying
from signlin_ros.diagnosis.verdict import Diagnosis, diagnose

from signlin_ros.diagnosis.diagnosis_pictures import along_the_way
from signlin_ros.diagnosis.fit import candidate, fit
from signlin_ros.diagnosis.problem import prepare
from signlin_ros.errors import InputError
from signlin_ros.model import Model
from signlin_ros.records import ModelData

M, C, FORCE, STEP, FINE, COUNT = 2.0, 3.0, 12.0, 0.005, 10, 2400
WAVE = 0.25
"""Length of a wave, m."""
STAGE = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": M, "c": C, "k": 0.0}})


def slid(seed: int, viscous: float = 0.0, wave: float = 0.0, dry: float = 0.0, plain: float = 0.0) -> ModelData:
    """Return a record of a stage with ``viscous`` friction and a ``wave`` of it along the way, in N·s/m, with ``dry``
    friction of which all varies, and with a ``plain`` wave of force, in N; integrated with tiny steps.
    """
    rng, dt = np.random.default_rng(seed), STEP / FINE
    t = STEP * np.arange(COUNT)
    tones = 2 * np.pi * rng.uniform(0.1, 1.2, 6)
    u = FORCE / 3 * np.sin(tones * t[:, None] + rng.uniform(0, 6, 6)).sum(axis=1)
    shown, q, v = np.zeros((COUNT, 2)), 0.0, 0.0
    for k in range(COUNT):
        shown[k] = q, v
        for _ in range(FINE):
            phase = 2 * np.pi * q / WAVE + 1.0
            along = np.sin(phase)
            friction = (C + viscous + wave * along) * v + dry * (1.0 + along) * np.tanh(v / 2e-3)
            v += dt * (u[k] - friction - plain * np.sin(phase + 0.5)) / M
            q += dt * v
    shown += 0.01 * shown.std(axis=0) * rng.normal(size=shown.shape)
    measured, units = {"displacement": shown[:, 0], "velocity": shown[:, 1]}, {"displacement": "m", "force": "N"}
    return ModelData(t, u[:, None], measured, None, ("force",), ("displacement", "velocity"), units)


def told(**what: float) -> Diagnosis:
    return diagnose(STAGE, slid(1, **what), slid(2, **what))


def test_waves_of_viscous_friction_are_told():
    d = told(viscous=2.0, wave=2.0)
    assert d.verdict == "unexplained"
    assert "friction varies along the way" in d.sentence.lower()
    assert "a wave every 0.25 m" in d.sentence
    assert len(along_the_way(d).axes) == 1
    assert d.findings.along is not None
    assert d.findings.along.what == "viscous friction"
    assert d.findings.along.amplitude == pytest.approx(2.0, rel=0.25)
    assert d.findings.along.phase == pytest.approx(1.0, abs=0.4)


def test_each_part_of_a_wave_is_found():
    """The parts are found without the wave, and it is a sine."""
    problem = prepare(STAGE, [slid(1, wave=2.0)])
    f = fit(problem, candidate(problem, problem.base, ()), problem.levels[0], None, 12)
    assert f is not None
    found = varying(problem, f)
    assert found is not None
    place, size, error = along_a_wave(problem, f, found)
    true = 2.0 * np.sin(2 * np.pi * place + 1.0)
    assert np.mean(np.abs(size - true) < 4.0 * error) > 0.8
    assert np.corrcoef(size, true)[0, 1] > 0.95


def test_waves_of_dry_friction_are_told():
    problem = prepare(STAGE.with_effect("coulomb_friction", mu=1.5), [slid(3, dry=1.5)])
    f = fit(problem, candidate(problem, problem.base, ()), problem.levels[0], None, 12)
    assert f is not None
    found = varying(problem, f)
    assert found is not None
    assert found.what == "coulomb friction"
    assert 2 * np.pi / found.order == pytest.approx(WAVE, rel=0.01)
    assert found.amplitude == pytest.approx(1.5, rel=0.25)
    assert found.certainty > 6.0


@pytest.mark.parametrize("what", [{"viscous": 2.0}, {"plain": 2.0}])
def test_what_does_not_vary_with_the_position_is_named(what):
    d = told(**what)
    assert d.verdict == "missing"
    assert d.findings.along is None
    assert d.ladder[-1].effects == ({"viscous": "viscous_friction", "plain": "cogging_torque"}[next(iter(what))],)


def test_nothing_is_told_of_a_complete_model():
    d = told()
    assert d.verdict == "adequate"
    assert d.findings.along is None
    with pytest.raises(InputError, match="nothing was found to vary"):
        along_the_way(d)


def test_one_direction_does_not_tell_friction_from_force():
    """With the sign of the velocity always the same, dry friction that varies is a force that varies."""
    record = slid(4, plain=2.0)
    forward = ModelData(
        record.t,
        np.full_like(record.u, FORCE),
        {"displacement": np.cumsum(np.full(COUNT, STEP * 0.8)) + 1e-4 * record.measured["velocity"]},
        None,
        record.inputs,
        ("displacement",),
        dict(record.units),
    )
    problem = prepare(STAGE, [forward])
    f = fit(problem, candidate(problem, problem.base, ()), problem.levels[0], None, 4)
    assert f is not None
    found = varying(problem, f)
    assert found is None or found.what == "viscous friction" or found.certainty < 6.0
