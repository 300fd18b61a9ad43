"""The rule by which two estimates agree, and the verdict that follows, on made-up estimates whose numbers are known."""

from __future__ import annotations

import ast
import inspect
import math
import re
import textwrap
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from signlin_ros.console.comparison import _named
from signlin_ros.diagnosis import preference, selection, single_laws, summary
from signlin_ros.diagnosis import validation as tests_module
from signlin_ros.diagnosis import verdict as verdict_module
from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
from signlin_ros.diagnosis.dataset import Dataset
from signlin_ros.diagnosis.discrimination import Doubts
from signlin_ros.diagnosis.equation_error.flexible import Curve
from signlin_ros.diagnosis.evidence import Evidence
from signlin_ros.diagnosis.family import FamilyChoice
from signlin_ros.diagnosis.output_error import FitCache, FittedModel, OutputErrorEstimator
from signlin_ros.diagnosis.output_error.score import generalizes_badly, improvement
from signlin_ros.diagnosis.pruning import without_untold
from signlin_ros.diagnosis.rows import force_percent
from signlin_ros.diagnosis.selection import Selection, select_model
from signlin_ros.diagnosis.validation import ValidationTests
from signlin_ros.diagnosis.verdict import Verdict, verdict_of
from signlin_ros.diagnosis.wording import phrases, verdicts
from signlin_ros.diagnosis.wording.reasons import REASONS
from signlin_ros.effects import EFFECTS

BLOCKS, NOISE, EFFORT, SPREAD = 40, 0.1, 10.0, 9.0


def around(level: float, seed: int) -> np.ndarray:
    """Return squares in blocks about a level (RMS), a tenth up or down."""
    return (level * np.exp(0.1 * np.random.default_rng(seed).normal(size=BLOCKS))) ** 2


@dataclass(eq=False)
class Fit:
    """A fit of the output-error estimate: ``rms`` of its error on validation data by channel, ``force`` that it
    leaves."""

    effects: tuple[str, ...]
    rms: tuple[float, ...]
    force: float
    white: bool = False
    away: dict[str, float] = field(default_factory=dict)
    fit: Any = None
    sensors: float = 0.1
    known: tuple[float, ...] = ()
    tested: bool = True
    residual: float = 0.0
    dependent: float = 0.0
    implausible: tuple[str, ...] = ()
    parameters: int = 0

    @property
    def n_parameters(self) -> int:
        return self.parameters or 2 * len(self.effects)

    @cached_property
    def log_mse(self) -> float:
        return float(np.sum(np.log(np.mean(self.validation_squares, axis=0))))

    asks_hold = False
    size, remembers, floats = FittedModel.size, FittedModel.remembers, FittedModel.floats
    training_rmse, validation_rmse = FittedModel.training_rmse, FittedModel.validation_rmse

    @property
    def model(self) -> Any:
        return self

    @property
    def residual_tests(self) -> list[Any]:
        return [
            SimpleNamespace(over_noise=self.residual, dependent=self.dependent, structured=not self.white)
            for _ in self.rms
        ]

    @property
    def training_squares(self) -> np.ndarray:
        return (
            np.column_stack([around(r, k) for k, r in enumerate(self.known)]) if self.known else self.validation_squares
        )

    @property
    def validation_squares(self) -> np.ndarray:
        return np.column_stack([around(r, 7 * len(self.effects) + k) for k, r in enumerate(self.rms)])

    @property
    def added(self) -> dict[str, Any]:
        return {}

    @property
    def noise(self) -> np.ndarray:
        return np.full(len(self.rms), self.sensors)

    @property
    def prior_deviations(self) -> dict[str, float]:
        return self.away

    @property
    def residual_is_noise(self) -> bool:
        return self.white and self.tested

    def far_from_nominal(self, criteria: Any) -> dict[str, float]:
        return {n: x for n, x in self.away.items() if abs(x) > criteria.max_tolerances_off}

    def within_noise(self, times: float) -> bool:
        return FittedModel.within_noise(self, times)


class Motion:
    """A output-error estimate with a table of fits."""

    criteria, candidates = DEFAULT_CRITERIA, frozenset(EFFECTS)

    def __init__(self, base: Fit, given: Fit | None = None, imposed: bool = False) -> None:
        self.cache = FitCache()
        self.base, self.unfitted = base, given or Fit((), tuple(10.0 * r for r in base.rms), 10.0 * base.force)
        units = {"speed": "rad/s", "current": "A"}
        channels = ("speed", "current")[: len(base.rms)]
        self.training = SimpleNamespace(
            channels=channels,
            units=units,
            shown=lambda unit: unit,
            unit_of=units.get,
            base=SimpleNamespace(
                update_period=0.2, plant=SimpleNamespace(motion_is_imposed=lambda: imposed, closed_loop=False)
            ),
            scale=SimpleNamespace(step=0.01),
            horizon=0.2,
            segments=(SimpleNamespace(y=np.outer((-SPREAD, SPREAD), np.ones(len(channels)))),),
            noise=np.full(len(channels), NOISE),
            quanta=np.zeros(len(channels)),
            allows_for_input_noise=False,
            turns=True,
        )
        self.validation = self.training

    def best(self, f: Fit) -> Fit:
        return f

    def few_waves(self, f: Fit) -> dict[str, float]:
        return {}

    def without_fit(self, model: Any) -> Fit:
        return self.unfitted

    def fitted(self, effects: Any, start: Any = None) -> Fit:
        return self.base

    def improvement(self, before: Fit, after: Fit) -> Any:
        return improvement(before.validation_squares, after.validation_squares, np.full(len(before.rms), NOISE))

    def t_ratio(self, before: Fit, after: Fit) -> float:
        return self.improvement(before, after).t_ratio

    settles, generalizes_badly = OutputErrorEstimator.settles, OutputErrorEstimator.generalizes_badly


def equation_error_stub(
    *laws: str,
    effects: tuple[str, ...] = (),
    structure: bool = False,
    flexible: float = 1.0,
    current: bool = False,
    helpful: tuple[str, ...] = (),
) -> Any:
    unseen = SimpleNamespace(noise_mse=0.01**2, effort=EFFORT, free=False, force_residual=lambda model: np.zeros(1))
    known = SimpleNamespace(pieces=[SimpleNamespace(position_measured=True)])
    visible = (DEFAULT_CRITERIA.min_force_over_noise * 0.01) ** 2
    regression = SimpleNamespace(training=known, validation=unseen, current=current, visible_mse=visible)
    nothing = Curve(False, math.inf)
    return SimpleNamespace(
        regression=regression,
        laws=dict.fromkeys(laws),
        training=known,
        validation=unseen,
        sets={frozenset(effects): SimpleNamespace(validation_residual=np.zeros(1), validation_mse=math.inf)},
        base=None,
        waves=SimpleNamespace(finest=math.inf),
        helpful=frozenset(helpful),
        structure_left=lambda fit: nothing,
        effects=effects,
        changed=lambda: {"torque_ripple": (0.05, 0.037)} if effects else {},
        flexible=Curve(structure, flexible),
        mse_as_written=lambda f: around(f.force, 0),  # what is written leaves what it leaves
        late={},
        late_beside=lambda fit, channels: {},
        with_laws=lambda fit: None,
    )


def left(*fits: Fit) -> dict[Fit, np.ndarray]:
    """Return what the fits leave of the force, as `Evidence` keeps it."""
    return {f: around(f.force, 3 * k) for k, f in enumerate(fits)}


def both(motion: Any, force: Any, *fits: Fit, tried: Any = (), kept: Any = None) -> Evidence:
    dataset = Dataset(motion.training.base, (SimpleNamespace(units={}),), motion.training, motion.validation)
    motion.cache = FitCache(weighed=list(tried), force_mse=left(*fits) if kept is None else kept)
    return Evidence(dataset, motion, force)


def chosen(force: Any, base: Fit, first: list[Fit], second: Fit) -> tuple[Fit, str]:
    return preference.preferred(both(Motion(base), force, base, *first, second), first, second)


def choice(force: Any, squares: dict[Fit, np.ndarray], motion: Any) -> FamilyChoice:
    return FamilyChoice(both(motion, force, kept=squares), force)


BASE = Fit((), (3.0,), 2.0)
LAWS = ("coulomb_friction", "stribeck_friction", "gravity_load")


def test_an_equation_error_that_finds_nothing_is_no_veto(monkeypatch):
    second = Fit(("input_delay",), (NOISE,), 1.0, white=True)
    monkeypatch.setattr(Motion, "search", lambda motion, depth, names, single: [[motion.base], [second]], raising=False)
    w = both(Motion(BASE), None)
    found = select_model(w)
    assert (found.chosen, found.conflict) == (second, "")
    assert w.percent_of_effort(w.force_mse(second)) is None


def test_a_model_that_leaves_more_force_than_the_base_is_not_selected():
    """A play follows the motion of a record with noise in its force; it takes none of that force away."""
    second = Fit(("compliant_load",), (1.0,), 2.6)
    final, conflict = chosen(equation_error_stub(*LAWS), BASE, [], second)
    assert final is BASE
    assert "compliant load" in conflict
    assert "more force" in conflict


def test_a_static_name_is_not_displaced_by_memory_that_leaves_more_force():
    first, second = Fit(("coulomb_friction",), (1.0,), 0.5), Fit(("compliant_load",), (0.4,), 1.5)
    final, conflict = chosen(equation_error_stub(*LAWS), BASE, [first], second)
    assert final is first
    assert "compliant load" in conflict


def test_an_effect_without_a_force_may_be_added_where_the_force_residual_does_not_rise():
    first = Fit(("coulomb_friction",), (1.0,), 0.5)
    second = Fit(("coulomb_friction", "input_delay"), (0.3,), 0.5)
    final, conflict = chosen(equation_error_stub(*LAWS), BASE, [first], second)
    assert final is second
    assert conflict == ""


def test_a_law_with_a_force_must_lower_the_force_residual():
    first = Fit(("coulomb_friction",), (1.0,), 0.5)
    blind = Fit(("coulomb_friction", "gravity_load"), (0.3,), 0.5)
    assert chosen(equation_error_stub(*LAWS), BASE, [first], blind)[0] is first
    seen = Fit(("coulomb_friction", "gravity_load"), (0.3,), 0.2)
    assert chosen(equation_error_stub(*LAWS), BASE, [first], seen)[0] is seen


def test_what_the_force_neither_sees_nor_names_it_does_not_veto():
    """A weight was refused three motors since 17.7 % of the effort, of which 9 % are noise, rise to 21 % with it."""
    base, law = Fit((), (3.0,), 0.018), Fit(("gravity_load",), (NOISE,), 0.022, white=True)
    assert chosen(equation_error_stub(*LAWS), base, [], law) == (law, "")
    found = judged(law, base, equation_error_stub(*LAWS))
    assert (found.label, found.percent) == ("missing", None)
    more = Fit(("gravity_load",), (1.0,), 0.022)  # what leaves more than noise is held against the force
    assert chosen(equation_error_stub(*LAWS), base, [], more)[0] is base
    named = equation_error_stub(*LAWS, effects=("coulomb_friction",))  # so is everything where the force has a name
    named.fit, named.base = SimpleNamespace(validation_mse=0.018**2), SimpleNamespace(validation_mse=0.018**2)
    assert chosen(named, base, [], law)[0] is base


def test_a_model_better_in_most_blocks_and_worse_in_all_is_not_selected():
    """A play took a motor's position from 0.0103 to 0.0124 rad, by 4.7 standard errors of logarithms of blocks."""
    first, second = Fit(("coulomb_friction",), (1.0,), 0.5), Fit(("coulomb_friction", "input_delay"), (0.3,), 0.5)
    object.__setattr__(second, "log_mse", first.log_mse + 0.1)
    assert chosen(equation_error_stub(*LAWS), BASE, [first], second)[0] is first


class Tail(Fit):
    """A fit whose second channel errs less in most blocks, and more on the whole, by more than one standard error."""

    @property
    def validation_squares(self) -> np.ndarray:
        second = np.where(np.arange(BLOCKS) % 16 == 0, 8.0, 0.8)
        return np.column_stack([around(self.rms[0], 3), second])


def test_beside_what_is_confirmed_no_printed_error_rises_beyond_its_standard_error():
    """A wave took a motor's current from 0.0226 to 0.017 A, its speed from 0.84 to 1.02 rad/s: 1.8 standard errors."""
    base = Fit((), (3.0, 3.0), 2.0)
    first = Fit(("coulomb_friction",), (1.0, 1.0), 0.5)
    second = Tail(("coulomb_friction", "input_delay"), (0.3, 1.0), 0.5)
    w = both(Motion(base), equation_error_stub(*LAWS), base, first, second)
    assert second.log_mse < first.log_mse
    assert not w.rising_channel(first, second, DEFAULT_CRITERIA.max_rise_t)
    assert w.rising_channel(first, second, 1.0) == "current"
    assert chosen(equation_error_stub(*LAWS), base, [first], second)[0] is first


def test_what_the_force_shows_and_the_motion_refuses_is_told_and_not_replaced():
    """A motor that its own waves throw about: a load on a coupling and a late sensor took the place of seven waves."""
    force = equation_error_stub(*LAWS, effects=("torque_ripple",))
    force.fit, force.base = SimpleNamespace(validation_mse=0.3), SimpleNamespace(validation_mse=4.0)
    final, conflict = chosen(force, BASE, [], Fit(("compliant_load", "sensor_delay"), (1.0,), 1.9))
    assert final is BASE
    for name in ("torque ripple", "compliant load", "sensor delay", "0.05 in the training and 0.037 in the validation"):
        assert name in conflict
    white = Fit(("input_delay",), (NOISE,), 1.9, white=True)
    assert chosen(force, BASE, [], white) == (white, "")
    as_good = Fit(("compliant_load",), (1.0,), 0.5)
    assert chosen(force, BASE, [], as_good) == (as_good, "")


def test_a_richer_model_that_gains_nothing_gains_nothing():
    first = Fit(("coulomb_friction",), (1.0,), 0.5)
    same = Fit(("coulomb_friction", "input_delay"), (1.0,), 0.5)
    assert chosen(equation_error_stub(*LAWS), BASE, [first], same)[0] is first


# ---------------------------------------------------------------- the verdict


class Asking(Motion):
    """A output-error estimate for which a model is a step beyond another one if it is surely better."""

    def refusal(self, before: Fit, after: Fit) -> str:
        return "" if self.t_ratio(before, after) > DEFAULT_CRITERIA.min_t else "no step"

    def as_good(self, best: Fit, other: Fit) -> bool:
        return self.t_ratio(other, best) < DEFAULT_CRITERIA.tie_t


def test_of_what_is_as_good_the_one_with_the_fewest_parameters_is_named():
    """A wave of order nine, or a loop, over 0.6 of its period stood for a constant load."""
    wave = Fit(("bouc_wen_hysteresis",), (1.0,), 1.0, parameters=3)
    load = Fit(("constant_load",), (1.0,), 1.0, parameters=1)
    w = both(Asking(BASE), equation_error_stub(), BASE, wave, load, tried=[load])
    assert selection.reduced(w, wave).effects == ("constant_load",)


@pytest.mark.parametrize(("rms", "taken"), [(0.9, "coulomb_friction"), (1.5, "stribeck_friction")])
def test_the_simpler_law_that_is_as_good_is_named(rms, taken):
    """LuGre friction that could not be told from Stribeck's hid Coulomb friction, which erred less."""
    richer = Fit(("stribeck_friction",), (1.0,), 1.0, parameters=3)
    simpler = Fit(("coulomb_friction",), (rms,), 1.0, parameters=1)
    w = both(Asking(BASE), equation_error_stub(), BASE, richer, simpler, tried=[simpler])
    assert selection.reduced(w, richer).effects == (taken,)


class Judged:
    """A verdict with what both estimates measure."""

    def __init__(self, w: Evidence, final: Fit, conflict: str = "") -> None:
        self.evidence, self.values = w, verdict_of(w, Selection(final, conflict))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.values, name)

    @property
    def sentence(self) -> str:
        return verdicts.sentence(self.evidence, self.values)


def judged(final: Fit, base: Fit = BASE, force: Any = None, conflict: str = "", given: Fit | None = None) -> Judged:
    return Judged(both(Motion(base, given), force, base, final), final, conflict)


def told(w: Evidence, final: Fit) -> Verdict:
    """Return the verdict on a model that both estimates arrived at, or on the one without it."""
    return without_untold(w, verdict_of(w, Selection(final)))


@pytest.fixture(autouse=True)
def no_sign_is_wrong(monkeypatch):
    monkeypatch.setattr(Dataset, "noise", property(lambda self: dict.fromkeys(self.training.channels, NOISE)))
    monkeypatch.setattr(tests_module, "reversed_signal", lambda problem, base, final: "")
    monkeypatch.setattr(tests_module, "changing", lambda r, left, own: "")
    monkeypatch.setattr(ValidationTests, "same_at_nominal", lambda t: False)


@pytest.mark.parametrize(("without", "verdict"), [(0.4, "unexplained"), (1.0, "missing")])
def test_each_of_several_laws_takes_force_away(without, verdict, monkeypatch):
    """A servo was said to lack a stop, and a viscous friction without which no more of its force was left."""
    final = Fit(("coulomb_friction", "gravity_load"), (0.5,), 0.4)
    rest = {n: Fit((n,), (1.0,), x) for n, x in (("gravity_load", without), ("coulomb_friction", 1.5))}
    monkeypatch.setattr(ValidationTests, "without", lambda t, n: rest[next(m for m in final.effects if m != n)])
    force = equation_error_stub(*LAWS, effects=final.effects)
    w = both(Motion(BASE), force, BASE, final, *rest.values())
    assert verdict_of(w, Selection(final)).label == verdict


COULOMB = Fit(("coulomb_friction",), (0.5,), 0.4)


def sees(**options: Any) -> Any:
    return equation_error_stub(*LAWS, effects=("coulomb_friction",), **options)


def test_an_effect_of_both_estimates_is_missing_though_something_is_left():
    found = judged(COULOMB, force=sees())
    assert found.evidence.force_shows(found.final)
    assert not found.final.white
    assert found.label == "missing"


def test_what_is_found_with_a_far_parameter_held_at_nominal_too_is_missing(monkeypatch):
    monkeypatch.setattr(ValidationTests, "same_at_nominal", lambda t: True)
    found = judged(Fit(("coulomb_friction",), (0.5,), 0.4, away={"c": -5.1}), force=sees())
    assert found.label == "missing"
    assert found.sentence.startswith("Check this first: c ends 5.1 tolerances")


@pytest.mark.parametrize(("rms", "ties"), [(0.5, ("dahl_presliding",)), (0.9, ())])
def test_laws_that_only_forces_do_not_tell_apart_are_no_tie(rms, ties):
    """Coulomb friction was told with three richer laws that forces below a cut-off did not tell from it."""
    other, force = Fit(("dahl_presliding",), (rms,), 0.4), sees()
    force.ties = {"coulomb_friction": ("dahl_presliding",)}
    w = both(Asking(BASE), force, BASE, COULOMB, other, tried=[COULOMB, other])
    assert summary._ties(w, verdict_of(w, Selection(COULOMB)), "coulomb_friction") == ties


@pytest.mark.parametrize(("without", "label"), [(5.1, "unexplained"), (4.9, "missing"), (-5.1, "missing")])
def test_a_base_that_crosses_to_the_other_side_of_nominal_confirms_nothing(without, label, monkeypatch):
    """A resistance that is negative at small speed was called cubic viscous friction, with a viscosity that ended 15
    tolerances below what was known, and without it 26 above.
    """
    monkeypatch.setattr(ValidationTests, "same_at_nominal", lambda t: True)
    base = Fit((), BASE.rms, BASE.force, away={"c": without})
    found = judged(Fit(("coulomb_friction",), (0.5,), 0.4, away={"c": -5.1}), base, force=sees())
    assert found.label == label


@pytest.mark.parametrize(("force", "why"), [(0.45 * EFFORT, ""), (0.55 * EFFORT, "structure")])
def test_what_leaves_most_of_the_effort_explains_a_part(force, why):
    """A weight that was called two springs: the missing force falls from 278 % of the effort to 77.9 %."""
    base = Fit((), (3.0,), 3.0 * EFFORT)
    j = judged(
        Fit(("linear_stiffness",), (1.0,), force), base, force=equation_error_stub(effects=("linear_stiffness",))
    )
    assert j.reason == why
    if why:
        assert "explains a part" in j.sentence


@pytest.mark.parametrize(
    ("percent", "dependent", "why"), [(12.0, 0.15, "structure"), (12.0, 0.01, ""), (4.0, 0.15, "")]
)
def test_what_leaves_more_that_goes_with_the_motion_explains_a_part(percent, dependent, why):
    """A coil whose force constant falls with its position was said to lack a cubic spring and a saturation, beside
    13.6 % of the effort.
    """
    final = Fit(("linear_stiffness",), (1.0,), percent / 100.0 * EFFORT, dependent=dependent)
    j = judged(final, Fit((), (3.0,), 0.9 * EFFORT), force=equation_error_stub(effects=final.effects))
    assert j.reason == why


@pytest.mark.parametrize(("rms", "why"), [(0.04, ""), (0.06, "structure"), (0.55, "structure")])
def test_what_leaves_a_visible_part_of_an_imposed_force_explains_a_part(rms, why, monkeypatch):
    """A tribometer whose load cell rings: Coulomb friction left 54.7 % of the spread, of which no word was said."""
    base, final = Fit((), (SPREAD,), 1.0), Fit(("coulomb_friction",), (rms * SPREAD,), 1.0)
    monkeypatch.setattr(Dataset, "_swings", [])
    j = Judged(both(Motion(base, imposed=True), None, base, final), final)
    assert j.reason == why
    assert f"{j.imposed:.3g} % of the spread of the force is left" in j.sentence


@pytest.mark.parametrize(("percent", "times"), [(60.0, "6"), (2000.0, "over 100")])
def test_how_far_above_the_noise_is_told_as_far_as_it_tells(percent, times):
    seen = SimpleNamespace(force_noise_percent=10.0, of_effort="of the effort", criteria=DEFAULT_CRITERIA)
    curve = SimpleNamespace(visible=False, percent=25.0, along="")
    j = SimpleNamespace(percent=percent, names=(), final=None, flexible=curve, changing="")
    assert verdicts.remainder(seen, j).endswith(f"of the effort, {times} times what the sensors' noise makes of it.")


def test_near_the_sensors_noise_what_is_left_must_be_noise():
    near = Fit(("coulomb_friction",), (0.5,), 0.4, sensors=0.4, residual=1.0)
    assert judged(near, force=sees()).reason == "structure"
    assert judged(replace(near, white=True), force=sees()).label == "missing"


@pytest.mark.parametrize(("steps", "why"), [(2.5, ""), (1.5, "structure")])
def test_or_be_the_steps_of_the_sensor(steps, why):
    """Coulomb friction took the error of an encoder's position from 0.67 rad to its step, and was called a part."""
    final = Fit(("coulomb_friction",), (0.5,), 0.4, sensors=0.4, residual=1.0)
    w = both(Motion(BASE), sees(), BASE, final)
    w.dataset.training.quanta = np.full(1, steps * NOISE)
    assert verdict_of(w, Selection(final)).reason == why


def test_an_effect_that_validation_data_cannot_decide_on_is_dropped(monkeypatch):
    """A spring with 0.24 % of the effort left was "unexplained", for a hysteresis that one reversal does not tell."""
    monkeypatch.setattr(ValidationTests, "no_better", True)
    noise, hysteresis = Fit((), (NOISE,), 0.01, white=True), Fit(("dahl_presliding",), (NOISE,), 0.01, white=True)
    found = told(both(Motion(noise), sees(), noise, hysteresis), hysteresis)
    assert (found.label, found.final, found.selection.untold) == ("adequate", noise, "given")
    found = told(both(Motion(BASE), None, BASE, COULOMB), COULOMB)
    assert (found.label, found.final, found.selection.untold) == ("unexplained", COULOMB, "")


@pytest.mark.parametrize(("error", "verdict"), [(0.97, "adequate"), (0.8, "missing")])
def test_a_part_of_the_sensors_noise_has_no_name(error, verdict):
    """A pendulum whose encoder has steps of a degree: a wave and an offset took 4 % of their size away."""
    noise = Fit((), (0.99 * NOISE,), 0.011)
    waves = Fit(("cogging_torque", "sensor_offset"), (error * 0.99 * NOISE,), 0.011, white=True)
    found = told(both(Motion(noise), sees(), noise, waves), waves)
    assert found.label == verdict
    assert found.final is (noise if verdict == "adequate" else waves)


def test_a_force_that_changes_along_the_record_is_told(monkeypatch):
    monkeypatch.setattr(tests_module, "changing", lambda r, left, own: "dry friction")
    assert judged(COULOMB, force=sees()).reason == "structure"


@pytest.mark.parametrize(
    ("final", "force", "conflict", "why"),
    [
        (COULOMB, sees(), "they differ", "conflict"),
        (Fit(("coulomb_friction",), (0.5, 1.2), 0.4), sees(), "", "worse"),
        (Fit(("coulomb_friction",), (0.5,), 0.4, away={"K_m": 45.0}), sees(), "", "far"),
        (COULOMB, sees(structure=True, flexible=0.5), "", "structure"),
        (Fit(("coulomb_friction",), (2.0,), 0.4), None, "", "structure"),
    ],
    ids=["the estimates differ", "a channel gets worse", "a known parameter is far", "a curve", "no force is seen"],
)
def test_why_a_record_is_not_explained(final, force, conflict, why):
    base = Fit((), (3.0, 1.0)[: len(final.rms)], 2.0)
    found = judged(final, base, force, conflict)
    assert found.reason == why
    assert found.label == "unexplained"


SAID = {
    "conflict": "The two estimates differ: they differ. Nothing is confirmed.",
    "lost": "speed",
    "worse": "Coulomb friction would lower an error, but that of speed rises on validation data: nothing is confirmed.",
    "given": "rad/s, but the error falls by 1.2 standard errors beside the model as given, which is too little",
    "once": "but the motion turns back only once in a record",
    "noise": "Coulomb friction explains a part: on validation data",
    "far": "but only with base parameters that far from nominal.",
    "elsewhere": "but the model follows the data it was fitted to far better than the unseen ones: there it is faster",
    "loop": "what is there is hysteresis (Dahl presliding, play friction, LuGre friction, Bouc-Wen hysteresis, ",
    "structure": "Coulomb friction explains a part: on validation data",
    "reversed": "With the sign of speed reversed",
}


def test_every_reason_has_its_row():
    sources = (verdict_module.reason_of, verdict_module._reason_by_force, verdict_module._reason_by_motion)
    returns = [n for f in sources for n in ast.walk(ast.parse(textwrap.dedent(inspect.getsource(f))))]
    constants = [c for r in returns if isinstance(r, ast.Return) for c in ast.walk(r) if isinstance(c, ast.Constant)]
    assert {c.value for c in constants} - {""} == set(REASONS) == set(SAID)


@pytest.mark.parametrize("why", REASONS)
def test_every_reason_is_told(why, monkeypatch):
    monkeypatch.setattr(verdicts, "further", lambda case: "there it is faster.")
    monkeypatch.setattr(verdicts, "why_named", lambda w, v, effect: "")
    monkeypatch.setattr(verdicts, "own_parameters", lambda f, effect: {})
    monkeypatch.setattr(summary, "row", lambda w, f, left: SimpleNamespace(validation=None))
    j = judged(COULOMB, force=sees(), conflict="they differ")
    found = {"reason": why, "worse": "speed", "beside_given": 1.23, "lost": ("speed",), "label": "unexplained"}
    found["loop"] = "coulomb_friction" if why == "loop" else ""
    v = replace(j.values, **found, reversed="speed" if why == "reversed" else "")
    assert SAID[why] in verdicts.sentence(j.evidence, v)
    assert summary._named(j.evidence, v, "coulomb_friction", (), Doubts()).status == {"loop": "ambiguous"}.get(
        why, "rejected" if REASONS[why].rejects else "confirmed"
    )


@pytest.mark.parametrize(
    ("percent", "changing", "told"),
    [
        (35.0, "", "and which loop it is cannot be told."),
        (35.0, "loop of Dahl presliding", "whose force changes slowly along the record, as that of what degrades."),
        (20.0, "", ""),
    ],
)
def test_a_loop_that_leaves_more_than_a_quarter_of_the_effort_is_one_of_its_family(
    percent, changing, told, monkeypatch
):
    """Two cyclic tests were said to lack Dahl's law with 29 and 38 % of the effort left."""
    monkeypatch.setattr(tests_module, "changing", lambda r, left, own: changing)
    monkeypatch.setattr(Dataset, "turns_once", property(lambda self: False))
    base, left = Fit((), (3.0,), 0.9 * EFFORT), percent / 100.0 * EFFORT
    final = Fit(("dahl_presliding",), (0.5,), left)
    found = judged(final, base, equation_error_stub(*LAWS, effects=final.effects))
    assert (found.reason, found.loop) == (("loop", "dahl_presliding") if told else ("", ""))
    assert told in found.sentence


@pytest.mark.parametrize(
    ("rms", "known", "why"),
    [(0.6, 0.6, ""), (2.0, 2.0, "structure"), (2.0, 0.1, "elsewhere"), (0.6, 0.1, ""), (0.15, 0.01, "")],
    ids=["most of it", "half of it", "only what was fitted to", "most of both", "near the noise"],
)
def test_where_the_force_does_not_tell_the_motion_must(rms, known, why, monkeypatch):
    """A gear motor in a loop that chatters: "compliant load", 88 times the noise, 16 times what was fitted to. But what
    takes most of an error away on validation data, too, is not refused for following the known ones better still.
    """
    final = Fit(("compliant_load",), (rms,), 1.0, white=True)
    squares = Fit(final.effects, (known,), 1.0).validation_squares
    monkeypatch.setattr(Fit, "training_squares", property(lambda f: squares if f is final else f.validation_squares))
    found = judged(final)
    assert (found.label, found.reason) == ("unexplained" if why else "missing", why)


@pytest.mark.parametrize(
    ("other", "white", "why"), [(0.9, True, ""), (8.0, True, "structure"), (0.9, False, "structure")]
)
def test_and_a_part_of_what_all_channels_lack_and_no_structure(other, white, why):
    """An inertia that varies along the way was called backlash: it halved the position's error, 5 times the noise, and
    left the current's and the speed's, 9 times theirs. Of Coulomb friction in a pattern, by a speed alone, Stribeck
    friction left 17 % of the spread, which was no noise.
    """
    final = Fit(("compliant_load",), (0.6, other), 1.0, white=white)
    assert judged(final, Fit((), (3.0, 8.0), 2.0)).reason == why


@pytest.mark.parametrize(("force", "verdict"), [(0.0006, "missing"), (0.02, "unexplained")])
def test_what_leaves_a_hundredth_of_the_force_is_missing_whatever_that_is(force, verdict):
    """A vertical axis: weight and friction left 0.6 of 71 % of the effort, and were told to explain a part."""
    base, final = Fit((), (450.0 * NOISE,), 0.71), Fit(("coulomb_friction",), (12.0 * NOISE,), force)
    assert judged(final, base, equation_error_stub(*LAWS, effects=final.effects)).label == verdict


@pytest.mark.parametrize(("current", "verdict"), [(1.3, "missing"), (2.7, "unexplained")])
def test_or_a_hundredth_of_each_error_that_is_beyond_about_its_noise(current, verdict):
    """Coulomb friction took the error of a speed without noise from 7,200 steps to 45, and was called a part since the
    current's was 1.02 times its noise.
    """
    base = Fit((), (700.0 * NOISE, 4.0 * NOISE), 0.175)
    final = Fit(("coulomb_friction",), (4.5 * NOISE, current * NOISE), 0.02)
    assert judged(final, base, equation_error_stub(*LAWS, effects=final.effects)).label == verdict


@pytest.mark.parametrize(("white", "verdict"), [(True, "missing"), (False, "unexplained")])
def test_where_all_visible_force_is_explained_the_motion_need_not_halve_if_its_residual_is_noise(white, verdict):
    """A valve whose torque was sampled: stiction took 80 % of the effort to 2.5 %, the motion from 110 to 64 times."""
    base = Fit((), (110.0 * NOISE,), 0.80)
    final = Fit(("stribeck_friction",), (64.0 * NOISE,), 0.02, white=white)
    assert judged(final, base, equation_error_stub(*LAWS, effects=final.effects)).label == verdict


@pytest.mark.parametrize(
    ("effect", "residual", "unseen", "verdict"),
    [("sensor_gain", 20.0, 3.5, "missing"), ("sensor_gain", 20.0, 4.5, "unexplained"),
     ("sensor_gain", 5.0, 3.5, "unexplained"), ("backlash", 20.0, 3.5, "unexplained")],
    ids=["its noise", "worse unseen", "gathers over the horizon", "floats"],
)  # fmt: skip
def test_the_noise_of_a_sensor_does_not_gather_over_the_horizon(effect, residual, unseen, verdict):
    """Coloured noise is four to six times what neighbouring samples tell of it."""
    final = Fit((effect,), (unseen,), 1.0, white=True, known=(3.5,), residual=residual)
    found = judged(final, Fit((), (6.0,), 10.0))
    assert found.label == verdict, found.reason


def test_a_channel_that_gets_worse_by_what_no_table_shows_forbids_nothing():
    base, final = Fit((), (3.0, 1.0), 2.0), Fit(("coulomb_friction",), (0.5, 1.002), 0.4)
    assert judged(final, base, sees()).worse == ""


def test_a_force_that_rises_forbids_a_name_and_is_not_told_to_fall():
    """A bench under a random current: "falls from 35.6 % to 38.6 %"."""
    found = judged(Fit(("coulomb_friction",), (0.5,), 2.4), BASE, sees())
    assert found.worse == "the missing force"
    assert found.label == "unexplained"
    assert "missing force falls" not in found.sentence


@pytest.mark.parametrize(
    ("rms", "force", "seen", "why"),
    [(0.5, 0.4, True, "given"), (0.5, 0.4, False, "given"), (3.0, 0.4, True, ""), (0.5, 2.0, True, "")],
    ids=["as good", "as good in the motion alone", "worse motion", "more force left"],
)
def test_what_is_gained_beside_a_refitted_base_alone_is_nothing_gained(rms, force, seen, why):
    """A gear turned by hand: refitted 0.208 N m on validation data, with Dahl's friction 0.186, as given 0.183."""
    given = Fit((), (rms,), force)
    found = judged(COULOMB, force=sees() if seen else None, given=given)
    assert (found.reason == "given") is (why == "given")
    if why:
        assert "standard errors beside the model as given, which is too little: nothing is confirmed" in found.sentence


@pytest.mark.parametrize(("tested", "verdict"), [(True, "adequate"), (False, "unexplained")])
def test_a_large_force_is_noise_only_if_that_was_tested(tested, verdict):
    """Some two hundred samples of a damper, 42 % of whose force was left and "nothing was missing"."""
    final = Fit((), (5 * NOISE,), 0.42 * EFFORT, white=True, tested=tested)
    assert judged(final, final, sees()).label == verdict


def test_a_name_that_frees_a_base_parameter_alone_says_which():
    base = Fit((), (NOISE,), 0.005, white=True, away={"k": 4.6})
    final = Fit(("linear_stiffness",), (NOISE,), 0.005, white=True, away={"k": 0.2})
    assert (
        verdicts.freed(base, final)
        == ", but without it k ends 4.6 tolerances from its nominal value: either may be off"
    )
    assert verdicts.freed(base, base) == ""


def test_noise_has_a_size_of_its_own_in_every_record():
    squares = [np.full((5, 1), size**2) for size in (3.0, 9.0)]
    same, larger = np.ones(1), np.full(1, 3.0)
    assert generalizes_badly(*squares, same, same, DEFAULT_CRITERIA.max_rmse_over_noise)
    assert not generalizes_badly(*squares, same, larger, DEFAULT_CRITERIA.max_rmse_over_noise)


def test_a_sign_that_is_wrong_goes_before_everything(monkeypatch):
    monkeypatch.setattr(tests_module, "reversed_signal", lambda problem, base, final: "speed")
    found = judged(COULOMB, force=sees())
    assert found.reason == "reversed"
    assert "the sign of speed reversed" in found.sentence


def test_noise_is_adequate_whoever_sees_it():
    noise = Fit((), (NOISE,), 0.005, white=True)
    for force in (None, equation_error_stub(*LAWS)):
        found = judged(noise, noise, force)
        assert found.label == "adequate"


def test_what_follows_nothing_is_not_adequate_however_noisy_its_channel():
    """Two publishers in one channel: what they leave is as white as noise, and as large as the motion."""
    nothing = Fit((), (0.7 * SPREAD,), 0.005, white=True)
    found = judged(nothing, nothing, equation_error_stub(*LAWS))
    assert found.label == "unexplained"
    assert found.sentence.startswith("The speed fits no model")


def test_a_large_force_that_nothing_takes_away_is_not_adequate():
    odd = Fit((), (3.0,), 0.1 * EFFORT)
    assert judged(odd, odd, equation_error_stub(*LAWS)).label == "unexplained"


@pytest.mark.parametrize(
    ("rms", "white", "verdict"),
    [
        (0.04 * SPREAD, True, "adequate"),
        (0.04 * SPREAD, False, "unexplained"),
        (0.06 * SPREAD, False, "unexplained"),
    ],
)
def test_a_motion_that_is_followed_badly_is_not_adequate_for_its_little_force(rms, white, verdict):
    """A motor in steps: 2 % of the effort left, and its speed errs by ten times its sensor's noise, a tenth of it. A
    vibrating mass: 4 % of the effort, and its place errs by nine times that noise, with structure.
    """
    odd = Fit((), (rms,), 0.03 * EFFORT, white=white)
    assert judged(odd, odd, equation_error_stub(*LAWS)).label == verdict


# ---------------------------------------------------------------- words


def numbers(text: str) -> list[float]:
    return [float(x) for x in re.findall(r"(?<![\w.])-?\d+\.?\d*(?:e[+-]?\d+)?", text)]


def in_the_tables(j: Judged) -> set[str]:
    """Return every number that a table of the diagnosis shows, to three digits: errors, forces, noise, tolerances."""
    fits, motion = (j.base, j.final), j.evidence.output_error
    rms = [float(x) for f in fits for x in np.sqrt(np.mean(f.validation_squares, axis=0))]
    forces = [p for f in fits if (p := force_percent(j.evidence, f, j.final)) is not None]
    noise = j.evidence.force_noise_percent
    more = [j.evidence.dataset.horizon, noise, j.flexible.percent, *(abs(x) for x in j.far.values())]
    assert motion.training.channels
    return {f"{x:.3g}" for x in (*rms, *forces, *more, *(p / noise for p in forces))}


@pytest.mark.parametrize(
    ("final", "force", "conflict"),
    [
        (COULOMB, sees(), ""),
        (COULOMB, sees(structure=True, flexible=0.5), ""),
        (COULOMB, sees(), "input delay would follow the motion better"),
        (Fit(("coulomb_friction",), (0.5,), 0.4, away={"K_m": 45.0}), sees(), ""),
        (Fit((), (NOISE,), 0.005, white=True), equation_error_stub(*LAWS), ""),
        (Fit((), (3.0,), 1.5), equation_error_stub(*LAWS, structure=True, flexible=2.0), ""),
    ],
    ids=["missing", "a curve", "conflict", "far", "adequate", "unexplained"],
)
def test_every_number_in_a_sentence_is_in_the_tables(final, force, conflict):
    j = judged(final, final if not final.effects else BASE, force, conflict)
    said = numbers(j.sentence)
    shown = in_the_tables(j)
    assert [x for x in said if f"{x:.3g}" not in shown] == []
    assert said or conflict


def test_a_sentence_names_what_falls_and_by_how_much():
    j = judged(COULOMB, force=sees())
    text = j.sentence
    assert text.startswith("The model lacks Coulomb friction: on validation data the missing force falls from ")
    assert "the error of speed over 0.2 s from " in text
    a, b = numbers(text)[:2]
    assert b < a


def test_by_how_much_an_error_rises_or_falls_and_what_is_asked():
    """ "Rejected: falls by 2.6 standard errors" read like praise, "falls by -14.1" like nothing."""
    assert phrases.change(2.6, 3.5) == "the error on validation data falls by 2.6 standard errors, 3.5 are asked"
    assert phrases.change(-0.01, 3.5) == "the error on validation data falls by 0.0 standard errors, 3.5 are asked"
    assert phrases.change(-14.1, 3.5) == "the error on validation data rises by 14.1 standard errors"


@pytest.mark.parametrize(("verdict", "told"), [("unexplained", "explains a part"), ("missing", "confirmed")])
def test_what_explains_a_part_is_not_called_confirmed(verdict, told):
    """ "UNEXPLAINED: backlash explains a part", and "backlash: confirmed" below it."""
    entry = {"effect": "backlash", "status": "confirmed", "why": "falls", "indistinguishable_from": []}
    content = {"verdict": verdict, "ranking": [entry], "ladder": [{"effects": ["backlash"]}], "experiments": []}
    assert _named(content) == f"backlash: {told}\n    falls"
    entry["status"] = "rejected"  # "explains a part" in the headline, and "rejected" below it
    assert _named(content) == f"backlash: {'not confirmed' if verdict == 'unexplained' else 'rejected'}\n    falls"


def test_what_is_as_good_stands_under_what_is_named_with_what_would_decide():
    """A bellows: "cubic stiffness: ambiguous", and no word of what else it might be."""
    tie = {"effect": "hard_stop", "status": "ambiguous", "why": "as good", "indistinguishable_from": ["backlash"]}
    entry = {"effect": "backlash", "status": "ambiguous", "why": "falls", "indistinguishable_from": ["hard_stop"]}
    told = ["to decide on hard stop: go to the ends", "to see input deadzone: ramp the input"]
    content = {
        "verdict": "missing",
        "ranking": [entry, tie],
        "ladder": [{"effects": ["backlash"]}],
        "experiments": told,
    }
    assert _named(content) == f"backlash: ambiguous\n    falls\n    as good in its place: hard stop\n{told[0]}"


def test_what_is_left_is_told_where_the_noise_of_the_force_is_not_known():
    """A current that was held: "falls from 79.2 % to 25.3 %", and no word of the 25.3 %."""
    seen = SimpleNamespace(
        force_noise_percent=0.0, force_shows=lambda f: True, of_effort="of the effort", criteria=DEFAULT_CRITERIA
    )
    curve = SimpleNamespace(visible=False, percent=25.0, along="")
    j = SimpleNamespace(percent=25.3, names=(), final=None, flexible=curve, changing="")
    assert verdicts.remainder(seen, j) == " What is left is 25.3 % of the effort."
    seen.force_noise_percent = 10.0
    assert verdicts.remainder(seen, j).endswith("of the effort, 2.53 times what the sensors' noise makes of it.")


@pytest.mark.parametrize(
    ("clean", "curve", "told"),
    [
        (
            True,
            2.0,
            "; 0.4 % of what the motion lacks goes with position, velocity, input or time",
        ),
        (False, 2.92, "; a flexible curve would leave 2.92 %"),
        (False, 3.5, "; no flexible curve takes it away"),
    ],
)
def test_why_more_than_the_sensors_noise_counts_as_noise(clean, curve, told):
    """ "Adequate: the force that is left is 2.93 % of the effort, the sensors' noise 0.796 %", and not why."""
    left = [SimpleNamespace(dependent=0.001), SimpleNamespace(dependent=0.004)]
    final = SimpleNamespace(residual_is_noise=clean, residual_tests=left, validation_rmse=np.array([0.03, 0.46]))
    sensors = {"current": 0.01, "speed": 0.1}
    channels = SimpleNamespace(channels=("current", "speed"), allows_for_input_noise=False)
    dataset = SimpleNamespace(horizon=0.2, training=channels, noise=sensors)
    seen = SimpleNamespace(
        force_noise_percent=0.796,
        near_noise=lambda f: False,
        near_any_noise=lambda f: False,
        force_shows=lambda f: True,
        criteria=DEFAULT_CRITERIA,
        of_effort="of the effort",
        dataset=dataset,
    )
    shown = {
        "names": (),
        "refused": "",
        "reversed": "",
        "far": {},
        "label": "adequate",
        "selection": Selection(final),
        "alone": False,
    }
    j = SimpleNamespace(percent=2.93, final=final, flexible=SimpleNamespace(percent=curve), **shown)
    errs = "Over 0.2 s, speed errs by 4.6 times its sensor's noise."
    said = verdicts.sentence(seen, j)
    assert said.endswith(f"is 2.93 % of the effort, the sensors' noise 0.796 %{told}. {errs}")
    assert said.startswith(verdicts.NOTHING_MISSING if clean else "What is missing is small, and no listed effect")


@pytest.mark.parametrize(
    ("percent", "noise", "begins"),
    [
        (20.9, True, verdicts.LIKE_NOISE),
        (3.0, True, verdicts.NOTHING_MISSING),
        (3.0, False, verdicts.LITTLE_MISSING),
    ],
)
def test_the_words_of_an_adequate_model_go_with_its_numbers(percent, noise, begins):
    """ "Nothing is missing that this record could show: 20.9 % of the effort, the sensors' noise 0.861 %"."""
    seen = SimpleNamespace(
        near_any_noise=lambda f: False, force_shows=lambda f: percent > 2.0, criteria=DEFAULT_CRITERIA
    )
    shown = SimpleNamespace(percent=percent, final=SimpleNamespace(residual_is_noise=noise))
    assert verdicts._how_little(seen, shown) == begins


@pytest.mark.parametrize(("size", "differs"), [(2.0, True), (1.6, True), (1.3, False)])
def test_unseen_data_that_reach_further_are_told(size, differs):
    """A pier that was pushed 7.7 mm, and 15 in the record that was held back: "what differs?"."""
    t = np.arange(50.0)
    known, unseen = (
        SimpleNamespace(measured={"displacement": a * 7.7e-3 * np.sin(t)}, inputs=("force",), u=np.cos(t)[:, None])
        for a in (1.0, size)
    )
    problems = [SimpleNamespace(parts=(part,), unit_of=lambda name: "m") for part in (known, unseen)]
    text = verdicts.further(SimpleNamespace(training=problems[0], validation=problems[1]))
    assert bool(text) is differs
    if differs:
        assert text.startswith("there displacement goes from -0.01")
        assert text.endswith("m, in those from -0.0077 to 0.0077 m.")


@pytest.mark.parametrize(("certainty", "told"), [(3.14, True), (1.9, True), (-0.2, False), (3.6, False)])
def test_what_would_take_most_away_but_not_surely_is_told_with_the_number_of_its_row(certainty, told, monkeypatch):
    """A leg's joint of 2 s: "no listed effect explains" beside Coulomb friction at 3.2 of 3.5 standard errors."""
    monkeypatch.setattr(Motion, "t_ratio", lambda self, before, after: certainty, raising=False)
    monkeypatch.setattr(Fit, "size", 1, raising=False)
    odd = Fit((), (3.0,), 0.1 * EFFORT)
    j = judged(odd, odd, equation_error_stub(*LAWS))
    j.evidence.cache.keep(COULOMB)
    text = j.sentence
    assert ("Too little was recorded to tell what is missing: Coulomb friction would" in text) is told
    assert (f"falls by {certainty:.1f} standard errors, 3.5 are asked" in text) is told


def test_a_parameter_that_is_far_is_told_first():
    far = Fit(("coulomb_friction",), (0.5,), 0.4, away={"K_m": 45.0})
    text = judged(far, force=sees()).sentence
    assert text.startswith("Check this first: K_m ends 45.0 tolerances from its nominal value.")
    assert "The model lacks" not in text


def test_a_curve_that_would_take_more_away_is_offered():
    text = judged(COULOMB, force=sees(structure=True, flexible=0.5)).sentence
    assert "would leave 0.5 %" in text
    assert "add learned_force" in text


# ---------------------------------------------------------------- what the input lacks, beside what the force shows


class Refusing(Motion):
    """A output-error estimate that asks for an effect of the input before it follows anything."""

    def __init__(self, base: Fit, fits: dict[frozenset[str], Fit]) -> None:
        super().__init__(base)
        self.fits, self.asked = fits, list[tuple[str, ...]]()

    def fitted(self, effects: Any, start: Any = None) -> Fit:
        return self.fits[frozenset(effects)]

    def extensions(self, of: Fit, names: Any, rival: Any = None, share: float | None = None) -> list[Fit]:
        self.asked.append(tuple(names))
        return [f for key, f in self.fits.items() if len(key - set(of.effects)) == 1 and key > set(of.effects)]

    def refusal(self, before: Fit, after: Fit) -> str:
        g = self.improvement(before, after)
        return "" if g.t_ratio >= DEFAULT_CRITERIA.min_t else "too little"

    def as_good_as_best(self, before: Fit, options: list[Fit]) -> list[Fit]:
        good = [f for f in options if not self.refusal(before, f)]
        return sorted(good, key=lambda f: f.rms[0])[:1]


def with_limit(together: float, limit: float) -> Refusing:
    """Return a output-error estimate for which friction alone is nothing, and a limit of the input not enough."""
    fits = (
        Fit(("coulomb_friction",), (3.0,), 0.5),
        Fit(("input_saturation",), (limit,), 2.0),
        Fit(("coulomb_friction", "input_saturation"), (together,), 0.5),
    )
    return Refusing(BASE, {frozenset(f.effects): replace(f, fit=None) for f in fits})


@pytest.fixture
def any_effect(monkeypatch):
    monkeypatch.setattr(Motion, "candidates", frozenset({"input_saturation"}))


@pytest.mark.usefixtures("any_effect")
def test_a_limit_of_the_input_is_sought_beside_friction_that_the_motion_refuses_alone():
    motion = with_limit(together=0.3, limit=1.0)
    tried = [motion.fits[frozenset({"coulomb_friction"})]]
    together = selection._with_unseen_effect(both(motion, None, tried=tried), tried[0])
    assert together is motion.fits[frozenset({"coulomb_friction", "input_saturation"})]
    assert motion.asked == [("input_saturation",)]


@pytest.mark.usefixtures("any_effect")
@pytest.mark.parametrize("limit", [0.3, 0.2])
def test_what_the_motion_does_not_need_beside_the_limit_is_not_named(limit):
    motion = with_limit(together=0.3, limit=limit)
    tried = [motion.fits[frozenset({"coulomb_friction"})]]
    assert selection._with_unseen_effect(both(motion, None, tried=tried), tried[0]) is None


def alone(final: Fit, other: Fit, monkeypatch: Any) -> Fit | None:
    """Return what is stood for instead of a model where a single effect was found beside it."""
    motion = Refusing(BASE, {frozenset(other.effects): other})
    monkeypatch.setattr(Refusing, "as_good", lambda self, best, f: f.rms[0] <= 1.01 * best.rms[0], raising=False)
    monkeypatch.setattr(Fit, "size", property(lambda f: 1), raising=False)
    monkeypatch.setattr(Fit, "level", property(lambda f: f.rms[0]), raising=False)
    w = both(motion, None)
    single_laws.fit_every_law(w, final)
    return preference.sufficient_law(w, final)


def test_what_alone_leaves_but_noise_explains_what_others_do_not(monkeypatch):
    whole = Fit(("bouc_wen_hysteresis",), (NOISE,), 1.0, white=True)
    part = Fit(("linear_stiffness",), (2.0,), 1.0)
    assert alone(part, whole, monkeypatch) is whole
    assert alone(part, replace(whole, white=False), monkeypatch) is None
    assert alone(part, replace(whole, rms=(0.5,)), monkeypatch) is None
    assert alone(part, replace(whole, tested=False), monkeypatch) is None
    assert alone(part, replace(whole, away={"m": 6.0}), monkeypatch) is None


@pytest.mark.parametrize("final", [(), ("linear_stiffness",), ("linear_stiffness", "hard_stop")])
def test_every_law_is_fitted_before_none_or_several_are_named(final, monkeypatch):
    """A winding that warms, a cubic spring, a loop that hardens had not been among the promising after a few steps."""
    whole = Fit(("thermal_resistance",), (NOISE,), 1.0, white=True)
    asked = list[tuple[str, ...]]()

    def extensions(motion: Any, of: Fit, names: Any, rival: Any = None, share: float | None = None) -> list[Fit]:
        asked.append(tuple(names) if share and of is BASE else ())
        return [whole] if share else []

    monkeypatch.setattr(Refusing, "extensions", extensions)
    monkeypatch.setattr(Refusing, "fitted", lambda *_: Fit(final[:1], (3.0,), 1.0))
    found = alone(Fit(final, (2.0,), 1.0) if final else BASE, whole, monkeypatch)
    assert found is whole
    assert {"thermal_resistance", "bouc_wen_hysteresis", "sensor_delay"} <= set(asked[0])


@pytest.mark.parametrize(("effects", "settled"), [((), True), (("hard_stop",), True), (("hard_stop", "drag"), False)])
def test_one_law_that_leaves_noise_is_told_at_once(effects, settled):
    """And nothing where nothing is missing; more than one law waits for all single ones."""
    w = both(Refusing(BASE, {}), None)
    assert w.needs_no_search(Fit(effects, (NOISE,), 1.0, white=True)) is settled
    assert not w.needs_no_search(Fit(effects, (3.0 * NOISE,), 1.0))


@pytest.mark.parametrize(
    ("rms", "force", "taken"), [(0.2, 0.5, True), (1.0, 0.5, False), (0.2, 3.0, False), (0.9999, 0.5, False)]
)
def test_one_law_goes_before_another_that_leaves_surely_more(rms, force, taken):
    """Not where the motion hardly gains, be it by as little in every block, nor where it leaves more force."""
    first = Fit(("dahl_presliding",), (1.0,), 1.0, parameters=2)
    loop = Fit(("bouc_wen_hysteresis",), (rms,), force, parameters=3)
    w = both(Asking(BASE), equation_error_stub(*LAWS), BASE, first, loop, tried=[first, loop])
    assert (preference.better_option(w, first, [first, loop]) is loop) is taken


@pytest.mark.parametrize("current", [True, False])
def test_a_limit_of_the_voltage_is_no_part_of_a_measured_current(current):
    w = both(Motion(BASE), equation_error_stub(*LAWS, current=current))
    one = Fit(("coulomb_friction", "input_saturation"), (1.0,), 0.5)
    assert w.force_comparable(one)  # where it acts on the force, that is told in parts of the effort that is left of it
    assert w.force_comparable(Fit(one.effects, (1.0,), 0.5, white=True)) is not current
    assert w.effects_in_force(one) == ({"coulomb_friction"} if current else set(one.effects))
    assert not w.force_comparable(Fit(("torque_constant_saturation",), (1.0,), 0.5))


@pytest.mark.parametrize(("share", "laws"), [(0.04, set()), (0.06, {"stribeck_friction"}), (0.001, None)])
def test_the_motion_is_searched_for_what_the_force_does_not_rule_out(share, laws):
    """For all that there is where the force is not seen; for no law where there is little force, and none found."""
    force = equation_error_stub(*LAWS, helpful=("stribeck_friction",))
    squares = {BASE: np.full(BLOCKS, (share * EFFORT) ** 2)}
    evidence = both(Motion(BASE), force, kept=squares)
    names = preference.names_to_search(evidence, BASE)
    assert (names is None) == (laws is None)
    assert names is None or (set(names) & set(LAWS) == laws and {"input_delay", "sensor_offset"} <= set(names))
    late = Fit(("sensor_delay",), (2.0,), 1.0)
    assert preference.names_to_search(evidence, late) is None  # forces were read from a speed that was late


def test_a_law_that_the_force_proposes_is_searched_for_however_little_there_is():
    force = equation_error_stub(*LAWS, effects=("coulomb_friction",), helpful=("coulomb_friction",))
    squares = {BASE: np.full(BLOCKS, (0.04 * EFFORT) ** 2)}
    assert "coulomb_friction" in (preference.names_to_search(both(Motion(BASE), force, kept=squares), BASE) or ())


@pytest.mark.parametrize("seen", [True, False])
def test_of_a_family_the_motion_is_asked_of_what_the_force_asks_for(seen, monkeypatch):
    """And of the best rival; where the force is not seen, of all."""
    monkeypatch.setattr(Evidence, "force_shows", lambda *_: seen)
    errors = {"coulomb_friction": 1.0, "stribeck_friction": 0.5, "lugre_friction": 0.9, "dahl_presliding": 0.995}
    force = equation_error_stub(*LAWS)
    force.sets = {frozenset({n}): SimpleNamespace(validation_mse=e) for n, e in errors.items()}
    force.base = SimpleNamespace(validation_mse=2.0)
    found, richer = Fit(("coulomb_friction",), (10.0 * NOISE,), 1.0), list(errors)[1:]
    asked = choice(force, {}, Motion(BASE)).worth_it(found, "coulomb_friction", richer)
    assert asked == (richer[:2] if seen else richer)
    force.sets[frozenset({"coulomb_friction"})].validation_mse = 0.5
    rival = choice(force, {}, Motion(BASE)).worth_it(found, "coulomb_friction", richer)
    assert rival == (richer[:1] if seen else richer)


def test_where_the_motion_is_imposed_the_motion_is_asked_of_every_law_of_a_family():
    force, motion = equation_error_stub(*LAWS), Motion(BASE, imposed=True)
    found, richer = Fit(("coulomb_friction",), (10.0 * NOISE,), 1.0), ["stribeck_friction", "dahl_presliding"]
    assert choice(force, {}, motion).worth_it(found, "coulomb_friction", richer) == richer


@pytest.mark.parametrize(
    ("rms", "taken", "known", "named"),
    [(0.6, 1.0, True, True), (0.9, 1.0, True, False), (0.6, 1.4, True, False), (0.6, 1.0, False, False)],
    ids=["half of it", "a fifth of it", "more force", "a parameter unknown"],
)
def test_a_richer_law_of_an_imposed_force_takes_half_of_what_is_left(rms, taken, known, named):
    """Presliding of a damper: 3.1 standard errors, half of the squared error, the same within the low-pass."""
    base, found = Fit((), (3.0,), 2.0), Fit(("coulomb_friction",), (1.0,), 1.0)
    richer = Fit(("dahl_presliding",), (rms,), taken)
    object.__setattr__(
        richer,
        "insignificant",
        lambda criteria: "" if known else "the standard error of sigma is more than half of its value",
    )
    object.__setattr__(richer, "level", 0.0)
    motion, force = Motion(base, imposed=True), equation_error_stub(*LAWS)
    motion.as_good_as_best = lambda before, options: []
    found_ones = choice(force, left(base, found, richer), motion).of_one_force(found, [richer])
    assert found_ones == ([richer] if named else [])


@pytest.mark.parametrize(("rms", "sound", "taken"), [(0.4, True, True), (0.9, True, False), (0.4, False, False)])
def test_what_the_force_takes_for_as_good_the_motion_decides_where_it_is_imposed(rms, sound, taken):
    """A timber specimen: a spring and Coulomb friction, fewer parameters, in the place of a hysteresis."""
    base, found = Fit((), (5.0,), 2.0), Fit(("coulomb_friction",), (1.0,), 1.0)
    other = Fit(("bouc_wen_hysteresis",), (rms,), 0.9)
    for f in (found, other):
        object.__setattr__(f, "insignificant", lambda criteria: "")
        object.__setattr__(f, "level", 0.0)
    motion, force = Motion(base, imposed=True), equation_error_stub(*LAWS)
    motion.as_good_as_best, motion.fitted = (lambda before, options: []), (lambda names, model: other)
    force.fit = SimpleNamespace(validation_mse=1.2)
    better = SimpleNamespace(validation_mse=1.1, members=(("bouc_wen_hysteresis", ()),))
    force.sets = {
        frozenset({"bouc_wen_hysteresis"}): better,
        frozenset({"coulomb_friction"}): force.fit,
    }
    force.sound = frozenset(force.sets if sound else ())
    kept = choice(force, left(base, found, other), motion).in_all_band(found)
    assert kept is (other if taken else found)
