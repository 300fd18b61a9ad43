"""Searches look at stretches of a record: what is right leaves nothing but noise there, as it does on the whole."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.fitting import prepare as prepare_module
from signlin_ros.fitting.candidate import candidate
from signlin_ros.fitting.fit import fit
from signlin_ros.fitting.problem import prepare
from signlin_ros.follow import segments
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

STEP, SAMPLES = 0.005, 4000


def record(model: Model, channels, u, level=0.01) -> ModelData:
    """Return a record of a model from rest, with white noise."""
    t = np.arange(u.size) * STEP
    x = simulate(model, t, u[:, None]).x
    rng, names = np.random.default_rng(3), model.states
    shown = {n: x[:, names.index(n)] for n in channels}
    noisy = {n: v + level * v.std() * rng.normal(size=v.size) for n, v in shown.items()}
    return ModelData(t, u[:, None], noisy, None, model.inputs, model.states, dict(model.units))


def motor(**effects) -> Model:
    model = Model.load("dc_motor").without_effect("coulomb_friction")
    for name, values in effects.items():
        model = model.with_effect(name, **values)
    return model


def bench(**effects) -> Model:
    model = Model.load("mass_spring_damper")
    for name in list(model.effects):
        model = model.without_effect(name)
    for name, values in effects.items():
        model = model.with_effect(name, **values)
    return model


def steps(size: float) -> np.ndarray:
    return np.repeat(size * np.random.default_rng(1).uniform(-1, 1, SAMPLES // 200), 200)


def slow(size: float) -> np.ndarray:
    return size * np.sin(2 * np.pi * 0.06 * np.arange(SAMPLES) * STEP)


LOOP = {"alpha": 0.4, "D": 0.08, "lambda": 1.0, "beta": 0.6, "gamma": 0.35, "n": 2.0}


@pytest.mark.parametrize(
    ("truth", "channels", "u"),
    [
        pytest.param(motor(input_delay={"T": 0.06}), ("current", "speed"), steps(8.0), id="an input is on its way"),
        pytest.param(motor(gravity_load={"A": 0.08}), ("speed",), steps(3.0), id="a position that is not measured"),
        pytest.param(bench(bouc_wen_hysteresis=LOOP), ("displacement",), slow(6.0), id="a loop that was bent before"),
    ],
)
def test_what_is_right_leaves_noise_on_stretches(truth, channels, u):
    problem = prepare(truth, [record(truth, channels, u)], channels)
    assert len(problem.led.segments) > 1
    c = candidate(problem, truth, ())
    for gains in problem.observer_gains[1:]:
        found = fit(problem.led, c, gains, c.start(), 0)
        left = np.sqrt(np.nanmean(np.concatenate(found.innovations) ** 2, axis=0))
        assert (left < 1.15 * problem.noise).all()


def test_a_stretch_starts_where_the_record_had_led():
    truth = motor(gravity_load={"A": 0.08})
    data = record(truth, ("speed",), steps(3.0))
    for s in prepare(truth, [data], ("speed",)).led.segments[1:]:
        first = round(s.t[0] / STEP)
        assert s.start["position"] == pytest.approx(np.sum(data.measured["speed"][:first]) * STEP, rel=1e-9)


def test_what_was_before_a_late_input_counts_as_much_as_the_rest():
    """A current that follows switched voltages within a sample has fourth differences far above its noise."""
    switched = np.repeat(8.0 * np.sign(np.random.default_rng(1).uniform(-1, 1, SAMPLES // 4)), 4)
    truth = motor(input_delay={"T": 0.06}).with_parameters(L_a=1e-5)
    problem = prepare(truth, [record(truth, ("current", "speed"), switched)], ("current", "speed"))
    c = candidate(problem, truth, ())
    left = fit(problem, c, problem.observer_gains[-1], c.start(), 0).innovations[0]
    unknown, rest = left[:13], left[13:]
    assert (np.abs(unknown) <= 1.05 * np.sqrt(np.mean(rest**2, axis=0))).all()
    assert np.std(rest[:, 0]) < 0.5 * problem.noise[0]


def test_of_records_too_long_even_stretches_are_used_and_told(monkeypatch):
    monkeypatch.setattr(segments, "MAX_SAMPLES", 1000)
    monkeypatch.setattr(segments, "MAX_STRETCHES", 5)
    model = motor()
    whole = record(model, ("current", "speed"), steps(8.0))
    known, unseen = prepare_module.prepared(model, [whole, whole.part(0, 900)], [whole.part(0, 800)])
    assert 800 <= known.samples <= 1000
    for s, part in zip(known.segments, known.parts, strict=True):
        np.testing.assert_array_equal(part.t - part.t[0], s.t - s.t[0])
        np.testing.assert_array_equal(part.measured["speed"], s.y[:, known.channels.index("speed")])
    told = f"of 4,900 samples {known.samples:,} are used, in 5 stretches spread evenly"
    assert any(note.endswith(told) for note in known.notes)
    assert unseen.samples == 800
    assert len(unseen.segments) == 1
