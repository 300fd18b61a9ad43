"""Limits, scales and wild samples that are told by the columns of a log, or by the size of a factor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from signlin_ros.checks import check
from signlin_ros.checks.base import with_channel
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.records.notes import Note
from signlin_ros.simulation import simulate

Array = NDArray[np.float64]
STEP, SAMPLES = 0.005, 2000
MOTOR = Model.load("dc_motor").without_effect("coulomb_friction")
GUESSED = Model.from_dict(
    {
        "plant": "mass_spring_damper",
        "axis": "rotary",
        "parameters": {"m": 0.05, "c": 0.08, "k": 0.0},
        "tolerance": {"m": 0.2, "c": 0.5},
    }
)


def record(model: Model, u: Array, seed: int = 1) -> ModelData:
    """Return what a model does, with noise of a thousandth."""
    t = np.arange(u.size) * STEP
    x = simulate(model, t, u[:, None]).x
    noise = 1e-3 * x.std(axis=0) * np.random.default_rng(seed).normal(size=x.shape)
    measured = dict(zip(model.states, (x + noise).T, strict=True))
    return ModelData(t, u[:, None], measured, None, model.inputs, model.states, dict(model.units), "run.csv")


def steps(size: float, seed: int) -> Array:
    return np.repeat(np.random.default_rng(seed).uniform(-size, size, SAMPLES // 80), 80)


def waves() -> Array:
    t = np.arange(SAMPLES) * STEP
    return 0.5 * np.sin(2.1 * t) + 0.4 * np.sin(5.3 * t + 1.0) + 0.3 * np.sin(11.0 * t + 2.0)


def test_a_limit_holds_for_both_signs_and_for_all_records_of_the_same_columns() -> None:
    records = [record(MOTOR, 12.0 * waves(), 3), record(MOTOR, steps(9.0, 4), 4)]
    cut = [with_channel(r, "current", np.clip(r.measured["current"], -2.5, 2.5)) for r in records]
    after, findings = check(MOTOR, cut, ["blank_current"])
    assert [f.check for f in findings if f.channel == "current"] == ["clipped", "clipped"]
    for before, one in zip(cut, after, strict=True):
        values = before.measured["current"]
        inside = np.abs(values) < 2.5
        lone = ~inside & (np.roll(inside, 1) | np.roll(inside, -1))  # a run of one or two is none
        assert np.isnan(one.measured["current"][~inside & ~lone]).all()
        np.testing.assert_array_equal(one.measured["current"][inside], values[inside])


def test_wild_samples_of_a_current_are_left_out() -> None:
    data = record(MOTOR, 8.0 * waves())
    assert not [f for f in check(MOTOR, [data])[1] if f.check == "wild_samples"]
    at = np.random.default_rng(5).choice(np.arange(50, SAMPLES - 50, 4), 9, replace=False)
    current = data.measured["current"].copy()
    current[at] += 50.0
    (after,), findings = check(MOTOR, [with_channel(data, "current", current)])
    assert [f.channel for f in findings if f.check == "wild_samples"] == ["current"]
    assert sorted(np.flatnonzero(np.isnan(after.measured["current"]))) == sorted(at)


@pytest.mark.parametrize(("factor", "severity"), [(631.0, "refuse"), (5.0, "offer"), (0.02, "refuse")])
def test_a_factor_beyond_ten_is_no_guess_of_a_parameter(factor: float, severity: str) -> None:
    data = record(GUESSED, waves())
    data = replace(data, measured={"displacement": factor * data.measured["displacement"]})
    found = [f for f in check(GUESSED, [data])[1] if f.check == "unit_or_sign"]
    assert {(f.cure, f.severity) for f in found[:2]} == {("scale_force", severity), ("scale_displacement", severity)}


def test_a_stated_unit_is_not_doubted_beside_a_scale() -> None:
    """The force 1e5 too small: kN and cm would do as well, but the displacement is stated in mm."""
    data = record(GUESSED, waves())
    small = replace(
        data, u=1e-5 * data.u, notes=(Note("displacement is converted from mm", "converted", "displacement"),)
    )
    assert {f.cure for f in check(GUESSED, [small])[1] if f.check == "unit_or_sign"} == {"scale_force"}
