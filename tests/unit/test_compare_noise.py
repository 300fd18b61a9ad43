"""Noise levels: white, coloured and quantised, with and without a model; and what is left in residuals."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from signlin_ros.comparison.residuals import residual_test
from signlin_ros.diagnosis.comparison import compare
from signlin_ros.follow.data import load_records
from signlin_ros.model import Model
from signlin_ros.noise import noise_level, quantum_of

pytestmark = pytest.mark.slow

DATA = Path(os.environ.get("SIGNLIN_DATA", "../shared/data")) / "hidden_effects"
real = pytest.mark.skipif(not DATA.is_dir(), reason=f"no measurement records at {DATA} (set SIGNLIN_DATA)")
T = np.arange(3200) / 200
SMOOTH = 3 * np.sin(2 * T) + np.cos(7 * T)


def ar1(rho, n=3200, seed=0):
    rng = np.random.default_rng(seed)
    return lfilter([np.sqrt(1 - rho**2)], [1, -rho], rng.standard_normal(n + 500))[500:]


@pytest.mark.parametrize("seed", range(3))
def test_white_noise_on_a_smooth_signal(seed):
    found = noise_level(T, SMOOTH + 0.05 * ar1(0.0, seed=seed))
    assert found.sigma == pytest.approx(0.05, rel=0.06)
    assert (found.rho, found.quantum, found.even) == (0.0, 0.0, True)


def test_steps_and_missing_samples_do_no_harm():
    y = SMOOTH + np.repeat(np.random.default_rng(1).uniform(-5, 5, 20), 160) + 0.05 * ar1(0.0)
    y[::9] = np.nan
    assert noise_level(T, y).sigma == pytest.approx(0.05, rel=0.1)


def test_uneven_samples_are_said():
    t = np.cumsum(np.random.default_rng(2).uniform(0.002, 0.008, 3200))
    found = noise_level(t, 3 * np.sin(2 * t) + 0.05 * ar1(0.0))
    assert found.sigma == pytest.approx(0.05, rel=0.06)
    assert not found.even


@pytest.mark.parametrize("rho", [0.5, 0.8, 0.9])
def test_coloured_noise_is_told_by_a_residual(rho):
    noise = 0.05 * ar1(rho)
    slow = 0.03 * np.sin(1.3 * T)  # what a model that is slightly wrong leaves
    found = noise_level(T, SMOOTH + noise, noise + slow)
    assert found.rho == pytest.approx(rho, abs=0.12)
    assert found.sigma == pytest.approx(0.05, rel=0.3)
    assert noise_level(T, SMOOTH + noise).sigma < 0.75 * 0.05  # without it the colour hides most of the noise


@pytest.mark.parametrize("seed", range(5))
def test_a_wrong_model_does_not_colour_white_noise(seed):
    noise = 0.05 * ar1(0.0, seed=seed)
    found = noise_level(T, SMOOTH + noise, noise + 0.4 * np.sin(9 * T) + 0.2 * np.sign(np.sin(5 * T)))
    assert found.rho == 0.0
    assert found.sigma == pytest.approx(0.05, rel=0.08)


@pytest.mark.parametrize("quantum", [0.002, 0.05])
def test_a_coarse_encoder(quantum):
    found = noise_level(T, np.round(SMOOTH / quantum) * quantum)
    assert found.quantum == pytest.approx(quantum)
    assert found.sigma == pytest.approx(quantum / np.sqrt(12), rel=0.15)


def test_the_digits_of_a_printed_number_are_no_encoder():
    printed = np.array([float(f"{v:.6g}") for v in SMOOTH + 0.05 * ar1(0.0)])
    assert quantum_of(printed) == 0.0


def test_too_few_samples_have_no_noise():
    assert noise_level(T[:5], SMOOTH[:5]).sigma == 0.0
    assert noise_level(T, np.ones(T.size)).sigma == 0.0


@real
@pytest.mark.parametrize("name", ["motor_a", "motor_c", "motor_i", "motor_j", "osc_b", "osc_e"])
def test_hidden_effects(name):
    """White within 7 %, coloured within 25 %, from a model that lacks an effect."""
    truth = next(r for r in json.loads((DATA / "truth.json").read_text()) if r["name"] == name)
    model = Model.load(DATA / name / "model.yaml").with_options(input_hold="forward")
    model, data = load_records(model, [str(DATA / name / "estimation.csv")])
    for channel, found in compare(model, data).channels.items():
        true = truth["noise_sigma"]["estimation"][channel]
        assert found.noise.sigma == pytest.approx(true, rel=0.25 if truth["kind"] == "coloured" else 0.07)
        assert (found.noise.rho > 0) == (truth["kind"] == "coloured")


# -------------------------------------------------------------------- residual tests


def inputs(kind, n=3200, seed=3):
    rng = np.random.default_rng(seed)
    made = {
        "white": lambda: rng.standard_normal(n),
        "slow": lambda: lfilter([1], [1, -0.98], rng.standard_normal(n)),
        "steps": lambda: np.repeat(rng.standard_normal(20), n // 20),
    }
    return made[kind]()[:, None]


@pytest.mark.parametrize("kind", ["white", "slow", "steps"])
def test_no_false_alarms(kind):
    found = [residual_test([ar1(0.0, seed=s)], [inputs(kind)]) for s in range(40)]
    assert sum(not f.white for f in found) <= 2
    assert sum(f.input_correlated for f in found) <= 2


def test_coloured_noise_is_no_structure_once_its_colour_is_known():
    assert not residual_test([ar1(0.8)], [inputs("white")]).white
    found = residual_test([ar1(0.8)], [inputs("white")], rho=0.8)
    assert found.white
    assert abs(found.lag1) < 0.05


@pytest.mark.parametrize("kind", ["white", "slow", "steps"])
def test_a_residual_that_follows_the_input(kind):
    u = inputs(kind)
    response = lfilter([0.05], [1, -0.95], u[:, 0])
    found = residual_test([ar1(0.0) * response.std() + response], [u])
    assert found.input_correlated
    assert not found.white


def test_a_long_record_does_not_make_a_trace_of_structure_significant():
    n = 200_000
    assert residual_test([ar1(0.005, n)], [inputs("white", n)]).white
    assert not residual_test([ar1(0.2, n)], [inputs("white", n)]).white
