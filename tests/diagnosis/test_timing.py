"""When a recorded input acts: held, sampled, or logged beside the state that it led to; integrated here.

The model file says so (`input_hold`); a diagnosis believes it.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from benchmarks.machines.families import MACHINES
from signlin_ros.diagnosis import add, diagnose
from signlin_ros.diagnosis.comparison import compare
from signlin_ros.diagnosis.output_error import OutputErrorEstimator
from signlin_ros.diagnosis.progress import CancelledError
from signlin_ros.follow.data import load_sides
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from tests.diagnosis.test_traps import SMALL, proposed, recorded

FINE, STEP = 40, 0.005
M, C, K = 2.0, 8.0, 800.0
BASE = {"plant": "mass_spring_damper", "parameters": {"m": 1.95, "c": 8.3, "k": 815.0}}


@cache
def record(seed: int, hold: str, mu: float = 0.0, seconds: float = 5.0) -> ModelData:
    rng = np.random.default_rng(seed)
    tones, phases = 2 * np.pi * rng.uniform(0.2, 8.0, 8), rng.uniform(0, 6, 8)
    count, dt = round(seconds / STEP), STEP / FINE

    def force(t: np.ndarray) -> np.ndarray:
        return 7.0 * np.sin(tones * t[:, None] + phases).sum(axis=1)

    t = np.arange(count) * STEP
    fine = np.arange(count * FINE) * dt + dt / 2
    shown = force(t)
    acting = {
        "forward": np.repeat(shown, FINE),
        "centred": force(fine),
        "backward": np.repeat(np.append(shown[1:], 0.0), FINE),
    }[hold]
    states, q, v, most = np.zeros((count, 2)), 0.0, 0.0, dt * mu / M
    for i, F in enumerate(acting.tolist()):
        if i % FINE == 0:
            states[i // FINE] = q, v
        before = v
        v += dt * (F - C * v - K * (q + dt * v / 2)) / M
        v -= max(-most, min(v, most))
        q += dt * (before + v) / 2
    states += rng.normal(size=states.shape) * 0.005 * states.std(axis=0)
    measured = {"displacement": states[:, 0], "velocity": states[:, 1]}
    units = {"force": "N", "displacement": "m", "velocity": "m/s"}
    return ModelData(t, shown[:, None], measured, None, ("force",), ("displacement", "velocity"), units)


@pytest.mark.parametrize("mu", [0.0, 3.0])
def test_a_file_that_says_when_its_input_acts_is_believed(mu):
    model = Model.from_dict({**BASE, "input_hold": "centred"})
    found = diagnose(model, record(1, "centred", mu), record(2, "centred", mu))
    assert found.verdict == ("missing" if mu else "adequate")
    assert found.ladder[-1].effects == (("coulomb_friction",) if mu else ())
    assert found.model.input_hold == "centred"
    assert found.parameters["k"].value == pytest.approx(K, rel=0.003)


@pytest.mark.parametrize(("acting", "said"), [("centred", "forward"), ("backward", "forward"), ("forward", "centred")])
def test_a_right_model_leaves_noise_only_where_its_input_acts_when_it_is_said_to(acting, said):
    true = Model.from_dict({**BASE, "parameters": {"m": M, "c": C, "k": K}})
    right, wrong = (
        compare(true.with_options(input_hold=hold), record(3, acting)).channels["displacement"].windowed
        for hold in (acting, said)
    )
    assert right.rmse_over_noise < 1.5
    assert wrong.rmse_over_noise > 2 * right.rmse_over_noise


def test_a_delay_is_not_biased_by_the_input_from_before_the_record(tmp_path):
    late = 0.019
    found = diagnose(*recorded(tmp_path, SMALL, {"input_delay": {"T": late}}, exc=("multisine", "multisine"), skip=300))
    assert proposed(found) == {"input_delay"}
    delay = next(e.parameters["T"] for e in found.ranking if e.effect == "input_delay")
    assert abs(delay.value - late) < 4 * delay.std
    assert found.parameters["L_a"].value == pytest.approx(SMALL.true["L_a"], rel=0.1)


def test_who_stops_a_diagnosis_stops_it_to_the_last(monkeypatch: pytest.MonkeyPatch) -> None:
    """What tries a model once more takes one that diverges for none, but not a wish to stop."""

    def stopped(self: OutputErrorEstimator, hold: str) -> OutputErrorEstimator:
        raise CancelledError("stopped")

    monkeypatch.setattr(OutputErrorEstimator, "acting", stopped)
    with pytest.raises(CancelledError):
        diagnose(Model.from_dict(BASE), record(1, "centred", 3.0), record(2, "centred", 3.0))


def test_a_stretch_shorter_than_the_horizon_has_no_window() -> None:
    """A live record with gaps: "arrays used as indices must be of integer (or boolean) type"."""
    model, whole = Model.from_dict({**BASE, "update_period": 1.0}), record(1, "forward", 3.0)
    known = [whole.part(0, 800), whole.part(850, 960)]
    found = diagnose(model, known, record(2, "forward", 3.0))
    assert found.ladder[-1].effects == ("coulomb_friction",)


def test_a_late_sensor_is_tried_where_a_stretch_has_no_window() -> None:
    model, whole = Model.from_dict({**BASE, "update_period": 1.0}), record(1, "forward", 3.0)
    found = add("sensor_delay", model, [whole.part(0, 800), whole.part(850, 960)], record(2, "forward", 3.0))
    assert any(name.startswith("sensor_delay") for name in found.ladder[-1].effects)


@pytest.mark.long
def test_a_late_bus_is_told_near_the_steps_of_an_encoder(tmp_path):
    """What is left is a thousandth of what the position erred by, near its noise, and goes on from step to step."""
    model, training, validation = MACHINES["late_bus"].write(tmp_path)
    found = diagnose(*load_sides(Model.load(model), [training], [validation]))
    assert found.verdict == "missing"
    assert "input_delay" in found.ladder[-1].effects
    assert found.parameters["input_delay.T"].value == pytest.approx(0.018, rel=0.05)
