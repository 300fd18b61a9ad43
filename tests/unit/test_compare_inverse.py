"""The inverse model against what is published of EMPS, and against exact motions."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, decimate, filtfilt

from signlin_ros.diagnosis.comparison import compare, compare_efforts
from signlin_ros.follow.data import load_records
from signlin_ros.follow.tracking import driven
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

DATA = Path(os.environ.get("SIGNLIN_DATA", "../shared/data")) / "emps"
real = pytest.mark.skipif(not DATA.is_dir(), reason=f"no measurement records at {DATA} (set SIGNLIN_DATA)")
EMPS = Model.load("emps")
KNOWN = {"coulomb_friction": {"mu": 0.8}, "cubic_stiffness": {"k3": 200.0}}
STAMPED = (0.0, 0.5, 1.0)
"""Samples by which the force may act after its stamp: it is held, and when it was taken is known to half a sample."""
FILES = {"estimation": "DATA_EMPS.csv", "validation": "DATA_EMPS_PULSES.csv"}


def found(model, data, cutoff=None):
    efforts = compare_efforts(model, data, cutoff)
    return efforts and efforts.inverse(model, data[0].units)


def second(part, late=0.5):
    """Acceleration, velocity, its sign and the force, filtered and decimated, by a second program."""
    q, force, k = part.measured["displacement"], part.u[:, 0], np.arange(len(part))
    b, a = butter(4, 100 / 500)
    velocity = np.gradient(filtfilt(b, a, q), 1e-3)
    force = np.interp(k - late, k, force)  # held: what acts at a sample is the mean of before and after
    columns = np.column_stack([np.gradient(velocity, 1e-3), velocity, np.sign(velocity), force])
    return decimate(columns, 10, axis=0)[2:-2].T


def percent(left, force):
    return 100 * np.linalg.norm(left) / np.linalg.norm(force)


@real
@pytest.mark.parametrize(("part", "published"), [("estimation", 4.08), ("validation", 5.98)])
def test_emps_with_the_published_parameters(part, published):
    """Published 4.08 and 5.98 % with the force taken as it is stamped; it is held, and acts later."""
    _, data = load_records(EMPS, [str(DATA / FILES[part])])
    shares = []
    for late in STAMPED:
        acceleration, velocity, sign, force = second(data[0], late)
        left = 95.1089 * acceleration + 203.5034 * velocity + 20.3935 * sign - 3.1648 - force
        shares.append(percent(left, force))
    assert shares[0] == pytest.approx(published, rel=0.02)
    result = found(EMPS, data, 100.0)
    assert (result.name, result.unit, result.cutoff_hz) == ("force", "N", 100.0)
    assert result.relative_error_percent == pytest.approx(min(shares), rel=0.06)
    assert result.relative_error_percent < 1.01 * published
    assert found(EMPS, data).relative_error_percent == pytest.approx(result.relative_error_percent, rel=0.05)


@real
def test_emps_without_dry_friction():
    """Mass and viscous friction alone, fitted by least squares: 18.1 and 17.9 %, with the force as it is stamped."""
    records = [load_records(EMPS, [str(DATA / file)])[1][0] for file in FILES.values()]
    acceleration, velocity, _, force = second(records[0], late=0.0)
    m, c = np.linalg.lstsq(np.column_stack([acceleration, velocity]), force, rcond=None)[0]
    model = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": m, "c": c, "k": 0.0}})
    for record, stamped in zip(records, (18.1, 17.9), strict=True):
        shares = []
        for late in STAMPED:
            acceleration, velocity, _, force = second(record, late)
            shares.append(percent(m * acceleration + c * velocity - force, force))
        assert shares[0] == pytest.approx(stamped, rel=0.015)
        assert found(model, [record], 100.0).relative_error_percent == pytest.approx(min(shares), rel=0.015)


def quiet(model, t, u, x0=None, **noise):
    run = simulate(model, t, u, x0)
    rng = np.random.default_rng(0)
    measured = {n: run[n] + noise.get(n, 0.0) * rng.standard_normal(t.size) for n in model.states}
    return ModelData(t, u, measured, None, model.inputs, model.states, model.units)


def test_an_axis_that_stands_is_not_compared():
    """At standstill friction is set-valued, and takes any force: samples in motion are compared, or nothing."""
    t = np.arange(8000) / 1000
    force = 15.0 * np.sin(2 * np.pi * t)[:, None]  # below the breakaway level of 20.39 N
    model = EMPS.without_effect("constant_load")
    assert found(model, [quiet(model, t, force, displacement=1e-7)]) is None
    force[2000:] *= 4.0
    assert found(model, [quiet(model, t, force, displacement=1e-7)]).relative_error_percent < 5
    force[4000:] = 15.0 * np.sin(2 * np.pi * t[4000:])[:, None]
    assert found(model, [quiet(model, t, force, displacement=1e-7)]).relative_error_percent < 5


def test_a_lower_cut_off_lets_less_noise_through():
    model = Model.load("mass_spring_damper")
    t = np.arange(4000) / 200
    data = [quiet(model, t, 3 * np.sin(3 * t)[:, None], velocity=0.01, displacement=1e-3)]
    errors = [found(model, data, cutoff).relative_error_percent for cutoff in (3.0, 10.0, 30.0)]
    assert errors == sorted(errors)
    assert found(model, data).cutoff_hz < 20.0  # a tenth of the sampling rate would be noise


def test_a_motor_needs_its_current():
    motor = Model.load("dc_motor")
    t = np.arange(2000) / 200
    data = quiet(motor, t, 4 * np.sin(4 * t)[:, None], current=0.01, speed=0.05)
    result = found(motor, [data])
    assert (result.name, result.unit) == ("torque", "N·m")
    assert result.relative_error_percent < 6
    saturated = motor.with_effect("torque_constant_saturation", kappa=0.02)
    strong = quiet(saturated, t, 8 * np.sin(4 * t)[:, None], current=0.01, speed=0.05)
    assert found(saturated, [strong]).relative_error_percent < 0.5 * found(motor, [strong]).relative_error_percent
    blind = ModelData(data.t, data.u, {"speed": data.measured["speed"]}, None, data.inputs, data.states, data.units)
    assert found(motor, [blind]) is None


def test_an_effect_with_a_state_is_driven_by_the_measured_motion():
    plain = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.6, "k": 40.0}})
    model = plain.with_effect("dahl_presliding", F_c=2.0, sigma=400.0)
    t = np.arange(6000) / 500
    run = simulate(model, t, 6 * np.sin(2 * t)[:, None])
    measured = {n: run[n] for n in ("displacement", "velocity")}
    data = [ModelData(t, run.u, measured, None, model.inputs, model.states, model.units)]
    assert found(model, data).relative_error_percent < 3
    assert found(plain, data).relative_error_percent > 20


def test_a_stiff_bristle_is_carried_along_few_samples():
    """Its rate, sigma |v| / F_c, is 2500 in a sample: steps between two of them would leave all bounds."""
    model = (
        Model.load("dc_motor").without_effect("coulomb_friction").with_effect("dahl_presliding", F_c=0.03, sigma=12.0)
    )
    t = np.arange(200) * 0.045
    v = 20.0 * np.sin(2.0 * t)
    x = driven(model, t, np.zeros((t.size, 1)), {"current": np.sin(2.0 * t), "speed": v})
    z = x[:, list(model.states).index("dahl_presliding.z")]
    moving = np.abs(v) > 4.0
    np.testing.assert_allclose(12.0 * z[moving], 0.03 * np.sign(v[moving]), rtol=1e-3)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("effect", "lacking", "noise", "most"),
    [
        ("coulomb_friction", lambda q, v: -0.8 * np.sign(v), {"displacement": 1e-4, "velocity": 5e-3}, 0.18),
        ("coulomb_friction", lambda q, v: -0.8 * np.sign(v), {"displacement": 1e-5}, 0.13),
        ("cubic_stiffness", lambda q, v: -200.0 * q**3, {"displacement": 1e-5}, 0.026),
    ],
    ids=["dry, both sensors", "dry, position", "spring"],
)
def test_a_known_missing_force_is_found(effect, lacking, noise, most, seed):
    """Beside the true force, jumps and all, of which the low-pass takes a part away."""
    plain = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.6, "k": 40.0}})
    rng, t = np.random.default_rng(seed), np.arange(6000) / 500
    tones, phases = np.geomspace(0.2, 4.0, 12), rng.uniform(0.0, 2 * np.pi, 12)
    u = np.sin(2 * np.pi * tones * t[:, None] + phases).sum(axis=1)
    run = simulate(plain.with_effect(effect, **KNOWN[effect]), t, 4.0 * (u / u.std())[:, None])
    measured = {n: run[n] + size * rng.standard_normal(t.size) for n, size in noise.items()}
    data = [ModelData(t, run.u, measured, None, plain.inputs, plain.states, plain.units)]
    efforts = compare_efforts(plain, data)
    true = lacking(run["displacement"], run["velocity"])
    piece = efforts.pieces[0]
    apart = efforts.missing(plain) - true[:: round(piece.step * 500)][piece.kept]
    assert np.sqrt(np.mean(apart**2) / np.mean(true**2)) < most


def test_the_inverse_tells_the_missing_force_of_the_diagnosis():
    motor = Model.load("dc_motor")
    bare, t = motor.without_effect("coulomb_friction"), np.arange(4000) / 200
    tones, phases = np.geomspace(0.3, 5.0, 8), np.random.default_rng(4).uniform(0.0, 2 * np.pi, 8)
    known, unseen = (
        quiet(
            motor, t, (amplitude * np.sin(tones * t[:, None] + phases).sum(axis=1))[:, None], current=0.01, speed=0.05
        )
        for amplitude in (1.0, 1.2)
    )
    found = compare(bare, unseen)
    told = compare(bare, known, validation=unseen).first_rows.given.force
    assert found.inverse["torque"].relative_error_percent == pytest.approx(told, rel=0.03)
