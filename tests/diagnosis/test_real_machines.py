"""Measured machines: a ball-screw axis, a servo that swings a pendulum, a damper on a shaking table."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from signlin_ros.api import compare as compared
from signlin_ros.comparison.equations import bare
from signlin_ros.diagnosis import diagnose
from signlin_ros.diagnosis.comparison import compare
from signlin_ros.diagnosis.results import Diagnosis
from signlin_ros.follow.data import load_records
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from tests.diagnosis.test_traps import proposed
from tests.notebooks import cells_run

DATA = Path(os.environ.get("SIGNLIN_DATA", "../shared/data"))
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"no measurement records at {DATA} (set SIGNLIN_DATA)")
DAMPER = {
    "plant": "force_element",
    "parameters": {"c": 800.0, "k": 0.0},
    "tolerance": 0.5,
    "effects": {"sensor_offset": {"force": 132.0}},
    "signals": {"velocity": "v [mm/s]", "force": "F [N]"},
}


def diagnosed(model: Model, folder: str, names: Sequence[str], unseen: str) -> tuple[Diagnosis, ModelData]:
    """Return the diagnosis on some records, validated on another one, and that one."""
    _, data = load_records(model, [str(DATA / folder / f"{name}.csv") for name in (*names, unseen)])
    return diagnose(model, data[:-1], data[-1:]), data[-1]


def falls(found: Diagnosis, channel: str) -> float:
    """Return the error on validation data with what is proposed, over that of the model as it was."""
    return found.ladder[-1].validation.channels[channel].rmse / found.ladder[0].validation.channels[channel].rmse


def over(model: Model, unseen: ModelData, horizon: float) -> float:
    """Return the error of the displacement predicted over windows of a horizon (s)."""
    windowed = compare(model, unseen, horizon=horizon).channels["displacement"].windowed
    assert windowed is not None
    return windowed.rmse


def right_of_the_axis(found: Diagnosis, inverse_error: float) -> None:
    """Published: Coulomb friction of 20.39 N; 5.98 % of the force are left on the record with pulses."""
    status = {e.effect: e.status for e in found.ranking}
    assert [r.effects for r in found.ladder[1:]] == [
        ("coulomb_friction",),
        ("coulomb_friction", "asymmetric_viscous_friction"),
    ]
    assert {status[n] for n in ("stribeck_friction", "dahl_presliding", "lugre_friction")} == {"rejected"}
    assert found.parameters["coulomb_friction.mu"].value == pytest.approx(20.39, rel=0.1)
    assert falls(found, "displacement") < 0.5
    assert inverse_error < 1.1 * 5.98


@pytest.mark.xdist_group("motor_notebook")  # its cells are run once
def test_a_ball_screw_axis_without_its_friction_at_200_hz():
    """The last cell of the notebook is this diagnosis, of tables."""
    space = cells_run("motor")
    found = space["measured"]
    right_of_the_axis(found, compared(found.model, space["unseen"]).inverse["force"].relative_error_percent)


@pytest.mark.long
def test_a_ball_screw_axis_without_its_friction():
    names = [str(DATA / "emps" / f"DATA_EMPS{name}.csv") for name in ("", "_PULSES")]
    model, (known, unseen) = load_records(bare(Model.load("emps")), names)
    found = diagnose(model, [known], [unseen])
    right_of_the_axis(found, compare(found.model, unseen).inverse["force"].relative_error_percent)


@pytest.mark.long
def test_a_ball_screw_axis_whose_nominal_values_were_fitted_without_its_friction():
    """Dry friction makes the viscous one twice as large: 415 for 203.5 N s/m."""
    names = [str(DATA / "emps" / f"DATA_EMPS{name}.csv") for name in ("", "_PULSES")]
    model, data = load_records(bare(Model.load("emps")), names)
    known, unseen = (
        replace(d, t=d.t[::4], u=d.u[::4], measured={n: x[::4] for n, x in d.measured.items()}) for d in data
    )
    found = diagnose(model.with_parameters({"m": 100.1, "c": 414.7}), [known], [unseen])
    assert found.ladder[-1].effects[0] == "coulomb_friction"
    assert found.parameters["coulomb_friction.mu"].value == pytest.approx(20.39, rel=0.05)
    assert found.parameters["c"].value == pytest.approx(203.5, rel=0.05)
    assert any("known to 50 %" in note for note in found.notes)
    assert found.model.tolerance == model.tolerance


@pytest.mark.limit("nothing is named; 47 s")
def test_a_servo_whose_friction_grows_with_its_load():
    """Published: with load-dependent friction the error falls to about half of what Coulomb friction alone leaves."""
    names = [f"xl330_kp100_{motion}" for motion in ("lift_and_drop", "sin_sin", "sin_time_square", "up_and_down")]
    found, _ = diagnosed(Model.load("xl330"), "xl330", names[:3], names[3])
    assert proposed(found) == {"load_dependent_friction"}
    assert falls(found, "displacement") < 0.5


@pytest.mark.limit("a cubic spring beside LuGre friction; 30 s")
def test_a_magneto_rheological_damper_remembers():
    """Published: Dahl's friction; Coulomb friction leaves half as much again."""
    names = [f"ensaio{number}.1_0V" for number in (1, 4, 7, 10)]
    found, _ = diagnosed(Model.from_dict(DAMPER), "mr_damper", names[:3], names[3])
    assert len(proposed(found)) == 1
    assert proposed(found) <= {"dahl_presliding", "bouc_wen_hysteresis", "lugre_friction"}
    assert falls(found, "force") < 0.5


@pytest.mark.parametrize(("known", "unseen"), [((1,), 4)])
def test_a_damper_remembers_whatever_record_it_was_fitted_to(known, unseen):
    """The zero of its force sensor is not known, and LuGre friction fits best that breaks away at less than it slides
    at: what is possible must not be crowded out by that.
    """
    model = Model.from_dict({**DAMPER, "effects": {}, "update_period": 0.02})
    names = [f"ensaio{number}.1_0V" for number in known]
    found, _ = diagnosed(model, "mr_damper", names, f"ensaio{unseen}.1_0V")
    assert proposed(found) & {"constant_load", "sensor_offset"}
    assert proposed(found) & {"dahl_presliding", "bouc_wen_hysteresis", "lugre_friction"}
    assert not proposed(found) & {"gravity_load", "stribeck_friction"}
    assert falls(found, "force") < 0.2


@pytest.mark.long
@pytest.mark.parametrize("motion", ["up_and_down", "sin_time_square"])
def test_a_servo_that_holds_its_weight_shows_no_cogging(motion):
    """It rests where a fine wave of any order has its valleys; such a wave was "99.9 % explained"."""
    found, _ = diagnosed(Model.load("xl330"), "xl330", [f"xl330_kp100_{motion}"], f"xl330_kp400_{motion}")
    assert "cogging_torque" not in found.ladder[-1].effects
    assert found.verdict == "unexplained"


def test_a_servo_is_judged_by_what_explains_other_motions_too():
    """At the higher gain, friction that only holds at rest fits the known motions best, and another one not at all."""
    names = [f"xl330_kp400_{motion}" for motion in ("lift_and_drop", "sin_time_square", "sin_sin", "up_and_down")]
    found, unseen = diagnosed(Model.load("xl330"), "xl330", names[:3], names[3])
    assert found.ladder[-1].effects == ("load_dependent_friction",)
    before, after = (over(m, unseen, 0.2) for m in (found.findings.refitted, found.model))
    assert after < 0.7 * before
