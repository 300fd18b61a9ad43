"""Inputs have clocks of their own: one that switches between two states acts when it switched."""

import numpy as np
import pytest

from signlin_ros.diagnosis.comparison import compare
from signlin_ros.errors import InputError
from signlin_ros.follow.data import arriving
from signlin_ros.model import Model
from signlin_ros.records import ModelData, Record, Series, Signal
from signlin_ros.simulation import simulate

MOTOR = Model.load("dc_motor")
STEP, SIZE = 0.01, 400
T = np.arange(SIZE) * STEP


def driven(stamps: np.ndarray, volts: np.ndarray, noise: float = 0.0) -> tuple[np.ndarray, Record]:
    """States (T, n) of a motor whose command switches at `stamps`, and the record of both with their own stamps."""
    begin = np.searchsorted(stamps, 0.0, side="right") - 1
    every = np.unique(np.concatenate([T, stamps[stamps >= 0.0]]))
    held = volts[np.maximum(np.searchsorted(stamps, every, side="right") - 1, max(begin, 0))]
    x = simulate(MOTOR, every, held[:, None], rtol=1e-9).x[np.isin(every, T)]
    x = x + noise * np.random.default_rng(3).normal(size=x.shape)
    series = {"voltage": Series(stamps, volts, label="/voltage_cmd.data")}
    series |= {name: Series(T, x[:, i], label=f"/{name}.data") for i, name in enumerate(MOTOR.states)}
    signals = {name: Signal(np.zeros(SIZE), label=one.label) for name, one in series.items()}
    return x, Record(T, signals, "bag", series=series)


def square(stamps: np.ndarray) -> np.ndarray:
    rng = np.random.default_rng(7)
    return np.where(rng.random(stamps.size) < 0.5, -4.0, 4.0) + rng.normal(size=stamps.size)


CLOCKS = {
    "1 us before": T - 1e-6,
    "1 us after": np.concatenate([[-STEP], T + 1e-6]),
    "3 ms after": np.concatenate([[-STEP], T + 0.003]),
    "half a step": np.concatenate([[-STEP], T + 0.005]),
    "7 ms after": np.concatenate([[-STEP], T + 0.007]),
    "slower": np.arange(-1, 140) / 37.0,
    "jittered": np.concatenate([[-STEP], T + 0.003 + 0.0015 * np.sin(np.arange(SIZE))]),
}


@pytest.mark.parametrize("clock", CLOCKS)
def test_a_simulation_from_the_record_is_what_happened(clock: str) -> None:
    stamps = CLOCKS[clock]
    x, record = driven(stamps, square(stamps))
    data = record.for_model(MOTOR)
    found = simulate(MOTOR, data.t, data.u, data.x0, acts=data.acts, rtol=1e-9).x
    tail = x[SIZE - len(data) :]
    assert np.abs(found - tail).max() < 0.25  # what acted before the first row is known by its mean only
    settled = slice(SIZE // 2, None)
    np.testing.assert_allclose(found[settled], tail[settled], atol=5e-3 if clock.startswith("1 us") else 1e-3)


def test_commands_faster_than_the_states_act_by_their_mean() -> None:
    stamps = np.arange(-1, 5 * SIZE) * STEP / 5 + 1e-4
    x, record = driven(stamps, 4 * np.sin(20 * stamps))
    data = record.for_model(MOTOR)
    found = simulate(MOTOR, data.t, data.u, data.x0, acts=data.acts)
    assert np.abs(found.x - x[SIZE - len(data) :]).max() < 0.03 * np.abs(x).max()


@pytest.mark.slow
@pytest.mark.parametrize("clock", ["1 us after", "3 ms after", "slower", "jittered"])
def test_the_true_model_compares_at_the_noise(clock: str) -> None:
    stamps = CLOCKS[clock]
    _, record = driven(stamps, square(stamps), noise=0.02)
    found = compare(MOTOR, record.for_model(MOTOR))
    for channel in ("current", "speed"):
        assert found.channels[channel].free_run.rmse_over_noise < 1.15, channel
        assert found.channels[channel].windowed.rmse_over_noise < 1.25, channel


def test_what_arrives_between_samples_is_the_mean_of_what_acts() -> None:
    t, u = np.arange(4.0), np.array([[1.0], [2.0], [5.0], [7.0]])
    late = np.array([0.0, 0.25, -0.5, 0.0])
    np.testing.assert_allclose(arriving(t, u, late)[:, 0], [1.0, 0.25 * 1 + 0.25 * 2 + 0.5 * 5, 5.0])
    np.testing.assert_allclose(arriving(t, u, np.full(4, 0.3)), arriving(t, u, 0.3))


def test_parts_keep_their_clock() -> None:
    stamps = CLOCKS["3 ms after"]
    data = driven(stamps, square(stamps))[1].for_model(MOTOR)
    part = data.part(10, 20)
    assert isinstance(part, ModelData)
    assert part.acts is not None
    np.testing.assert_allclose(part.acts - part.t, 0.003, atol=1e-12)


def test_times_that_go_back_are_refused() -> None:
    with pytest.raises(InputError, match="acts"):
        simulate(MOTOR, T, np.zeros((SIZE, 1)), acts=-T)
