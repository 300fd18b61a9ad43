"""Where a model fails: the hidden effect's own place is found, and nothing is found where there is nothing."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from signlin_ros.comparison import bands
from signlin_ros.comparison.locate import block_mean
from signlin_ros.diagnosis.comparison import compare
from signlin_ros.errors import InputError
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.report import curves
from signlin_ros.simulation import simulate

pytestmark = pytest.mark.slow

T = np.arange(3200) / 200
HELD = {"input_hold": "forward"}  # inputs are simulated so; what asks the record for it is tested in tests/diagnosis
PLAIN = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.6, "k": 40.0}, **HELD})
MOTOR = Model.load("dc_motor").without_effect("coulomb_friction").with_options(with_position=True, **HELD)


def multisine(size, seed=0, fastest=3.0):
    rng = np.random.default_rng(seed)
    waves = [np.sin(2 * np.pi * f * T + rng.uniform(0, 6.28)) for f in rng.uniform(0.1, fastest, 12)]
    return size / 3 * np.sum(waves, axis=0)[:, None]


def steps(size, seed=0, count=16):
    return np.repeat(np.random.default_rng(seed).uniform(-size, size, count), T.size // count)[:, None]


def recorded(true, model, u, noise=0.01, seed=0):
    rng = np.random.default_rng(seed)
    run = simulate(true, T, u)
    names = dict.fromkeys((*model.states, *model.outputs))
    y = {n: run[n] + noise * run[n].std() * rng.standard_normal(T.size) for n in names}
    return ModelData(T, u[:, : len(model.inputs)], y, None, model.inputs, model.states, model.units)


def found(true, model, u, **more):
    return compare(model, recorded(true, model, u, **more))


def test_a_stop_is_found_at_the_ends_of_the_travel():
    true = PLAIN.with_effect("hard_stop", gap=0.1, k_s=220.0)
    region = found(true, PLAIN, multisine(4.0)).where[0]
    assert region.kind == "position"
    assert region.name.startswith("|displacement| > 0.1")
    assert region.name.endswith(" m")
    assert region.share_of_error > 80
    assert region.share_of_time < 50


def test_a_stiff_spring_is_found_far_out_and_friction_near_standstill():
    true = PLAIN.with_effect("cubic_stiffness", k3=120.0)
    kinds = [r.kind for r in found(true, PLAIN, multisine(6.0)).where]
    assert kinds[0] == "position"
    motor = MOTOR.with_effect("stribeck_friction", mu=0.02, excess=0.06, v_s=3.0)
    known = MOTOR.with_effect("coulomb_friction", mu=0.02)
    region = found(motor, known, multisine(3.0)).where[0]
    assert region.kind in ("speed", "reversal")
    assert "|speed| <" in region.name or "reversal" in region.name
    assert region.share_of_error > 1.3 * region.share_of_time


def test_drag_is_found_at_high_speed():
    region = found(MOTOR.with_effect("quadratic_drag", c2=2e-4), MOTOR, multisine(4.0)).where[0]
    assert region.kind == "speed"
    assert "|speed| > " in region.name


def test_gravity_is_a_pattern_of_the_position_and_cogging_a_finer_one():
    gravity, cogging = {"A": 0.08}, {"A": 0.05, "N": 4.0, "phi": 0.4}
    for effect, values, period in (("gravity_load", gravity, 6.28), ("cogging_torque", cogging, 1.57)):
        c = found(MOTOR.with_effect(effect, **values), MOTOR, multisine(2.0, fastest=1.0))
        patterns = [r for r in c.where if r.kind == "position in its period"]
        assert patterns, [r.name for r in c.where]
        assert float(patterns[0].name.split("period ")[1].split()[0]) == pytest.approx(period, rel=0.03)


def test_friction_that_differs_by_direction_is_found_by_direction():
    true = MOTOR.with_effect("asymmetric_viscous_friction", b_p=0.0, b_n=2e-3)
    c = found(true, MOTOR, multisine(3.0))
    assert "speed < 0 rad/s" in [r.name for r in c.where]
    region = next(r for r in c.where if r.kind == "direction")
    assert region.share_of_error > 85
    assert region.mean > 0  # negative speed, so friction pushes forward
    assert region.mean > 4 * region.mean_std


def test_a_dead_zone_is_laid_at_the_door_of_the_voltage():
    c = found(MOTOR.with_effect("input_deadzone", d=0.9), MOTOR, steps(5.0))
    clear = [m for m in c.missing if m.clear]
    assert [m.name for m in clear] == ["voltage"]
    beyond = np.abs(c.traces[0].u[:, 0]) > 1.2
    assert np.median(np.abs(clear[0].values[0][beyond])) == pytest.approx(0.9, rel=0.03)


def test_coulomb_friction_stands_out_nowhere_and_that_is_said():
    c = found(MOTOR.with_effect("coulomb_friction", mu=0.033), MOTOR, multisine(4.0))
    assert c.where == ()
    assert any(note.startswith("no situation that was looked at") for note in c.notes)
    assert c.directions["torque"]["forward"]["mean"] == pytest.approx(-0.033, rel=0.06)


def test_what_is_missing_has_the_right_size_and_noise():
    """A slow unknown torque is recovered; without one, only the noise that was foretold is there."""
    loaded = MOTOR.with_options(with_load_torque=True)
    torque = 0.02 * np.sin(2 * T)
    c = found(loaded, MOTOR, np.column_stack([multisine(3.0)[:, 0], torque]))
    (lacking,) = (m for m in c.missing if m.clear)
    error = lacking.values[0] + torque
    assert np.sqrt(np.mean(error[100:-100] ** 2)) == pytest.approx(lacking.noise, rel=0.25)
    assert lacking.noise < 0.4 * lacking.rms
    quiet = found(MOTOR, MOTOR, multisine(3.0)).missing
    for m in quiet:
        assert not m.clear
        assert m.rms == pytest.approx(m.noise, rel=0.35)


@pytest.mark.slow
@pytest.mark.parametrize("records", [3, pytest.param(8, marks=pytest.mark.long)])
@pytest.mark.parametrize("drive", [multisine, steps])
def test_a_fault_that_belongs_nowhere_is_found_nowhere(drive, records):
    """A random torque has no place: hardly a region in some records with a dozen families each."""
    loaded = MOTOR.with_options(with_load_torque=True)
    regions = 0
    for seed in range(records):
        noise = lfilter([1], [1, -0.9], np.random.default_rng(seed).standard_normal(T.size))
        u = np.column_stack([drive(4.0, seed)[:, 0], 0.03 * noise / noise.std()])
        c = found(loaded, MOTOR, u, seed=seed)
        assert any(m.clear for m in c.missing)
        regions += len(c.where)
    assert regions <= 1


def test_regions_are_ranked_and_their_shares_are_shares():
    true = PLAIN.with_effect("bouc_wen_hysteresis")
    where = found(true, PLAIN, multisine(5.0)).where
    excess = [r.share_of_error - r.share_of_time for r in where if r.kind != "frequency"]
    assert excess == sorted(excess, reverse=True)
    assert all(0 < r.share_of_time < r.share_of_error <= 100 for r in where)
    for region in where:
        if region.mask:
            assert 100 * np.mean(np.concatenate(region.mask)) == pytest.approx(region.share_of_time)


# -------------------------------------------------------------------- curves and pictures


def test_a_band_covers_the_truth_although_its_samples_hang_together():
    hits, total = 0, 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        x = lfilter([1], [1, -0.95], rng.standard_normal(4000))
        e = lfilter([1], [1, -0.9], rng.standard_normal(4000))
        band = bands.band(x, 0.5 * x + e, bands.memory(e), bins=12)
        inside = np.abs(band.mean - 0.5 * band.at) < band.two_errors
        hits, total = hits + int(inside.sum()), total + inside.size
    assert 0.85 < hits / total < 0.99


def test_the_error_of_a_mean_allows_for_correlation():
    values = lfilter([1], [1, -0.95], np.random.default_rng(0).standard_normal(20_000))
    everywhere = np.ones(values.size, dtype=bool)
    (_, alone), (_, together) = block_mean(values, everywhere, 1), block_mean(values, everywhere, 200)
    assert 4 < together / alone < 8  # sqrt((1 + rho) / (1 - rho)) = 6.2


def test_the_loop_of_a_hysteresis_is_the_spring_force():
    true = PLAIN.with_effect("bouc_wen_hysteresis", alpha=0.4, D=0.08, beta=0.6, gamma=0.35, n=2.0)
    u = multisine(5.0)
    c = found(true, PLAIN, u, noise=0.003)
    force, model = curves.internal_force(c, 0)
    run = simulate(true, T, u)
    acceleration = np.gradient(run["velocity"], T)
    exact = u[:, 0] - acceleration
    assert np.std(force - exact) < 0.15 * np.std(exact)
    assert np.std(model - exact) > 2 * np.std(force - exact)


@pytest.mark.slow
def test_every_picture_is_drawn():
    pictures = pytest.importorskip("signlin_ros.report.pictures")
    pytest.importorskip("matplotlib")
    c = found(MOTOR.with_effect("coulomb_friction", mu=0.033), MOTOR, multisine(4.0))
    curve = np.linspace(-10, 10, 50)
    candidate = {"speed": {"coulomb_friction": (curve, -0.033 * np.sign(curve))}}
    figures = [
        *(pictures.measured_and_simulated(c), pictures.missing_against(c, candidates=candidate)),
        *(pictures.missing_over_time(c), pictures.missing_over_time(c, 0)),
        *(pictures.error_map(c), pictures.hysteresis_loop(c), pictures.spectrum(c)),
        pictures.ladder([("base", 1.0, 1.1), ("+ coulomb_friction", 0.1, None)], 0.07, "RMS error [rad/s]"),
    ]
    for figure in figures:
        figure.canvas.draw()
        assert figure.axes
    with pytest.raises(InputError, match="acceleration"):
        pictures.missing_against(c, ["acceleration"])
    element = Model.load("force_element")
    moved = found(element, element, multisine(0.05))
    assert len(pictures.hysteresis_loop(moved).axes) == 2
    assert len(pictures.missing_against(moved).axes) == 2
