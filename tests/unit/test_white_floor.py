"""White noise on measured inputs, told from what a command is."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.fitting.prepare import prepared
from signlin_ros.model import Model
from signlin_ros.noise import white_floor
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

RNG = np.random.default_rng(3)
T = np.arange(4000) * 0.004
TONES = np.exp(RNG.uniform(np.log(0.1), np.log(8.0), 12))
SMOOTH = np.sin(2 * np.pi * np.outer(T, TONES) + RNG.uniform(0.0, 6.0, 12)).sum(axis=1)
STEPS = np.repeat(RNG.normal(size=400), 10)


@pytest.mark.parametrize("share", [0.005, 0.02, 0.1])
@pytest.mark.parametrize("signal", [SMOOTH, np.repeat(np.sign(RNG.normal(size=20)), 200)], ids=["smooth", "levels"])
def test_the_noise_of_a_measured_input_is_found(signal, share):
    noisy = signal + share * signal.std() * RNG.normal(size=signal.size)
    assert white_floor(noisy) == pytest.approx(share * signal.std(), rel=0.1)


@pytest.mark.parametrize(
    "command",
    [
        SMOOTH,
        STEPS,
        np.sign(RNG.normal(size=4000)),
        RNG.normal(size=4000),
        np.repeat(SMOOTH[::10], 10),
        np.sin(2 * np.pi * (0.5 * T + 3.0 * T**2)),
        np.convolve(RNG.normal(size=4004), np.ones(5) / 5, "valid"),
        np.zeros(4000),
        SMOOTH[:100],
    ],
    ids=["tones", "steps", "bits", "white", "held", "chirp", "band", "nothing", "short"],
)
def test_a_command_has_no_noise(command):
    assert white_floor(command) < 1e-3 * max(float(command.std()), 1e-12)


@pytest.mark.parametrize(("share", "counts"), [(1e-9, False), (0.02, True)], ids=["digits of a file", "a sensor"])
def test_noise_that_the_slowest_observer_allows_for_needs_no_other_one(share, counts):
    model = Model.load("mass_spring_damper").without_effect("coulomb_friction")
    force = SMOOTH + share * SMOOTH.std() * RNG.normal(size=SMOOTH.size)
    shown = simulate(model, T, SMOOTH[:, None])["displacement"]
    measured = {"displacement": shown + 1e-3 * shown.std() * RNG.normal(size=T.size)}
    data = ModelData(T, force[:, None], measured, None, model.inputs, model.states, model.units)
    problem, _ = prepared(model, [data], [data])
    assert bool(problem.input_noise.any()) is counts
    assert len(problem.observer_gains) == 4 + counts
