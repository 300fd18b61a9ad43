"""The observer: better than a parabola from a position alone, honest about its errors, and about what sensors do."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from signlin_ros.errors import InputError
from signlin_ros.estimate import StateEstimator
from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.observe import KalmanObserver, observed_states
from signlin_ros.observe.meter import NoiseMeter
from signlin_ros.simulation import Trajectory, simulate

Array = NDArray[np.float64]
ENCODER = 2 * np.pi / 2**16
RATE = 200.0
MOTOR = Model.load("dc_motor").with_options(with_position=True)
SIGNALS = {
    "square": lambda t: 4.0 * np.sign(np.sin(np.pi * t)),
    "slow sine": lambda t: 2.0 * np.sin(0.4 * np.pi * t),
    "triangle": lambda t: 1.5 * (2 / np.pi) * np.arcsin(np.sin(0.2 * np.pi * t)),
    "multisine": lambda t: sum(np.sin(2 * np.pi * f * t + f**2) for f in (0.3, 0.7, 1.1, 2.3, 3.9)),
}


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def machine(signal: str, model: Model = MOTOR, span: float = 12.0) -> tuple[Trajectory, Array]:
    """Return what a machine did, and what an encoder of 16 bits showed of its position."""
    t = np.arange(0.0, span, 1 / RATE)
    run = simulate(model, t, SIGNALS[signal](t)[:, None])
    return run, np.round(run["position"] / ENCODER) * ENCODER


@pytest.mark.parametrize("signal", SIGNALS)
def test_the_speed_is_three_times_better_than_from_a_parabola_and_so_is_what_follows(signal: str) -> None:
    run, shown = machine(signal)
    x, _ = observed_states(MOTOR, run.t, {"position": shown}, run.u)
    old = StateEstimator(MOTOR, ["position"], rate=RATE).all(run.t, {"position": shown}, run.u)
    late = slice(100, None)
    assert rms(x[late, 1] - run["speed"][late]) < rms(old[late, 1] - run["speed"][late]) / 3
    core = Linearizer(MOTOR)
    full, found = (np.array([core(*p).A for p in zip(s[100::40], run.u[100::40], strict=True)]) for s in (run.x, x))
    off = np.abs(found - full) / np.maximum(np.abs(full), 1e-9)
    assert np.median(off.max(axis=(1, 2))) < 0.05


@pytest.mark.parametrize("signal", SIGNALS)
def test_a_wrong_model_costs_little(signal: str) -> None:
    """8 % too much inertia, 5 % too little resistance, 10 % too little friction: no worse than the parabola."""
    run, shown = machine(signal)
    wrong = MOTOR.with_parameters({"J": 0.0022 * 1.08, "R_a": 0.764 * 0.95, "coulomb_friction.mu": 0.033 * 0.9})
    x, _ = observed_states(wrong, run.t, {"position": shown}, run.u)
    old = StateEstimator(wrong, ["position"], rate=RATE).all(run.t, {"position": shown}, run.u)
    late = slice(100, None)
    assert rms(x[late, 1] - run["speed"][late]) < rms(old[late, 1] - run["speed"][late])


@pytest.mark.limit("known fault: the state of the observer runs away on one of the machines")
def test_its_innovations_are_as_large_as_it_says_and_white() -> None:
    model = Model.load("bouc_wen")
    t = np.arange(0.0, 20.0, 1 / RATE)
    run = simulate(model, t, (3 * np.sin(0.6 * np.pi * t) + np.sin(0.22 * np.pi * t))[:, None])
    shown = run["displacement"] + 1e-3 * np.random.default_rng(3).standard_normal(t.size)
    x, innovations = observed_states(model, t, {"displacement": shown}, run.u)
    z = (innovations.value / np.sqrt(innovations.variance))[100:]
    assert 0.9 < z.std() < 1.1
    assert abs(np.corrcoef(z[:-1], z[1:])[0, 1]) < 0.1
    for name in ("velocity", "hysteresis"):
        column = model.states.index(name)
        assert rms((x[:, column] - run[name])[200:]) < 0.01 * np.std(run[name])


def test_its_standard_deviations_cover_its_errors() -> None:
    run, shown = machine("slow sine")
    observer, errors = KalmanObserver(MOTOR, ["position"]), []
    for k, t in enumerate(run.t.tolist()):
        observer.take_input(t, run.u[k])
        observer.take(t, {"position": float(shown[k])})
        if k > 100 and k % 5 == 0:
            found = observer.estimate()
            errors.append((found.x - run.x[k])[1] / found.std[1])
    assert 0.3 < rms(np.array(errors)) < 2.0


def test_a_stuck_shaft_stands_still() -> None:
    t = np.arange(0.0, 4.0, 1 / RATE)
    u = np.full((t.size, 1), 0.2)  # 0.021 N·m of 0.033
    shown = np.full(t.size, 7 * ENCODER)
    x, _ = observed_states(MOTOR, t, {"position": shown}, u)
    assert np.abs(x[100:, 1]).max() < 1e-4
    assert x[-1, 0] == pytest.approx(0.2 / 0.764, rel=0.01)


@pytest.mark.parametrize("faster", [0.05, 0.1])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_shaft_that_breaks_away_early_is_no_surprise_where_the_model_doubts_its_force(
    faster: float, seed: int
) -> None:
    """1 % less friction than the model has, which may be wrong by 1 %: the shaft stands, then goes a little early."""
    t, noise = np.arange(0.0, 8.0, 1 / RATE), 0.6 * ENCODER
    breaking = 0.764 * 0.033 / 0.0805
    u = np.minimum(0.9 + faster * t, 1.03)[:, None] * breaking
    run = simulate(MOTOR.with_parameters({"coulomb_friction.mu": 0.033 * 0.99}), t, u)
    shown = run["position"] + noise * np.random.default_rng(seed).standard_normal(t.size)
    _, innovations = KalmanObserver(MOTOR, ["position"], {"position": noise}, (0.01,)).record(t, {"position": shown}, u)
    assert run["position"][-1] > 100 * ENCODER
    assert np.abs(innovations.sizes[100:]).max() < 4.0


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_level_of_friction_that_is_a_little_off_is_no_surprise_at_reversals(seed: int) -> None:
    """3 % less friction than the model has, which steady motion hides: at a reversal the error changes sides."""
    t, noise = np.arange(0.0, 12.0, 1 / RATE), 0.6 * ENCODER
    v = np.sin(2 * np.pi * t / 4)
    u = (0.0805 * v + 0.764 * 0.033 / 0.0805 * np.sign(v) * 1.05)[:, None]
    run = simulate(MOTOR.with_parameters({"coulomb_friction.mu": 0.033 * 0.97}), t, u)
    shown = run["position"] + noise * np.random.default_rng(seed).standard_normal(t.size)
    observer = KalmanObserver(MOTOR, ["position"], {"position": noise}, (0.003,))
    _, innovations = observer.record(t, {"position": shown}, u)
    assert np.abs(innovations.sizes[400:]).max() < 4.5


def test_what_comes_before_the_noise_is_known_tells_nothing_of_it() -> None:
    """A shaft that stands at first: its encoder shows one value, then two in turn, then motion."""
    run, _ = machine("slow sine", span=3.0)
    position = np.concatenate([np.zeros(80), run["position"]])
    u = np.concatenate([np.zeros((80, 1)), run.u])
    noise = 5e-5 * np.random.default_rng(1).standard_normal(position.size)
    observer, sizes = KalmanObserver(MOTOR, ["position"], trusts=(0.01,)), []
    for k, value in enumerate(np.round((position + noise) / ENCODER) * ENCODER):
        observer.take_input(k / RATE, u[k])
        observer.take(k / RATE, {"position": float(value)})
        if k % 20 == 19:
            sizes.append(observer.work().sizes)
    assert 0.5 < rms(np.concatenate(sizes)[200:]) < 2.0


@pytest.mark.parametrize("effect", ["compliant_load", "backlash"])
def test_a_load_that_hangs_on_the_machine_is_seen_alike_wherever_both_are(effect: str) -> None:
    numbers = {"k": 25.0, "c": 0.02, "J": 0.0011} | ({"gap": 0.02} if effect == "backlash" else {})
    model = MOTOR.with_parameters(J=0.0011).with_effect(effect, **numbers)
    run, _ = machine("slow sine", model, 6.0)
    noise = ENCODER * np.random.default_rng(4).standard_normal(run.t.size)
    here, there = (
        KalmanObserver(model, ["position"], {"position": ENCODER}, (0.01,)).record(
            run.t, {"position": run["position"] + noise + turned}, run.u
        )[1]
        for turned in (0.0, 50.0)
    )
    assert 0.5 < rms(here.sizes[200:]) < 1.2
    assert there.sizes[200:] == pytest.approx(here.sizes[200:], abs=1e-3)


def test_steady_motion_is_no_coarse_encoder() -> None:
    meter = NoiseMeter()
    position = 0.0103 * np.arange(2000) + 5e-5 * np.random.default_rng(1).standard_normal(2000)
    for k, value in enumerate(np.round(position / ENCODER) * ENCODER):
        meter.take(k / RATE, float(value))
    assert meter.sigma == pytest.approx(np.hypot(5e-5, ENCODER / 12**0.5), rel=0.3)
    assert meter.usual == pytest.approx(np.hypot(5e-5, ENCODER / 12**0.5), rel=0.15)


def test_sensors_and_delays_are_taken_off() -> None:
    sensors = {"sensor_offset": 0.3, "sensor_gain": 1.1, "sensor_delay": 0.012}
    model = MOTOR.with_effect("input_delay", T=0.013)
    for effect, value in sensors.items():
        model = model.with_effect(effect, position=value)
    run, _ = machine("square", model)
    shown = 1.1 * np.interp(run.t - 0.012, run.t, run["position"]) + 0.3
    shown += 1e-3 * np.random.default_rng(0).standard_normal(run.t.size)
    x, _ = observed_states(model, run.t, {"position": shown}, run.u)
    late = slice(200, None)
    for column in range(3):
        assert rms((x - run.x)[late, column]) < 2e-3 * run.x[:, column].std()


def test_sample_by_sample_is_what_the_whole_record_gives() -> None:
    run, shown = machine("multisine", span=3.0)
    noise = {"position": ENCODER / np.sqrt(12)}
    whole, _ = KalmanObserver(MOTOR, ["position"], noise).record(run.t, {"position": shown}, run.u)
    observer = KalmanObserver(MOTOR, ["position"], noise)
    for k, t in enumerate(run.t.tolist()):
        observer.take_input(t, run.u[k])
        observer.take(t, {"position": float(shown[k])})
        if k % 37 == 0:
            np.testing.assert_allclose(observer.estimate().x, whole[k], rtol=1e-9, atol=1e-12)


def test_one_wild_value_is_not_believed_but_a_lasting_shift_is() -> None:
    run, shown = machine("slow sine", span=6.0)
    wild = shown.copy()
    wild[700] += 100.0
    wild[1000:] += 5.0
    x, _ = observed_states(MOTOR, run.t, {"position": wild}, run.u)
    assert np.abs(x[650:1000, 1] - run["speed"][650:1000]).max() < 0.1
    assert abs(x[-1, 2] - 5.0 - run["position"][-1]) < 1e-3
    assert rms(x[1150:, 1] - run["speed"][1150:]) < 0.05


def test_it_predicts_to_a_later_time() -> None:
    run, shown = machine("slow sine", span=4.0)
    observer = KalmanObserver(MOTOR, ["position"])
    for k, t in enumerate(run.t[:600].tolist()):
        observer.take_input(t, run.u[k])
        observer.take(t, {"position": float(shown[k])})
    found = observer.estimate(float(run.t[605]))
    assert found.x[1] == pytest.approx(run["speed"][605], abs=0.1)
    assert observer.estimate().t == pytest.approx(run.t[599])


def test_another_model_goes_on_where_the_first_has_got_to() -> None:
    run, shown = machine("slow sine", span=4.0)
    first = KalmanObserver(MOTOR, ["position"])
    for k, t in enumerate(run.t[:600].tolist()):
        first.take_input(t, run.u[k])
        first.take(t, {"position": float(shown[k])})
    before = first.estimate()
    second = KalmanObserver(MOTOR.with_effect("dahl_presliding"), ["position"])
    second.adopt(first)
    np.testing.assert_allclose(second.estimate().x[:3], before.x)
    assert second.sigma == first.sigma


def test_what_it_refuses() -> None:
    with pytest.raises(InputError, match="voltage"):
        KalmanObserver(MOTOR, ["voltage"])
    observer = KalmanObserver(MOTOR, ["position"])
    with pytest.raises(InputError, match="nothing was measured"):
        observer.estimate()
    observer.take(1.0, {"position": 0.0})
    with pytest.raises(InputError, match="does not increase"):
        observer.take(1.0, {"position": 0.0})
