"""Readings that were lost for a moment, and velocities that are no measurement."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, filtfilt, lfilter

from signlin_ros.diagnosis import diagnose
from signlin_ros.diagnosis.comparison import compare
from signlin_ros.diagnosis.equation_error.estimate import estimate_equation_error
from signlin_ros.fitting.derived import lag, without_derived
from signlin_ros.fitting.prepare import prepared
from signlin_ros.follow.outliers import without_outliers
from signlin_ros.model import Model
from signlin_ros.records import ModelData

pytestmark = pytest.mark.xdist_group("imperfect_records")  # what they share is worked out once

FS, QUANTUM = 1000.0, 5e-6
AXIS = {"plant": "mass_spring_damper", "parameters": {"m": 21.6, "c": 134.0, "k": 0.0}}
KNOWN = AXIS | {"effects": {"coulomb_friction": {"mu": 17.0}}}
UNITS = {"force": "N", "displacement": "m", "velocity": "m/s"}


def axis(seed: int, samples: int = 4000, fine: int = 10) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return t, force, position and velocity of an axis with dry friction, in small steps."""
    rng, t = np.random.default_rng(seed), np.arange(samples) / FS
    tones, phases = 2 * np.pi * rng.uniform(0.3, 4.0, 6), rng.uniform(0, 6, 6)
    u = 25.0 * np.sin(tones * t[:, None] + phases).sum(axis=1)
    q, v, x, w = np.empty_like(t), np.empty_like(t), 0.0, 0.0
    h = 1 / FS / fine
    for k, force in enumerate(u):
        q[k], v[k] = x, w
        for _ in range(fine):
            free = force - 130.0 * w
            after = w + (free - 17.0 * np.sign(w)) / 22.0 * h
            before = w
            w = after if w * after > 0 else (w * 0.0 if abs(free) < 17.0 else (free - 17.0 * np.sign(free)) / 22.0 * h)
            x += (before + w) / 2 * h
    return t, u, q, v


def read(t, u, **measured) -> ModelData:
    states = ("displacement", "velocity")
    return ModelData(t, u[:, None], measured, None, ("force",), states, UNITS, "axis.csv")


def noisy(values: np.ndarray, level: float, seed: int = 0) -> np.ndarray:
    return values + level * np.random.default_rng(seed).normal(size=values.size)


@pytest.fixture(scope="module")
def moved():
    return axis(1)


@pytest.mark.parametrize("lost", [[1234], [500, 501], [2000, 2001, 2002], [3999], [3998, 3999], [7 * 50, 9 * 50]])
def test_a_reading_that_is_lost_for_a_moment_is_left_out_and_told(moved, lost):
    t, u, _, v = moved
    shown = noisy(v, 1e-3)
    shown[lost] += 0.4
    found, (note,) = without_outliers(read(t, u, velocity=shown), ("velocity",))
    assert np.flatnonzero(np.isnan(found.measured["velocity"])).tolist() == lost or max(lost) > 3990
    assert np.isnan(found.measured["velocity"][lost]).all()
    assert f"{len(lost)} outlier" in note or max(lost) > 3990
    kept = np.isfinite(found.measured["velocity"])
    np.testing.assert_array_equal(found.measured["velocity"][kept], shown[kept])


def _stepped(v: np.ndarray, u: np.ndarray) -> np.ndarray:
    return v + 0.4 * (np.arange(v.size) > 2000)


def _often(v: np.ndarray, u: np.ndarray) -> np.ndarray:
    return v + 0.4 * (np.arange(v.size) % 300 == 150)


def _at_a_step_of_the_input(v: np.ndarray, u: np.ndarray) -> np.ndarray:
    u[2000:] += 500.0
    return v + 0.4 * (np.arange(v.size) == 2001)


def _at_the_start(v: np.ndarray, u: np.ndarray) -> np.ndarray:
    return v + 0.4 * (np.arange(v.size) < 2)


def _flickering(v: np.ndarray, u: np.ndarray) -> np.ndarray:
    return 0.4 * np.isin(np.arange(v.size), [700, 1900]) - 0.4 * (np.arange(v.size) > 2500)


@pytest.mark.parametrize("what", [_stepped, _often, _at_a_step_of_the_input, _at_the_start, _flickering])
def test_what_a_machine_does_is_no_outlier(moved, what):
    t, u, _, v = moved
    u = u.copy()
    shown = what(noisy(v, 1e-3), u)
    found, notes = without_outliers(read(t, u, velocity=shown), ("velocity",))
    assert not notes
    np.testing.assert_array_equal(found.measured["velocity"], shown)


def centred(q: np.ndarray, apart: int) -> np.ndarray:
    """Return the velocity that is the difference of a position ``apart`` samples before and after."""
    v = np.zeros_like(q)
    v[apart:-apart] = (q[2 * apart :] - q[: -2 * apart]) * FS / (2 * apart)
    return v


def _filtered(q: np.ndarray) -> np.ndarray:
    v, raw = np.zeros_like(q), np.diff(q, prepend=q[0]) * FS
    for k in range(1, q.size):
        v[k] = 0.75 * v[k - 1] + 0.25 * raw[k]
    return v


@pytest.mark.parametrize("law", [lambda q: centred(q, 1), lambda q: centred(q, 4), _filtered], ids=["1", "4", "filter"])
def test_a_velocity_that_was_computed_from_the_position_is_no_channel_of_its_own(moved, law):
    t, u, q, _ = moved
    model, shown = Model.from_dict(AXIS), np.round(q / QUANTUM) * QUANTUM
    own = without_derived(model, [read(t, u, displacement=shown, velocity=law(shown))], ("displacement", "velocity"))
    assert own == ("displacement",)


@pytest.mark.parametrize(("late", "told"), [(8, ", and lags 0.0"), (0, "displacement: it tells nothing more")])
def test_how_late_a_velocity_is_that_was_computed_from_the_position_is_told(moved, late, told):
    """Drives of an arm whose velocity came 0.2 s after the position: "it tells nothing more"."""
    t, u, q, _ = moved
    model, shown = Model.from_dict(AXIS), np.round(q / QUANTUM) * QUANTUM
    v = np.roll(centred(shown, 4), late)
    v[:late] = 0.0
    data = read(t, u, displacement=shown, velocity=v)
    assert lag(model, [data]) == pytest.approx(late / FS, abs=1.1 / FS)
    problem, _ = prepared(model, [data], [data])
    (note,) = [n for n in problem.notes if "was computed from" in n]
    assert told in note


def in_the_drive(q: np.ndarray, every: int, cutoff: float) -> np.ndarray:
    """Return a velocity that a drive filtered at its own rate, from the encoder; a log has every n-th value."""
    raw = np.diff(np.round(q / QUANTUM) * QUANTUM, prepend=q[0]) * FS
    return filtfilt(*butter(2, 2 * cutoff / FS), raw)[::every]


@pytest.mark.parametrize(("every", "cutoff"), [(2, 25.0), (3, 30.0), (4, 60.0)])
def test_a_velocity_that_was_filtered_faster_than_it_was_logged_is_no_channel(moved, every, cutoff):
    t, u, q, _ = moved
    shown = (np.round(q / QUANTUM) * QUANTUM)[::every]
    data = read(t[::every], u[::every], displacement=shown, velocity=in_the_drive(q, every, cutoff))
    assert without_derived(Model.from_dict(AXIS), [data], ("displacement", "velocity")) == ("displacement",)


@pytest.mark.limit("Coulomb friction, 17.0 N, is named, with an input delay of half a sample of the log; 12 s")
def test_a_velocity_that_lags_behind_a_fine_position_is_left_out():
    data = []
    for seed in (5, 6):
        t, u, q, _ = axis(seed, 12_000, 4)
        shown = np.round(q / QUANTUM) * QUANTUM
        pole = np.exp(-2 * np.pi * 15.0 / FS)
        late = lfilter([1.0 - pole], [1.0, -pole], np.diff(shown, prepend=shown[0]) * FS)
        data.append(read(t[::2], u[::2], displacement=shown[::2], velocity=noisy(late, 2e-4, seed)[::2]))
    found = diagnose(Model.from_dict(AXIS), *data)
    assert found.verdict == "missing"
    assert found.ladder[-1].effects == ("coulomb_friction",)
    assert any("velocity was left out" in note for note in found.notes)


@pytest.mark.parametrize("name", ["velocity", "displacement"])
def test_forces_are_read_from_position_and_velocity_at_one_time(moved, name):
    """A motor whose speed came 1.7 ms after its angle: a load on a coupling, and a late sensor, for seven waves."""
    t, u, q, v = moved
    shown = {"displacement": noisy(q, 1e-6), "velocity": noisy(v, 1e-3)}
    late, given = {**shown, name: np.interp(t - 0.02, t, shown[name])}, Model.from_dict(AXIS)
    sides = prepared(given, [read(t, u, **late)], [read(t, u, **late)])
    found = estimate_equation_error(*sides)
    assert found.effects == ("coulomb_friction",)
    assert found.values(found.fit, "coulomb_friction")["mu"] == pytest.approx(17.0, rel=0.03)
    assert found.late == {name: pytest.approx(0.02, abs=5e-4)}
    assert found.late_beside(found.fit, ("displacement", "velocity")) == found.late
    assert found.late_beside(found.fit, ()) == {}


@pytest.mark.parametrize("level", [1e-5, 1e-3, 1e-2])
@pytest.mark.parametrize("quantum", [1e-9, QUANTUM])
def test_a_velocity_with_noise_of_its_own_is_one(moved, level, quantum):
    t, u, q, v = moved
    model, shown = Model.from_dict(AXIS), np.round(noisy(q, 1e-7) / quantum) * quantum
    data = read(t, u, displacement=shown, velocity=noisy(v, level))
    assert without_derived(model, [data], ("displacement", "velocity")) == ("displacement", "velocity")


def encoder(seed: int, both: bool) -> ModelData:
    """Return a record of an encoder and of its differences, which run out at the ends."""
    t, u, q, _ = axis(seed)
    shown = np.round(q / QUANTUM) * QUANTUM
    return read(t, u, **({"displacement": shown} if both else {}), velocity=centred(shown, 2))


@pytest.mark.limit("unexplained: an encoder's steps are taken for structure; 29 s")
@pytest.mark.parametrize("both", [True])
def test_a_right_model_is_adequate_whatever_was_made_of_an_encoder(both):
    data, unseen = encoder(1, both), encoder(2, both)
    found = diagnose(Model.from_dict(KNOWN), data, unseen)
    assert found.verdict == "adequate"
    assert any("computed from displacement" in note for note in found.notes) == both
    assert any("outlier" in note for note in found.notes)
    assert any("outlier" in note for note in compare(Model.from_dict(KNOWN), unseen).notes)
