"""How inputs act between their samples is found from the records, where the model leaves it to them."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from signlin_ros.cli import signlin
from signlin_ros.diagnosis import add, diagnose
from signlin_ros.diagnosis.comparison import compare
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from tests.diagnosis.test_timing import BASE, record

DATA = Path(os.environ.get("SIGNLIN_DATA", "../shared/data"))
FINE, RATE, SAMPLES = 20, 200.0, 1200
DUFFING = {"m": 1.5, "c": 4.0, "k": 600.0, "k3": 4e4}


def duffing(seed: int, rms: float = 18.0, k2: float = 0.0) -> ModelData:
    """Return a record of an oscillator with a cubic spring (and a quadratic one, ``k2`` in N/m²) under a force whose
    spectrum ends at a fifth of the rate, sampled; between the samples the force is what its spectrum says. Integrated
    here, in steps of a twentieth.
    """
    rng = np.random.default_rng(seed)
    lines = np.zeros(SAMPLES // 2 + 1, dtype=complex)
    used = slice(12, SAMPLES // 5)
    lines[used] = np.exp(2j * np.pi * rng.uniform(size=lines[used].size))
    half = np.zeros(SAMPLES * FINE + 1, dtype=complex)  # two points for each step: the middle of it too
    half[: lines.size] = lines
    force = np.fft.irfft(half, 2 * SAMPLES * FINE)
    force *= rms / force.std()
    m, c, k, k3 = (DUFFING[n] for n in ("m", "c", "k", "k3"))
    h, q, v, states = 1.0 / (RATE * FINE), 0.0, 0.0, np.zeros((SAMPLES, 2))

    def slope(q: float, v: float, u: float) -> tuple[float, float]:
        return v, (u - c * v - k * q - k2 * q**2 - k3 * q**3) / m

    for i in range(SAMPLES * FINE):
        if i % FINE == 0:
            states[i // FINE] = q, v
        u0, u1, u2 = force[2 * i], force[2 * i + 1], force[(2 * i + 2) % force.size]
        a = slope(q, v, u0)
        b = slope(q + h / 2 * a[0], v + h / 2 * a[1], u1)
        d = slope(q + h / 2 * b[0], v + h / 2 * b[1], u1)
        e = slope(q + h * d[0], v + h * d[1], u2)
        q += h / 6 * (a[0] + 2 * b[0] + 2 * d[0] + e[0])
        v += h / 6 * (a[1] + 2 * b[1] + 2 * d[1] + e[1])
    shown = states[:, 0] + rng.normal(size=SAMPLES) * 0.01 * states[:, 0].std()
    t, u = np.arange(SAMPLES) / RATE, force[:: 2 * FINE, None].copy()
    units = {"force": "N", "displacement": "m"}
    return ModelData(t, u, {"displacement": shown}, None, ("force",), ("displacement", "velocity"), units)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_a_spring_that_stiffens_is_named_alone_under_a_sampled_force(seed: int) -> None:
    base = {"plant": "mass_spring_damper", "parameters": {"m": 1.55, "c": 4.2, "k": 580.0}, "update_period": 0.1}
    found = diagnose(Model.from_dict(base), duffing(seed), duffing(seed + 100))
    assert found.ladder[-1].effects == ("cubic_stiffness",)
    assert found.verdict == "missing"
    assert found.model.input_hold in ("centred", "linear")
    assert sum("input_hold" in note for note in found.notes) == 1
    k3 = found.parameters["cubic_stiffness.k3"]
    assert k3.value == pytest.approx(DUFFING["k3"], rel=0.05)


@pytest.mark.slow
def test_a_spring_that_stiffens_one_way_more_is_no_load_beside_a_wrong_zero() -> None:
    """A cubic spring about another place is a cubic one with a load, seen by a sensor with an offset."""
    base = {"plant": "mass_spring_damper", "parameters": {"m": 1.55, "c": 4.2, "k": 580.0}, "update_period": 0.1}
    found = diagnose(Model.from_dict(base), duffing(1, k2=1500.0), duffing(101, k2=1500.0))
    assert found.ladder[-1].effects == ("asymmetric_stiffness",)
    assert found.verdict == "missing"
    assert found.parameters["asymmetric_stiffness.k2"].value == pytest.approx(1500.0, rel=0.1)
    assert found.parameters["asymmetric_stiffness.k3"].value == pytest.approx(DUFFING["k3"], rel=0.05)


EACH_HOLD = [("forward", 3.0), ("centred", 0.0), ("centred", 3.0), ("backward", 3.0)]
THE_REST = [pytest.param(hold, 0.0, marks=pytest.mark.long) for hold in ("forward", "backward")]


@pytest.mark.parametrize(("hold", "mu"), [*EACH_HOLD, *THE_REST])
def test_the_records_show_how_their_inputs_act(hold: str, mu: float) -> None:
    """Without the file's word, as with it; sampled and interpolated can hardly be told apart without friction. An
    electronic Duffing circuit of others is explained with sampled inputs, and was "unexplained" without a word of it.
    """
    found = diagnose(Model.from_dict(BASE), record(1, hold, mu), record(2, hold, mu))
    assert found.ladder[-1].effects == (("coulomb_friction",) if mu else ())
    assert found.model.input_hold in (("centred", "linear") if hold == "centred" and not mu else (hold,))
    told = [note for note in found.notes if "input_hold" in note]
    assert len(told) == (0 if hold == "forward" else 1)
    assert all(f"input_hold: {found.model.input_hold}" in note for note in told)
    assert found.parameters["k"].value == pytest.approx(800.0, rel=0.003)


def test_every_verb_takes_what_the_records_show_and_the_file_holds_it() -> None:
    data, unseen, model = record(1, "backward", 3.0), record(2, "backward", 3.0), Model.from_dict(BASE)
    added = add("coulomb_friction", model, data, unseen)
    written = yaml.safe_load(added.yaml)["/**"]["ros__parameters"]
    assert written["input_hold"] == "backward"
    shown = compare(added.model, unseen)
    assert shown.channels["displacement"].windowed.rmse_over_noise < 1.5
    asked, held = (
        compare(model.with_options(input_hold=hold), data, validation=unseen) for hold in ("auto", "forward")
    )
    assert any("input_hold: backward" in note for note in asked.notes)
    assert not any("input_hold" in note for note in held.notes)
    assert (asked.model.input_hold, held.model.input_hold) == ("backward", "forward")


def test_what_the_file_says_of_its_inputs_is_not_asked_of_the_record() -> None:
    found = add("coulomb_friction", Model.from_dict({**BASE, "input_hold": "held"}), record(1, "backward", 3.0))
    assert found.model.input_hold == "forward"


@pytest.mark.slow
def test_the_hysteresis_benchmark_is_taken_as_sampled(tmp_path: Path) -> None:
    folder = DATA / "real/bouc_wen_benchmark"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there: set SIGNLIN_DATA")
    model = Model.load(folder / "nominal.yaml")
    files = [str(folder / f"multisine_{part}.csv") for part in ("train", "test")]
    arguments = [
        "add",
        "bouc_wen_hysteresis",
        str(folder / "nominal.yaml"),
        files[0],
        "--validation",
        files[1],
        "--json",
    ]
    result = CliRunner().invoke(signlin, [*arguments, "-o", str(tmp_path / "new.yaml")], catch_exceptions=False)
    found = json.loads(result.stdout)
    assert model.asks_hold
    assert found["ladder"][-1]["validation"]["displacement"]["rmse"] < 1.0e-5
    assert yaml.safe_load(found["model"])["/**"]["ros__parameters"]["input_hold"] in ("centred", "linear")


@pytest.mark.slow
@pytest.mark.skipif(not (DATA / "hidden_effects").is_dir(), reason=f"{DATA}/hidden_effects: set SIGNLIN_DATA")
def test_held_inputs_stay_held() -> None:
    """What a base lacks does not look like another hold; the other records of commands: test_hidden_effects."""
    from signlin_ros.diagnosis import load_records
    from signlin_ros.diagnosis.dataset import dataset_of
    from signlin_ros.diagnosis.evidence import refitted_evidence

    files = [str(DATA / "hidden_effects" / "motor_j" / f"{part}.csv") for part in ("estimation", "validation")]
    model, (known, unseen) = load_records(Model.load(DATA / "hidden_effects" / "motor_j" / "model.yaml"), files)
    assert refitted_evidence(dataset_of(model, known, unseen)).dataset.model.input_hold == "auto"
