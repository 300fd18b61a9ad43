"""The equation-error estimate: its columns are the laws written by hand, its fits the truth, and noise has no name."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.signal import lfilter

from signlin_ros.comparison.force_segment import ForceSegment, asked_effort, force_segment, missing_force
from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
from signlin_ros.diagnosis.dataset import dataset_of
from signlin_ros.diagnosis.equation_error import estimate
from signlin_ros.diagnosis.equation_error.flexible import changing
from signlin_ros.diagnosis.equation_error.laws import Ripple, Shape, laws
from signlin_ros.diagnosis.equation_error.regression import RegressionData
from signlin_ros.diagnosis.equation_error.search import SubsetSearch
from signlin_ros.filters import sensor_noise
from signlin_ros.model import Model
from signlin_ros.records import ModelData

pytestmark = pytest.mark.xdist_group("equation_error")  # what they share is worked out once

Array = NDArray[np.float64]
STEP = 2e-3
M, C = 2.0, 3.0
DRIVE = {"plant": "mass_spring_damper", "parameters": {"m": M, "c": C, "k": 0.0}, "input_hold": "centred"}
Force = Callable[[Array, Array], Array]


def moved(seed: int, seconds: float = 12.0, turns: float = 1.0) -> tuple[Array, Array, Array, Array]:
    """Return t, position, velocity and acceleration (T,) of a motion known in closed form: no program integrates it."""
    rng, t = np.random.default_rng(seed), np.arange(round(seconds / STEP)) * STEP
    w, size, phase = 2 * np.pi * rng.uniform(0.05, 0.4, 5), rng.uniform(0.2, 0.6, 5), rng.uniform(0, 6, 5)
    angle = w * t[:, None] + phase
    q = turns * (size * np.sin(angle)).sum(axis=1)
    v = turns * (size * w * np.cos(angle)).sum(axis=1)
    return t, q, v, -turns * (size * w**2 * np.sin(angle)).sum(axis=1)


def record(
    seed: int,
    law: Force = lambda q, v: 0.0 * q,
    noise: float = 1e-5,
    unit: str = "rad",
    turns: float = 1.0,
    seconds: float = 12.0,
) -> ModelData:
    """Return a record of a drive that moves so: the force it takes is m q'' + c q' - law, and is known."""
    t, q, v, a = moved(seed, seconds, turns)
    rng = np.random.default_rng(seed + 100)
    effort = M * a + C * v - law(q, v)
    shown = {"displacement": q + noise * rng.normal(size=t.size), "velocity": v + 10 * noise * rng.normal(size=t.size)}
    torque = "N·m" if unit == "rad" else "N"
    units = {"force": torque, "displacement": unit, "velocity": f"{unit}/s"}
    return ModelData(t, effort[:, None], shown, None, ("force",), ("displacement", "velocity"), units)


def from_equation_error(law: Force, model: Model | None = None, **options: Any) -> estimate.EquationErrorResult:
    made = dataset_of(model or Model.from_dict(DRIVE), record(1, law, **options), record(2, law, **options))
    return estimate.estimate_equation_error(made.training, made.validation)


def searched(law: Force, **options: Any) -> SubsetSearch:
    """Return the search below the cut-off at which the estimate stopped."""
    made = dataset_of(Model.from_dict(DRIVE), record(1, law, **options), record(2, law, **options))
    found = estimate.estimate_equation_error(made.training, made.validation)
    return estimate.subset_search(made.training, made.validation, found.training.pieces[0].cutoff)


# ---------------------------------------------------------------- columns


def bristle(rate: Callable[[float, float], float], q: Array, v: Array, fine: int = 10) -> Array:
    """Return what a bristle bends (T,), z' = rate(v, z), from rest, in small steps of Euler's."""
    z, bend, h = np.zeros_like(v), 0.0, STEP / fine
    between = np.interp(np.arange(v.size * fine) / fine, np.arange(v.size), v).tolist()
    for k in range(1, v.size):
        for speed in between[(k - 1) * fine : k * fine]:
            bend += h * rate(speed, bend)
        z[k] = bend
    return z


def dahl(p: ForceSegment, sigma: float) -> Array:
    return -sigma * bristle(lambda v, z: v - sigma * abs(v) * z, *motion(p))


def play(p: ForceSegment, sigma: float, gap: float) -> Array:
    def bent(z: float) -> float:
        return max(z - gap, 0.0) - max(-z - gap, 0.0)

    z = bristle(lambda v, z: v - sigma * abs(v) * bent(z), *motion(p))
    return -sigma * np.array([bent(one) for one in z.tolist()])


def lugre(p: ForceSegment, sigma0: float, F_s: float, v_s: float) -> Array:
    def level(v: float) -> float:
        return 1.0 + (F_s - 1.0) * math.exp(-((v / v_s) ** 2))

    return -sigma0 * bristle(lambda v, z: v - sigma0 * abs(v) * z / level(v), *motion(p))


def motion(p: ForceSegment) -> tuple[Array, Array]:
    return p.values["displacement"], p.values["velocity"]


@cache
def along() -> ForceSegment:
    return force_segment(Model.from_dict(DRIVE), record(1), 25.0)


STATIC: dict[str, tuple[Shape, Callable[[Array, Array, Array], list[Array]]]] = {
    "coulomb_friction": ((), lambda q, v, s: [-s]),
    "viscous_friction": ((), lambda q, v, s: [-v]),
    "constant_load": ((), lambda q, v, s: [np.ones_like(q)]),
    "linear_stiffness": ((), lambda q, v, s: [-q]),
    "cubic_stiffness": ((), lambda q, v, s: [-(q**3)]),
    "quadratic_drag": ((), lambda q, v, s: [-v * np.abs(v)]),
    "stribeck_friction": ((("v_s", 0.7),), lambda q, v, s: [-s, -s * np.exp(-((v / 0.7) ** 2))]),
    "gravity_load": ((), lambda q, v, s: [-np.sin(q), np.cos(q)]),
    "cogging_torque": ((("N", 5.0),), lambda q, v, s: [-np.sin(5 * q), -np.cos(5 * q)]),
}


@pytest.mark.parametrize("name", STATIC)
def test_columns_are_the_laws_written_by_hand(name):
    shape, by_hand = STATIC[name]
    p, law = along(), laws(Model.from_dict(DRIVE), angular=True)[name]
    found = law.columns(p, shape)
    wanted = p.seen(np.column_stack(by_hand(*motion(p), p.sign)))
    assert found.shape == wanted.shape
    np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-6 * np.abs(wanted).max())


@pytest.mark.parametrize(
    ("name", "shape", "by_hand"),
    [
        ("dahl_presliding", {"F_c": 1.0, "sigma": 8.0}, lambda p: dahl(p, 8.0)),
        ("play_friction", {"F_c": 1.0, "sigma": 12.0, "gap": 0.05}, lambda p: play(p, 12.0, 0.05)),
        (
            "lugre_friction",
            {"sigma0": 10.0, "F_c": 1.0, "F_s": 1.5, "v_s": 0.4, "sigma1": 0.0, "sigma2": 0.0},
            lambda p: lugre(p, 10.0, 1.5, 0.4),
        ),
    ],
)
def test_laws_with_memory_are_driven_by_the_measured_motion(name, shape, by_hand):
    """One column, all that is a force scaled together; what is linear in LuGre's law stands beside it."""
    p, law = along(), laws(Model.from_dict(DRIVE), angular=True)[name]
    found, wanted = law.columns(p, tuple(shape.items()))[:, -1], p.seen(by_hand(p))
    apart = found - wanted
    assert np.sqrt(np.mean(apart**2)) < 0.01 * np.sqrt(np.mean(wanted**2))


def test_a_ripple_has_the_columns_of_its_waves():
    p, every = along(), laws(Model.from_dict(DRIVE), angular=True)
    ripple = every["torque_ripple"]
    assert isinstance(ripple, Ripple)
    both = [every["cogging_torque"].columns(p, (("N", N),)) for N in (3.0, 7.0)]
    np.testing.assert_allclose(ripple.columns(p, (("N", 3.0), ("N", 7.0))), np.hstack(both))
    assert ripple.parameters((("N", 3.0), ("N", 7.0)), np.array([3.0, 4.0, 0.0, 2.0])) == {
        "orders": [3.0, 7.0],
        "A": pytest.approx([5.0, 2.0]),
        "phi": pytest.approx([np.arctan2(4.0, 3.0), np.pi / 2]),
    }


def test_a_right_model_lacks_no_force():
    p = along()
    left = p.seen(missing_force(Model.from_dict(DRIVE), p))
    assert np.sqrt(np.mean(left**2)) < 5e-3 * np.sqrt(np.mean(p.effort**2))


def test_a_current_that_the_model_carries_is_not_late():
    model = Model.load("dc_motor").without_effect("coulomb_friction")
    model = model.with_options(with_position=True, input_hold="centred")
    t, q, v, a = (4.0 * x if k else x for k, x in enumerate(moved(1)))
    R, L, K_t, K_m, J = (model.value(n) for n in ("R_a", "L_a", "K_t", "K_m", "J"))
    current = (J * a + model.value("B") * v) / K_t
    voltage = R * current + L * np.gradient(current, STEP) + K_m * v
    data = ModelData(t, voltage[:, None], {"position": q}, None, ("voltage",), ("position",), {"position": "rad"})
    slow = force_segment(model, data, 2.0)
    assert slow.step > 10 * STEP  # few samples, each of many
    left, effort = slow.seen(missing_force(model, slow)), slow.seen(slow.effort)
    assert np.std(left) < 0.01 * np.std(effort)


def test_nothing_goes_with_the_sine_of_a_position_that_does_not_turn():
    straight, round_ = (laws(Model.from_dict(DRIVE), rotary) for rotary in (False, True))
    assert "gravity_load" not in straight
    assert {"gravity_load", "cogging_torque", "torque_ripple"} <= set(round_)


# ---------------------------------------------------------------- sensors


@pytest.mark.parametrize("level", [1e-6, 1e-4, 1e-2])
def test_the_noise_of_a_sensor_is_told_from_its_differences(level):
    t, q, *_ = moved(3)
    shown = q + level * np.random.default_rng(0).normal(size=t.size)
    assert sensor_noise(shown) == pytest.approx(level, rel=0.1)


def test_the_noise_of_an_encoder_is_that_of_its_steps():
    _, q, *_ = moved(3)
    assert sensor_noise(np.round(q / 2e-3) * 2e-3) == pytest.approx(2e-3 / np.sqrt(12), rel=0.2)


def test_what_is_held_has_noise():
    """A current of twelve equal samples a value: more than half of its differences vanish, and it had none."""
    held = np.repeat(np.random.default_rng(2).normal(size=40), 12)
    assert sensor_noise(held) > 0.1


def test_coloured_noise_counts_for_more_than_neighbouring_samples_show():
    coloured = lfilter([0.6], [1.0, -0.8], np.random.default_rng(1).normal(size=20_000))
    between_samples = np.sqrt(np.mean(np.diff(coloured, 4) ** 2) / 70)
    assert sensor_noise(coloured) > 1.5 * between_samples


# ---------------------------------------------------------------- what is named


def named(found: estimate.EquationErrorResult) -> dict[str, dict[str, float]]:
    r, fit = found.regression, found.fit
    return {n: r.laws[n].parameters(z, fit.theta[fit.spans[n]]) for n, z in fit.members}


def test_base_parameters_are_recovered():
    off = Model.from_dict({**DRIVE, "parameters": {"m": 1.06 * M, "c": 0.95 * C, "k": 0.0}})
    found = from_equation_error(lambda q, v: 0.0 * q, off)
    moved_by = dict(zip(found.regression.names, found.fit.theta, strict=False))
    assert found.effects == ()
    assert 1.06 * (1 + moved_by["m"]) == pytest.approx(1.0, abs=0.005)
    assert 0.95 * (1 + moved_by["c"]) == pytest.approx(1.0, abs=0.02)


def test_noise_has_no_name():
    for noise in (1e-5, 1e-3):
        found = from_equation_error(lambda q, v: 0.0 * q, noise=noise)
        assert found.effects == ()
        assert not found.flexible.visible


def test_the_simplest_law_of_a_family_is_named():
    """Stribeck's, Dahl's and LuGre's laws have Coulomb's as a limit, and can do no worse where they are fitted."""
    found = from_equation_error(lambda q, v: -1.5 * np.sign(v))
    assert found.effects == ("coulomb_friction",)
    assert named(found)["coulomb_friction"]["mu"] == pytest.approx(1.5, rel=0.02)
    models = found.sets
    assert (
        models[frozenset({"stribeck_friction"})].training_mse
        <= 1.001 * models[frozenset({"coulomb_friction"})].training_mse
    )


def test_a_friction_does_not_explain_the_effort_by_itself():
    """Slow, light and dry: nearly all of the effort is friction, and so "0.99 of the effort" takes nearly all away."""
    light = Model.from_dict({**DRIVE, "parameters": {"m": 0.02, "c": 0.02, "k": 0.0}})

    def dry(q: Array, v: Array) -> Array:
        return -3.0 * np.sign(v) + (C - 0.02) * v

    found = from_equation_error(dry, light, noise=1e-6)
    assert "load_dependent_friction" not in named(found)
    models = found.sets
    following, plain = (models[frozenset({n})].validation_mse for n in ("load_dependent_friction", "coulomb_friction"))
    assert plain < following


def test_a_position_that_is_noisier_does_not_tell_the_velocity():
    t, q, v, a = moved(3)
    rng = np.random.default_rng(3)
    shown = {"displacement": q + 0.2 * rng.normal(size=t.size), "velocity": v + 0.002 * rng.normal(size=t.size)}
    units = {"force": "N·m", "displacement": "rad", "velocity": "rad/s"}
    effort = (M * a + C * v)[:, None]
    data = ModelData(t, effort, shown, None, ("force",), ("displacement", "velocity"), units)
    p = force_segment(Model.from_dict(DRIVE), data, 5.0)
    assert np.std((p.values["velocity"] - np.interp(p.t, t, v))[p.kept]) < 0.002


def test_forces_of_a_free_motion_are_told_beside_the_inertial_force():
    t = np.arange(0.0, 8.0, STEP)
    decay, w = 0.2, 3.0
    q = np.exp(-decay * t) * np.cos(w * t)
    v = np.exp(-decay * t) * (-decay * np.cos(w * t) - w * np.sin(w * t))
    model = Model.from_dict({**DRIVE, "parameters": {"m": M, "c": 2 * decay * M, "k": M * (w**2 + decay**2)}})
    shown = {"displacement": q, "velocity": v + 1e-6 * np.random.default_rng(4).normal(size=t.size)}
    units = {"force": "N", "displacement": "m", "velocity": "m/s"}
    data = ModelData(t, np.zeros((t.size, 1)), shown, None, ("force",), ("displacement", "velocity"), units)
    made = dataset_of(model, data, data)
    found = estimate.estimate_equation_error(made.training, made.validation)
    assert found.regression.validation.free
    assert found.regression.percent(found.base) < 1.0


def test_a_richer_law_is_named_where_it_acts():
    found = from_equation_error(lambda q, v: -(1.0 + 1.5 * np.exp(-((v / 0.5) ** 2))) * np.sign(v))
    assert found.effects == ("stribeck_friction",)
    values = named(found)["stribeck_friction"]
    assert values["mu"] == pytest.approx(1.0, rel=0.05)
    assert values["excess"] == pytest.approx(1.5, rel=0.15)
    assert values["v_s"] == pytest.approx(0.5, rel=0.1)


def test_orders_on_a_rotary_axis_are_whole():
    """A wave of seven periods and a fifth a turn is none of a machine that turns; on a slide any wave may be."""

    def law(q: Array, v: Array) -> Array:
        return -0.8 * np.sin(7.0 * q + 0.4)

    found = from_equation_error(law, turns=3.0)
    assert found.effects == ("cogging_torque",)
    assert named(found)["cogging_torque"]["N"] == 7.0
    assert named(found)["cogging_torque"]["A"] == pytest.approx(0.8, rel=0.03)
    slide = from_equation_error(lambda q, v: -0.8 * np.sin(7.2 * q + 0.4), turns=3.0, unit="m")
    assert named(slide)["cogging_torque"]["N"] == pytest.approx(7.2, abs=0.03)


def test_orders_behind_a_gear_are_those_of_the_motor_too():
    model = Model.from_dict({**DRIVE, "axis": "rotary", "gear": 2.5})
    found = from_equation_error(lambda q, v: -0.8 * np.sin(7.5 * q), model, turns=3.0)
    assert named(found)["cogging_torque"]["N"] == pytest.approx(7.5)


def test_an_axis_whose_speed_alone_is_recorded_turns_for_both_estimates():
    whole = record(1)
    shown = {"velocity": whole.measured["velocity"]}
    speed = replace(whole, measured=shown, units={"velocity": "rad/s"})
    found = dataset_of(Model.from_dict(DRIVE), speed, speed)
    assert found.training.turns


def test_several_harmonics_are_one_effect():
    def law(q: Array, v: Array) -> Array:
        return -(0.8 * np.sin(6.0 * q + 0.4) + 0.5 * np.sin(12.0 * q - 1.0) + 0.3 * np.sin(18.0 * q))

    found = from_equation_error(law, turns=3.0)
    assert found.effects == ("torque_ripple",)
    values = named(found)["torque_ripple"]
    size = dict(zip(values["orders"], values["A"], strict=True))
    assert set(size) == {6.0, 12.0, 18.0}
    for order, wanted in ((6.0, 0.8), (12.0, 0.5), (18.0, 0.3)):
        assert size[order] == pytest.approx(wanted, rel=0.05)


def test_a_force_of_no_listed_shape_is_told_as_structure():
    found = from_equation_error(lambda q, v: -2.0 * (1.0 + 0.8 * np.tanh(q)) * v, seconds=30.0)
    assert found.flexible.visible
    assert found.flexible.percent < 0.5 * found.percent()


def test_viscosity_that_varies_along_the_way_is_told_as_structure_with_its_period():
    found = from_equation_error(lambda q, v: -2.0 * (1.0 + 0.6 * np.sin(9.0 * q)) * v, turns=3.0, seconds=30.0)
    assert found.flexible.visible
    assert found.flexible.percent < 0.1 * found.percent()
    assert found.flexible.along.endswith("viscous friction that repeats 9 times a turn")


def test_dry_friction_that_changes_along_the_way_is_told_as_that():
    """Guides that are tight in the middle of the way: nothing that repeats."""
    found = from_equation_error(lambda q, v: -0.5 * (1.0 + 3.0 * np.exp(-((2.0 * q) ** 2))) * np.sign(v), seconds=30.0)
    assert found.effects == ("coulomb_friction",)
    assert found.flexible.visible
    assert found.flexible.percent < 0.5 * found.percent()
    assert found.flexible.along == "a dry friction that changes along the way"


def test_what_a_curve_over_the_speed_takes_away_is_structure():
    """Friction that pushes at low speed, as an oscillator's negative resistance."""
    found = from_equation_error(lambda q, v: 1.5 * v * (1.0 - (v / 2.0) ** 2), seconds=30.0)
    assert found.flexible.visible
    assert found.flexible.percent < 0.5 * found.percent()
    assert not found.flexible.along


# ---------------------------------------------------------------- what changes along the record


def over_a_minute(left_of, noise: float = 0.01, period: float = 0.0):
    """Return a regression's unseen side of a minute at 20 Hz, and what is left of its force; ``period`` of one sine."""
    rng, t = np.random.default_rng(8), np.arange(0.0, 60.0, 0.05)
    v = np.sin(2 * np.pi * 0.7 * t) + 0.4 * np.sin(2 * np.pi * 0.23 * t)
    v = np.sin(2 * np.pi * t / period) if period else v
    blocks = (t // 1.0).astype(int)
    force_segment = SimpleNamespace(
        t=t, sign=np.sign(v), v=v, noise=noise, blocks=blocks, kept=np.arange(t.size), seen=lambda x: x
    )
    unseen = RegressionData((force_segment,), np.zeros(t.size), np.zeros((t.size, 0)), blocks, 1.0)
    plant = SimpleNamespace(velocity="v")
    r = SimpleNamespace(validation=unseen, model=SimpleNamespace(plant=plant), criteria=DEFAULT_CRITERIA)
    return r, left_of(t, v) + noise * rng.normal(size=t.size)


@pytest.mark.parametrize(
    ("left_of", "told"),
    [
        (lambda t, v: 0.1 * np.sin(2 * np.pi * t / 30) * np.sign(v), "dry friction"),
        (lambda t, v: 0.1 * (t / 60) * v - 0.05 * v, "viscous friction"),
        (lambda t, v: 0.1 * np.cos(2 * np.pi * t / 20), "load"),
        (lambda t, v: 0.1 + 0 * t, ""),
        (lambda t, v: 0.1 * v**3, ""),
        (lambda t, v: 0 * t, ""),
    ],
    ids=["friction", "viscosity", "load", "a steady load", "a curve of the velocity", "noise"],
)
def test_a_force_that_changes_slowly_is_told_and_a_steady_one_is_not(left_of, told):
    assert changing(*over_a_minute(left_of)) == told


def test_what_goes_with_a_slow_motion_does_not_change_with_time():
    """The joint of an arm, one slow swing: what the speed's curve leaves is no friction that changes with time."""
    r, left = over_a_minute(lambda t, v: 0.1 * (np.abs(v) - 0.5 * v**2) * np.sign(v), period=20.0)
    assert changing(r, left) == ""


def test_no_effort_explains_itself():
    """A dead zone beyond all of the force "explains" any of it: what it leaves is told in parts of what then acts."""
    bare = Model.from_dict(DRIVE)
    part = force_segment(bare, record(1, lambda q, v: -4.0 * q), 2.0)  # what is missing is a spring
    without = float(np.sqrt(np.mean(asked_effort(bare, part) ** 2)))
    for kind, values in (("input_deadzone", {"d": 8.0}), ("input_saturation", {"u_max": 0.5})):
        muted = bare.with_effect(kind, **values)
        both = part.seen(missing_force(muted, part)), asked_effort(muted, part)
        plain, asked = (float(np.sqrt(np.mean(x**2))) for x in both)
        assert plain < asked
        assert asked > without


def test_a_dead_zone_that_is_there_leaves_no_force():
    bare, data = Model.from_dict(DRIVE), record(1)
    part = force_segment(bare, replace(data, u=data.u + 2.0 * np.sign(data.u)), 2.0)
    without, with_it = (
        float(np.sqrt(np.mean(asked_effort(m, part) ** 2))) for m in (bare, bare.with_effect("input_deadzone", d=2.0))
    )
    assert without > 1.5
    assert with_it < 0.1 * without


@pytest.mark.parametrize(("weight", "level", "rate"), [(100.0, 15.0, 6.0), (150.0, 20.0, 12.0)])
def test_small_friction_beside_a_weight_is_named(weight, level, rate):
    """A weight is nearly all that is missing; friction is not the same both ways, so three laws leave more than
    noise."""

    def joint(q: Array, v: Array) -> Array:
        ahead = v > 0
        friction = level * np.where(ahead, 1.2, 0.8) * np.sign(v) + rate * np.where(ahead, 1.3, 0.7) * v
        return np.asarray(-weight * np.sin(q) - friction)

    found = from_equation_error(joint, turns=2.0)
    assert set(found.effects) == {"gravity_load", "coulomb_friction", "asymmetric_viscous_friction"}
    assert found.values(found.fit, "gravity_load")["A"] == pytest.approx(weight, rel=0.02)
    assert found.values(found.fit, "coulomb_friction")["mu"] == pytest.approx(level, rel=0.15)
    noise = math.sqrt(found.validation.noise_mse) / found.validation.effort
    assert found.percent() > 250.0 * noise


def test_a_friction_that_has_changed_between_two_records_is_told_with_both_sizes():
    def friction(size: float) -> Force:
        return lambda q, v: -size * np.sign(v)

    sizes = ((1, 0.5), (2, 0.37))
    pair = (record(seed, friction(size)) for seed, size in sizes)
    made = dataset_of(Model.from_dict(DRIVE), *pair)
    found = estimate.estimate_equation_error(made.training, made.validation)
    assert found.effects == ("coulomb_friction",)
    assert found.changed() == {"coulomb_friction": pytest.approx((0.5, 0.37), rel=0.02)}
    assert from_equation_error(friction(0.5)).changed() == {}


def test_a_visible_part_of_the_effort_is_structure_however_much_a_law_took_away():
    """A viscosity that varies along the way, beside much Coulomb friction: 7 % of the effort are left, less than a
    twentieth of what the base model leaves.
    """
    found = from_equation_error(lambda q, v: -8.0 * np.tanh(200.0 * v) - 0.67 * np.sin(9.0 * q) * v, turns=3.0)
    coulomb = found.sets[frozenset({"coulomb_friction"})]
    left, before = coulomb.validation_mse, found.base.validation_mse
    assert left < found.regression.criteria.min_flexible_share * before
    assert found.percent(coulomb) > 100.0 * found.regression.criteria.min_missing_share
    assert found.structure_left(coulomb).visible


# ---------------------------------------------------------------- a wave beyond the quiet band


def turned_one_way(seed: int) -> ModelData:
    """Return a record of an axis that turns one way against a load and a wave of 1.9 Hz, which passes the quiet band in
    part; only its angle is measured, with noise.
    """
    rng, t = np.random.default_rng(seed), np.arange(3000) * 0.01
    w, phase = rng.uniform(0.3, 1.2, 4), rng.uniform(0, 6, 4)
    angle = w * t[:, None] + phase
    v, a = 6.0 + 0.3 * np.sin(angle).sum(axis=1), 0.3 * (w * np.cos(angle)).sum(axis=1)
    q = cumulative_trapezoid(v, t, initial=0.0)
    effort = 0.3 * a + 0.02 * v + 2.0 + 0.9 * np.sin(2.0 * q)
    shown = {"displacement": q + rng.normal(0.0, 4e-3, t.size)}
    units = {"force": "N·m", "displacement": "rad"}
    return ModelData(t, effort[:, None], shown, None, ("force",), ("displacement",), units)


def test_what_the_quiet_band_leaves_is_sought_in_a_wider_one() -> None:
    given = Model.from_dict(
        {"plant": "mass_spring_damper", "axis": "rotary", "parameters": {"m": 0.3, "c": 0.02, "k": 0.0}}
    )
    made = dataset_of(given, turned_one_way(1), turned_one_way(2))
    cutoff = estimate.best_cutoff(given, made.training.parts, DEFAULT_CRITERIA.max_inertial_noise)
    quiet = estimate.EquationErrorResult.of(given, estimate.subset_search(made.training, made.validation, cutoff))
    assert quiet.effects == ("coulomb_friction",)
    assert not quiet.leaves_noise
    found = estimate.estimate_equation_error(made.training, made.validation)
    assert set(found.effects) == {"coulomb_friction", "cogging_torque"}
    assert found.values(found.fit, "cogging_torque")["A"] == pytest.approx(0.9, rel=0.05)
    assert found.leaves_noise


def test_laws_of_the_file_start_from_what_forces_tell_of_them() -> None:
    given = Model.from_dict({**DRIVE, "effects": {"coulomb_friction": {"mu": 1.0}}})
    found = from_equation_error(lambda q, v: 2.0 - 5.0 * np.sign(v), given)
    assert found.effects == ("constant_load",)
    model = found.with_laws(found.fit)
    assert model.value("coulomb_friction.mu") == pytest.approx(5.0, rel=0.02)
    assert model.value("constant_load.F0") == pytest.approx(2.0, rel=0.02)


def test_a_delayed_input_is_compared_with_the_input_delayed() -> None:
    late = 25
    data = [record(seed) for seed in (1, 2)]
    early = [replace(one, u=np.vstack([one.u[late:], np.repeat(one.u[-1:], late, axis=0)])) for one in data]
    made = dataset_of(Model.from_dict(DRIVE), *early)
    found = estimate.estimate_equation_error(made.training, made.validation)
    model = made.training.base
    as_written = np.mean(found.mse_as_written(model))
    assert np.mean(found.mse_with_later_inputs(model, late * STEP)) < 0.01 * as_written
    assert np.mean(found.mse_with_later_inputs(model, 0.5 * late * STEP)) > 0.1 * as_written
