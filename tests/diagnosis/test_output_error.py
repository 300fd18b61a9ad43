"""The output-error estimate: one measure on validation data, nested models in order, names and refusals."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.hidden.generator import draw, write
from signlin_ros.diagnosis import add, diagnose, summary
from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.evidence import Evidence
from signlin_ros.diagnosis.output_error import FitCache, OutputErrorEstimator, estimator_of, fitting
from signlin_ros.diagnosis.output_error.score import improvement
from signlin_ros.diagnosis.output_error.trials import Trial, trials, tryable
from signlin_ros.diagnosis.progress import CancelledError, Progress
from signlin_ros.effects import EFFECTS
from signlin_ros.fitting.candidate import Candidate
from signlin_ros.fitting.fit import Fit, evaluated, fit
from signlin_ros.fitting.gains import ObserverGains
from signlin_ros.fitting.inverses import bounded_step, covariance_of, squared_distance
from signlin_ros.fitting.prepare import held_out, prepared
from signlin_ros.fitting.problem import Problem
from signlin_ros.follow.data import load_records
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

BASE = {"plant": "mass_spring_damper", "parameters": {"m": 2.0, "c": 3.0, "k": 40.0}}
NOISE = 1e-3
RNG = np.random.default_rng


def record(model: Model, seed: int, seconds: float = 16.0, channels: tuple[str, ...] = ("displacement",)) -> ModelData:
    rng = RNG(seed)
    t = np.arange(round(seconds / 0.005)) * 0.005
    tones = 2 * np.pi * rng.uniform(0.2, 3.0, 5)
    u = 8.0 * np.sin(tones * t[:, None] + rng.uniform(0, 6, 5)).sum(axis=1)[:, None]
    x = simulate(model, t, u, np.zeros(2)).x
    noise = {"displacement": NOISE, "velocity": 10 * NOISE}
    measured = {c: x[:, model.states.index(c)] + rng.normal(0, noise[c], t.size) for c in channels}
    return ModelData(t, u, measured, None, ("force",), ("displacement", "velocity"), {"displacement": "m"})


def motion(truth: Model, base: Model | None = None, **options) -> OutputErrorEstimator:
    known, unseen = record(truth, 1, **options), record(truth, 2, **options)
    return estimator_of(*prepared(base or Model.from_dict(BASE), [known], [unseen]), Criteria(), FitCache(), jobs=1)


COULOMB = Model.from_dict({**BASE, "effects": {"coulomb_friction": {"mu": 2.0}}})


def test_the_windowed_error_of_a_right_model_is_the_noise_of_the_sensor():
    base = motion(Model.from_dict(BASE)).base
    assert np.sqrt(np.mean(base.validation_squares)) == pytest.approx(NOISE, rel=0.05)
    assert base.white


def test_certainty_is_the_mean_difference_over_its_standard_error():
    before, after = RNG(0).uniform(1, 2, (40, 1)), RNG(1).uniform(1, 1.5, (40, 1))
    difference = np.append(np.log(before + 1e-6) - np.log(after + 1e-6), 0.0)  # one block more, which tells nothing
    expected = difference.mean() / (difference.std(ddof=1) / np.sqrt(41))
    found = improvement(before, after, np.array([1e-3]))
    assert found.t_ratio == pytest.approx(expected)
    assert improvement(after, before, np.array([1e-3])).t_ratio == pytest.approx(-expected)


def test_what_falls_everywhere_is_sure_however_much_there_was():
    """A loop's error of 2 to 17 times the noise, in waves, falls to the noise in every block: 3.2 standard errors."""
    waves = 9.0 + 7.0 * np.sin(np.linspace(0.0, 20.0, 98))[:, None]
    noise = np.exp(0.1 * RNG(0).normal(size=(98, 1)))
    assert improvement(waves**2, noise, np.array([1.0])).t_ratio > 6.0
    few = np.concatenate([noise[:90], waves[90:] ** 2])
    assert improvement(few, noise, np.array([1.0])).t_ratio < 3.5
    assert improvement(waves[:3] ** 2, noise[:3], np.array([1.0])).t_ratio <= 3.5


def test_a_friction_that_is_known_but_for_a_scale_is_there():
    """Voltage and speed tell a friction torque over the inertia alone; its own standard error is that of the scale."""
    motor = {"plant": "dc_motor", "parameters": {"R_a": 2.0, "L_a": 0.0, "K_t": 0.1, "K_m": 0.1, "B": 0.0, "J": 1e-3}}
    base = Model.from_dict({**motor, "tolerance": {"R_a": 0.5, "K_t": 0.5, "J": 0.5}})
    truth = Model.from_dict({**motor, "effects": {"coulomb_friction": {"mu": 0.02}}})

    def run(seed: int) -> ModelData:
        rng, t = RNG(seed), np.arange(3000) * 0.005
        u = (2.0 * np.sin(2 * np.pi * rng.uniform(0.1, 0.6, 3) * t[:, None] + rng.uniform(0, 6, 3))).sum(axis=1)
        speed = simulate(truth, t, u[:, None], np.zeros(1)).x[:, 0] + rng.normal(0, 0.1, t.size)
        return ModelData(t, u[:, None], {"speed": speed}, None, ("voltage",), ("speed",), {"speed": "rad/s"})

    estimator = estimator_of(*prepared(base, [run(1)], [run(2)]), Criteria(), FitCache(), jobs=1)
    found = estimator.fitted(["coulomb_friction"])
    mu = found.parameters["coulomb_friction.mu"]
    assert mu.value < 4 * mu.std
    assert not found.insignificant(Criteria())
    assert not estimator.refusal(estimator.base, found)


def test_the_simplest_law_that_suffices_is_named():
    found = motion(COULOMB)
    path = found.search(3)
    assert path[-1][0].effects == ("coulomb_friction",)
    mu = path[-1][0].parameters["coulomb_friction.mu"]
    assert abs(mu.value - 2.0) < 4 * mu.std < 0.5
    assert "coulomb_friction" in path[-1][0].model.effects
    richer = found.fitted(["coulomb_friction", "viscous_friction"], COULOMB)
    assert found.refusal(path[-1][0], richer)


def test_a_larger_model_is_never_worse_on_what_it_was_fitted_to():
    found = motion(COULOMB, channels=("displacement", "velocity"))
    smaller = found.fitted(["coulomb_friction"])
    larger = found.fitted(["coulomb_friction", "quadratic_drag"])
    first, second = (np.mean(f.training_squares, axis=0).sum() for f in (smaller, larger))
    assert second < first * 1.001


def test_a_model_without_free_parameters_is_judged_too():
    frozen = Model.from_dict({**BASE, "frozen": ["m", "c", "k"]})
    found = motion(COULOMB, frozen)
    assert found.base.parameters == {}
    assert found.extensions(found.base, ["coulomb_friction"])[0].parameters["coulomb_friction.mu"].value > 1.5


def test_an_imposed_motion_without_any_force_of_its_own():
    rng, t = RNG(5), np.arange(4000) * 0.005
    v = 0.1 * np.sin(2 * np.pi * np.array([0.4, 1.1]) * t[:, None]).sum(axis=1)
    displacement = np.concatenate([[0.0], np.cumsum(v[:-1]) * 0.005])
    force = 800.0 * v + 50.0 * np.sign(v) + rng.normal(0, 2.0, t.size)
    measured = {"displacement": displacement, "force": force}
    data = ModelData(t, v[:, None], measured, None, ("velocity",), ("displacement",), {"displacement": "m"})
    nothing = Model.from_dict({"plant": "force_element", "parameters": {"c": 0.0, "k": 0.0}})
    found = estimator_of(*prepared(nothing, *held_out([data])), Criteria(), FitCache(), jobs=1)
    assert found.base.parameters == {}
    both = found.fitted(["viscous_friction", "coulomb_friction"])
    assert both.parameters["viscous_friction.b"].value == pytest.approx(800.0, rel=0.02)
    assert both.parameters["coulomb_friction.mu"].value == pytest.approx(50.0, rel=0.05)


def test_gaps_several_records_and_missing_samples():
    whole = record(COULOMB, 1)
    holes = whole.measured["displacement"].copy()
    holes[::17] = np.nan
    kept = np.r_[0:1300, 1800:3200]
    cut = ModelData(
        whole.t[kept], whole.u[kept], {"displacement": holes[kept]}, None, whole.inputs, whole.states, whole.units
    )
    found = estimator_of(
        *prepared(Model.from_dict(BASE), *held_out([cut, record(COULOMB, 3)])), Criteria(), FitCache(), jobs=1
    )
    assert not found.refusal(found.base, found.fitted(["coulomb_friction"]))


def test_it_stops_when_asked():
    asked = []
    sides = prepared(Model.from_dict(BASE), *held_out([record(COULOMB, 1)]))
    watched = Progress(lambda stage, share: asked.append(stage), lambda: len(asked) > 0)
    with pytest.raises(CancelledError):
        estimator_of(*sides, Criteria(), FitCache(), watched).search(3)
    assert len(asked) == 1


def test_criteria_are_arguments():
    found = motion(COULOMB)
    strict = replace(Criteria(), min_t=1e6)
    found = replace(found, criteria=strict)
    assert found.refusal(found.base, found.fitted(["coulomb_friction"]))


@pytest.mark.parametrize(("group", "index"), [("single", 4), ("weak", 0), ("none", 1)])
def test_records_of_an_independent_program(group, index, tmp_path):
    drawn = draw(group, index, 3)
    folder = write(drawn, tmp_path)
    paths = [str(folder / f"{part}.csv") for part in ("estimation", "validation")]
    model, (known, unseen) = load_records(Model.load(folder / "model.yaml"), paths)
    found = estimator_of(*prepared(model, [known], [unseen]), Criteria(), FitCache(), jobs=1)
    final = found.search(3)[-1][0]
    assert {*final.effects} == {*drawn.truth["hidden"]} - {"none"}
    assert final.white


WAVE = {"type": "cogging_torque", "A": 3.0, "N": 12.0, "phi": 0.5}
BOTH = ("displacement", "velocity")


def test_a_wave_of_few_periods_is_believed_beside_noise_alone():
    found = motion(Model.from_dict({**BASE, "effects": {"wave": WAVE}}), channels=BOTH)
    fitted = found.fitted(["cogging_torque"])
    periods = 12.0 * np.ptp(found.training.position_range) / (2 * np.pi)
    assert 1.0 < periods < 3.0
    assert fitted.residual_is_noise
    assert not found.refusal(found.base, fitted)
    assert found.few_waves(fitted) == {"cogging_torque": pytest.approx(periods, rel=0.02)}

    more = {"wave": WAVE, "coulomb_friction": {"mu": 2.0}}
    found = motion(Model.from_dict({**BASE, "effects": more}), channels=BOTH)
    assert "periods of cogging_torque" in found.refusal(found.base, found.fitted(["cogging_torque"]))


def test_it_is_told_that_a_wave_of_few_periods_need_not_go_on():
    known, unseen = (record(Model.from_dict({**BASE, "effects": {"wave": WAVE}}), n, channels=BOTH) for n in (1, 2))
    found = diagnose(Model.from_dict(BASE), known, unseen, jobs=1)
    assert (found.verdict, found.ranking[0].effect) == ("missing", "cogging_torque")
    assert any("periods of cogging_torque" in note for note in found.notes)


def test_every_effect_that_may_be_missing_has_a_row_whatever_was_searched():
    known, unseen = record(COULOMB, 1), record(COULOMB, 2)
    found = diagnose(Model.from_dict(BASE), known, unseen, jobs=1)
    problem, _ = prepared(Model.from_dict(BASE), [known], [unseen])
    rows = {entry.effect: entry for entry in found.ranking}
    assert {n for n in EFFECTS if tryable(problem, n)} <= set(rows)
    assert rows["input_delay"].why == "not fitted: Coulomb friction leaves nothing but noise"  # no force shows it
    assert {n for n, entry in rows.items() if entry.status == "confirmed"} == {"coulomb_friction"}


@pytest.mark.parametrize("turned", [False, True])
def test_a_row_is_of_the_best_fit_of_its_effect_in_whatever_order_they_were_made(turned):
    fits = {
        ("sensor_offset.speed",): SimpleNamespace(effects=("sensor_offset",), log_mse=2.0),
        ("sensor_offset.position",): SimpleNamespace(effects=("sensor_offset",), log_mse=1.0),
        ("backlash", "drag"): SimpleNamespace(effects=("backlash", "drag"), log_mse=0.0),
    }
    best = dict(reversed(fits.items())) if turned else fits
    found = summary._fitted_alone(Evidence(None, SimpleNamespace(cache=FitCache(best=best)), None))
    assert found == {"sensor_offset": fits[("sensor_offset.position",)]}


def test_of_what_nothing_is_known_the_error_is_huge():
    """A friction with a load that was never recorded: "0.05 ± 5.9e-15", of a pseudo-inverse."""
    found = covariance_of(np.diag([4.0, 0.0]))
    assert found[0, 0] == pytest.approx(0.25)
    assert found[1, 1] > 1e12
    assert covariance_of(np.array([[2.0, 1.0], [1.0, 2.0]])) == pytest.approx(
        np.array([[2.0, -1.0], [-1.0, 2.0]]) / 3.0
    )


def test_standard_errors_depend_on_no_unit():
    """Of coordinates known to 1e-4 and to 1e4 of their units, those of the finer one were lost to rounding."""
    root = RNG(3).normal(size=(40, 6))
    plain, unit = root.T @ root, np.logspace(-8, 8, 6)
    assert covariance_of(plain / np.outer(unit, unit)) == pytest.approx(np.linalg.inv(plain) * np.outer(unit, unit))
    apart = RNG(4).normal(size=6)
    own = squared_distance(apart * unit, np.linalg.inv(plain) * np.outer(unit, unit))
    assert own == pytest.approx(float(apart @ plain @ apart))


def test_a_step_of_the_fit_depends_on_no_unit():
    """A direction that its prior alone tells of was not moved beside one that is known to 1e-8."""
    root, gradient = RNG(5).normal(size=(40, 4)), RNG(6).normal(size=4)
    hessian, free, unit = root.T @ root, np.full(4, np.inf), np.array([1e-8, 1.0, 1e4, 1e8])
    plain = bounded_step(np.zeros(4), gradient, hessian, 1e-3, -free, free)
    own = bounded_step(np.zeros(4), gradient / unit, hessian / np.outer(unit, unit), 1e-3, -free, free)
    assert own == pytest.approx(unit * plain)


def test_a_direction_that_tells_next_to_nothing_ends_no_fit():
    """Friction that has faded by e^-700 at every sample: two such units together are beyond all numbers."""
    hessian, gradient = np.diag([1e5, 1e-315, 0.1]), np.array([1.0, -6e-158, 0.0])
    new = bounded_step(np.zeros(3), gradient, hessian, 1e-3, np.full(3, -1.0), np.full(3, 1.0))
    assert new == pytest.approx([-1e-5 / 1.001, 0.0, 0.0])
    assert np.isfinite(covariance_of(hessian)).all()


def motor_with_friction() -> tuple[OutputErrorEstimator, Model]:
    values = {"R_a": 1.2, "L_a": 5e-4, "K_t": 0.042, "K_m": 0.042, "B": 0.0, "J": 6e-5}
    friction = {"effects": {"coulomb_friction": {"mu": 0.011}}}
    base = Model.from_dict({"plant": "dc_motor", "parameters": values, "tolerance": 0.2})
    truth = Model.from_dict({"plant": "dc_motor", "parameters": values, **friction})

    def motor(seed: int) -> ModelData:
        rng, t = RNG(seed), np.arange(4000) * 0.002
        u = np.repeat(rng.uniform(-8.0, 8.0, 40), 100)[:, None]
        x = simulate(truth, t, u, np.zeros(2)).x
        measured = {
            n: x[:, i] + rng.normal(0, s, t.size) for i, (n, s) in enumerate((("current", 1e-3), ("speed", 0.1)))
        }
        return ModelData(t, u, measured, None, ("voltage",), ("current", "speed"), {})

    estimator = estimator_of(*prepared(base, [motor(1)], [motor(2)]), Criteria(), FitCache(), jobs=1)
    return estimator, truth


def test_what_only_the_tolerance_tells_of_has_the_tolerance_for_its_standard_error():
    """Torque constant, inertia and friction of a motor, all times the same, move alike: three laws that left but noise
    were refused, because friction was insignificant, with a t ratio of 0.0.
    """
    estimator, truth = motor_with_friction()
    found = estimator.fitted(["coulomb_friction"], truth)
    at = [one.k.name for one in found.coordinates]
    for covariance in found.covariances:
        errors = dict(zip(at, np.sqrt(np.diag(covariance)), strict=True))
        assert errors["K_t"] == pytest.approx(0.2 / np.sqrt(2.0), rel=0.02)
    assert not found.insignificant(Criteria())


def test_add_stands_for_the_values_that_diagnose_stands_for(monkeypatch):
    """It kept the motion's where `diagnose` takes those of the force: 17.2 and 6.43 % of a cart's effort."""
    base, known, unseen = Model.from_dict(BASE), record(COULOMB, 1), record(COULOMB, 2)

    def of_the_force(w: Evidence, f):
        return (
            w.output_error.at_values_of(f.effects, f.model.with_parameters({"coulomb_friction.mu": 1.75}))
            if f.effects
            else f
        )

    monkeypatch.setattr(Evidence, "with_better_values", of_the_force)
    for found in (diagnose(base, known, unseen, jobs=1), add("coulomb_friction", base, known, unseen, jobs=1)):
        assert found.parameters["coulomb_friction.mu"].value == 1.75


def test_what_the_force_found_of_a_law_is_a_start_beside_the_others(monkeypatch):
    """Where the force had a wave of order one, that of six, the best of all starts, was not tried."""
    estimator, tried = motion(Model.from_dict(BASE)), list[float]()
    trial = trials(estimator.training, ["coulomb_friction"])[0]
    trial = replace(trial, starts=tuple({"mu": 0.1 * (k + 1)} for k in range(16)))
    of = estimator.base.fit
    monkeypatch.setattr(
        fitting, "fit", lambda problem, c, gains, theta, steps: tried.append(c.model.value("coulomb_friction.mu"))
    )

    def starts(one: Trial) -> set[float]:
        tried.clear()
        assert fitting.multi_start_fit(estimator.short, of, one) is None
        return set(tried)

    alone = starts(trial)
    estimator = replace(estimator, starts={"coulomb_friction": {"mu": 5.0}})
    assert 0.1 in alone
    from_equation_error = starts(estimator._from_equation_error(trial))
    assert {0.1, 5.0} <= from_equation_error
    assert from_equation_error - {5.0} <= alone


def test_what_was_fitted_from_some_starts_is_not_fitted_again_and_the_answer_is_the_same(monkeypatch):
    """A record that starts in motion: where it starts is kept with each candidate, and is found by all its fits."""
    whole = record(COULOMB, 1, 6.0)
    part = slice(150, None)
    shown = {name: values[part] for name, values in whole.measured.items()}
    moving = replace(whole, t=whole.t[part], u=whole.u[part], measured=shown)
    sides = prepared(Model.from_dict(BASE), [moving], [record(COULOMB, 2, 6.0)])
    estimator, counted = estimator_of(*sides, Criteria(), FitCache(), jobs=1), [0]
    of, trial = estimator.base.fit, trials(estimator.training, ["dahl_presliding"])[0]

    def counting(*arguments):
        counted[0] += 1
        return fit(*arguments)

    monkeypatch.setattr(fitting, "fit", counting)

    def fitted(few: int, steps: int, known: fitting.StartedFits | None) -> tuple[Fit, int]:
        counted[0] = 0
        found = fitting.multi_start_fit(estimator.short, of, trial, few, steps, known)
        assert found is not None
        assert found.candidate.starts
        return found, counted[0]

    known, all_starts, kept = fitting.StartedFits(), len(trial.starts), list[Fit]()
    for few, steps in ((2, 0), (all_starts, 3), (all_starts, 6)):
        (once, count), (again, left) = fitted(few, steps, None), fitted(few, steps, known)
        assert (again.theta.tobytes(), again.objective) == (once.theta.tobytes(), once.objective)
        kept.append(again)
    assert left == 0 < count
    assert kept[-1].candidate.starts is not kept[-2].candidate.starts


def test_every_channel_is_judged_from_the_observer_that_predicts_it_best(monkeypatch):
    """With one observer for all, a motor's speed rose by 6 % where a gain of its position was put right."""
    found = motion(Model.from_dict(BASE), channels=("displacement", "velocity"))
    known = {
        gains: (1.0 + abs(k - 1), 1.0 + abs(k - 2))
        for k, gains in enumerate(g.tau for g in found.training.observer_gains)
    }

    def windowed(problem: Problem, c: Candidate, theta: np.ndarray, gains: ObserverGains) -> np.ndarray:
        return np.tile(known[gains.tau] if problem is found.training else 2 * (10.0 * gains.tau,), (5, 1))

    monkeypatch.setattr(fitting, "windowed", windowed)
    squares, unseen = fitting.window_squares(
        found.training, found.validation, found.base.fit.candidate, found.base.fit.theta
    )
    first, second = (10.0 * found.training.observer_gains[k].tau for k in (1, 2))
    assert squares == pytest.approx(np.ones((5, 2)))
    assert unseen == pytest.approx(np.tile([first, second], (5, 1)))


def test_no_answer_depends_on_how_many_fits_run_side_by_side():
    """A motor's table was one or another from run to run: what a fit found was taken up when it happened to end."""
    truth = Model.from_dict({**BASE, "effects": {"coulomb_friction": {"mu": 2.0}, "cubic_stiffness": {"k3": 60.0}}})
    known, unseen = record(truth, 1, seconds=8.0), record(truth, 2, seconds=8.0)
    alone, together = (diagnose(Model.from_dict(BASE), known, unseen, jobs=jobs).to_json() for jobs in (1, 4))
    assert alone == together


def test_a_larger_model_starts_from_what_the_smaller_one_arrived_at():
    found = motion(COULOMB)
    for effect, start in (("cubic_stiffness", {"k3": 50.0}), ("bouc_wen_hysteresis", {"alpha": 0.4})):
        larger = found.base.model.with_effect(effect, **start)
        c, _ = found.candidate_at([effect], larger)
        theta = c.as_without(found.base.fit.parameters(), found.base.kind)
        here = evaluated(found.short, c, theta, found.base.fit.gains)
        assert here is not None
        assert here.objective == pytest.approx(found.base.fit.objective, abs=1e-3 * abs(found.base.fit.objective))


def test_a_wave_over_an_unmeasured_position_of_several_records_is_believed_beside_noise_alone():
    more = {"wave": {**WAVE, "N": 60.0}, "coulomb_friction": {"mu": 2.0}}
    truth, base = Model.from_dict({**BASE, "effects": more}), Model.from_dict(BASE)
    drives = [replace(record(truth, n, channels=("velocity",)), source=f"{n}.csv") for n in (1, 2)]
    found = estimator_of(*prepared(base, drives[:1], drives[1:]), Criteria(), FitCache(), jobs=1)
    assert "displacement was not measured" in found.refusal(found.base, found.fitted(["cogging_torque"]))
    assert not found.refusal(found.base, found.fitted(["cogging_torque", "coulomb_friction"]))
