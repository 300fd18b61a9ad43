"""When a recorded input acts: held, sampled, or logged beside the state that it led to; integrated here."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.diagnosis import diagnose
from signlin_ros.diagnosis.comparison import compare
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from tests.diagnosis.test_traps import SMALL, proposed, recorded

FINE, STEP = 40, 0.005
M, C, K = 2.0, 8.0, 800.0
BASE = {"plant": "mass_spring_damper", "parameters": {"m": 1.95, "c": 8.3, "k": 815.0}}


def record(seed: int, hold: str, mu: float = 0.0, seconds: float = 10.0) -> ModelData:
    rng = np.random.default_rng(seed)
    tones, phases = 2 * np.pi * rng.uniform(0.2, 8.0, 8), rng.uniform(0, 6, 8)
    count, dt = round(seconds / STEP), STEP / FINE

    def force(t: np.ndarray) -> np.ndarray:
        return 7.0 * np.sin(tones * t[:, None] + phases).sum(axis=1)

    t = np.arange(count) * STEP
    fine = np.arange(count * FINE) * dt + dt / 2
    shown = force(t)
    after = zip(shown, np.append(shown[1:], 0.0), strict=True)
    acting = {
        "forward": np.repeat(shown, FINE),
        "centred": force(fine),
        "backward": np.repeat(np.append(shown[1:], 0.0), FINE),
        "three quarters": np.concatenate([np.where(np.arange(FINE) < FINE / 4, *w) for w in after]).ravel(),
    }[hold]
    states, q, v = np.zeros((count, 2)), 0.0, 0.0
    for i, F in enumerate(acting):
        if i % FINE == 0:
            states[i // FINE] = q, v
        before = v
        v += dt * (F - C * v - K * (q + dt * v / 2)) / M
        v -= float(np.clip(v, -dt * mu / M, dt * mu / M))
        q += dt * (before + v) / 2
    states += rng.normal(size=states.shape) * 0.005 * states.std(axis=0)
    measured = {"displacement": states[:, 0], "velocity": states[:, 1]}
    units = {"force": "N", "displacement": "m", "velocity": "m/s"}
    return ModelData(t, shown[:, None], measured, None, ("force",), ("displacement", "velocity"), units)


@pytest.mark.parametrize(("hold", "mu"), [("forward", 3.0), ("centred", 0.0), ("centred", 3.0), ("backward", 3.0)])
def test_it_is_found_out(hold, mu):
    found = diagnose(Model.from_dict(BASE), record(1, hold, mu), record(2, hold, mu))
    assert found.verdict == ("missing" if mu else "adequate")
    named = {e.effect for e in found.ranking if e.status in ("confirmed", "ambiguous")}
    assert named <= {"coulomb_friction", "stribeck_friction"}
    assert ("coulomb_friction" in named) == bool(mu)
    assert (found.model.input_hold or "forward") == hold
    assert any("input_hold" in note for note in found.notes) == (hold != "forward")
    assert found.parameters["k"].value == pytest.approx(K, rel=0.003)


def test_a_loop_that_is_faster_than_its_log_acts_anywhere_in_between():
    found = diagnose(Model.from_dict(BASE), record(1, "three quarters", 3.0), record(2, "three quarters", 3.0))
    assert found.verdict == "missing"
    assert found.ladder[-1].effects in (("coulomb_friction",), ("stribeck_friction",))
    assert found.model.input_hold == pytest.approx(0.75, abs=0.04)
    assert any("steps before its sample" in note for note in found.notes)
    again = Model.from_dict(found.model.to_dict())
    assert again.input_hold == found.model.input_hold


def test_what_was_found_holds_for_a_comparison():
    found = diagnose(Model.from_dict(BASE), record(1, "centred"), record(2, "centred"))
    model = found.model
    as_found = compare(model, record(3, "centred")).channels["displacement"].windowed
    as_held = compare(model.with_options(input_hold="forward"), record(3, "centred")).channels["displacement"].windowed
    assert as_found.rmse_over_noise < 1.5
    assert as_held.rmse_over_noise > 2 * as_found.rmse_over_noise


def test_a_file_that_says_when_its_input_acts_is_believed():
    model = Model.from_dict({**BASE, "input_hold": "forward"})
    found = diagnose(model, record(1, "centred"), record(2, "centred"))
    assert found.verdict != "adequate"
    assert not any("input_hold" in note for note in found.notes)


@pytest.mark.parametrize("skip", [0, 300], ids=["from rest", "in motion"])
def test_a_delay_is_not_biased_by_the_input_from_before_the_record(tmp_path, skip):
    late = 0.019
    found = diagnose(
        *recorded(tmp_path, SMALL, {"input_delay": {"T": late}}, exc=("multisine", "multisine"), skip=skip)
    )
    assert proposed(found) == {"input_delay"}
    delay = next(e.parameters["T"] for e in found.ranking if e.effect == "input_delay")
    assert abs(delay.value - late) < 4 * delay.std
    assert found.parameters["L_a"].value == pytest.approx(SMALL.true["L_a"], rel=0.1)
