"""Rivals of a plan: their file, and when one has lost."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from signlin_ros import cli
from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
from signlin_ros.diagnosis.discrimination import (
    Doubts,
    PlannedRival,
    RefittedRival,
    discriminated,
    doubts_of,
    undecided,
)
from signlin_ros.diagnosis.selection import Selection
from signlin_ros.diagnosis.wording.planned_rivals import told
from signlin_ros.errors import InputError
from signlin_ros.model import Model


def motor(**effects):
    model = Model.load("dc_motor").without_effect("coulomb_friction")
    for name, values in effects.items():
        model = model.with_effect(name, **values)
    return model


def test_a_rival_is_the_same_after_its_file():
    starts = (motor(dahl_presliding={"F_c": 0.03, "sigma": 5.0}), motor(dahl_presliding={"F_c": 0.03, "sigma": 12.0}))
    rival = PlannedRival(("dahl_presliding",), starts, {"dahl_presliding.sigma": (-np.inf, 12.0)})
    again = PlannedRival.of_json(json.loads(json.dumps(rival.to_json())))
    assert again.effects == rival.effects
    assert again.of_interest == rival.of_interest
    assert [m.effects["dahl_presliding"].parameters["sigma"] for m in again.starts] == [5.0, 12.0]


def test_a_rival_of_a_diagnosis_starts_from_its_model():
    told_of = {"effects": ["coulomb_friction"], "model": motor(coulomb_friction={"mu": 0.02}).to_yaml()}
    rival = PlannedRival.of_json({**told_of, "parameters": [], "covariance": []})
    assert rival.starts[0].effects["coulomb_friction"].parameters["mu"] == 0.02
    assert not rival.of_interest


@pytest.mark.parametrize("entry", [{}, {"effects": ["coulomb_friction"]}, {"model": "plant: dc_motor"}])
def test_what_is_no_rival_is_refused(entry):
    with pytest.raises(InputError, match="rivals"):
        PlannedRival.of_json(entry)


@pytest.mark.parametrize(
    ("content", "said"), [(None, "cannot read"), ("{", "is no file of rivals"), ('{"rivals": 3}', "no file of rivals")]
)
def test_a_file_that_holds_no_rivals_is_refused_in_one_line(tmp_path, capsys, content, said):
    t = np.arange(0.0, 2.0, 0.01)
    table = np.column_stack([t, np.sin(t), np.cos(t)])
    np.savetxt(tmp_path / "run.csv", table, delimiter=",", header="t,voltage,speed", comments="")
    motor().save(tmp_path / "m.yaml")
    path = tmp_path / "rivals.json"
    if content is not None:
        path.write_text(content)
    assert cli.main([str(a) for a in ("diagnose", tmp_path / "m.yaml", tmp_path / "run.csv", "--rivals", path)]) == 2
    err = capsys.readouterr().err.strip().splitlines()
    assert said in err[-1]
    assert sum(line.startswith("error") or said in line for line in err) == 1


# -------------------------------------------------------------------- who has lost


def fitted(*effects, errs=0.0, leaves=(1.0, 1.0), noise=True):
    """Return a model that errs by some standard errors and ``leaves`` errors by channel, in noises."""
    rmse = np.array(leaves)
    return SimpleNamespace(effects=effects, errs=errs, validation_rmse=rmse, residual_is_noise=noise)


def evidence(*weightless):
    """Return what decides, of models that err by some standard errors more than the best."""
    motion = SimpleNamespace(
        t_ratio=lambda before, after: before.errs - after.errs,
        refusal=lambda base, f: "is nothing" if f.effects in weightless else "",
        validation=SimpleNamespace(noise=np.ones(2), folds=((0,), (1,))),
    )
    return SimpleNamespace(
        output_error=motion, criteria=DEFAULT_CRITERIA, force_rises=lambda a, b: False, base=fitted(errs=50.0)
    )


def rival(*effects, errs, least=None, size="", leaves=(1.0, 3.0)):
    f = fitted(*effects, errs=errs, leaves=leaves)
    return RefittedRival(effects, f, f if least is None else fitted(*effects, errs=least), size)


def test_a_rival_that_errs_as_little_is_not_decided():
    near, far = rival("constant_load", errs=2.0), rival("viscous_friction", errs=9.0)
    assert undecided(evidence(), [near, far], fitted("coulomb_friction")) == [near]
    final = fitted("coulomb_friction")
    said = told(evidence(), [near, far], final, doubts_of(evidence(), [near, far], final))
    assert "Not decided: constant load" in said
    assert "viscous friction loses by 9.0 standard errors" in said


def test_a_law_that_contains_what_is_named_is_excluded_from_a_size_on_and_does_not_lose_whatever_its_size():
    """A play of 0.03 rad was the truth, and "backlash loses by 5.1 standard errors" stood beside "from 0.1 rad on"."""
    final = SimpleNamespace(**vars(fitted("compliant_load")), n_parameters=3)
    model = motor(backlash={"k": 6.0, "c": 0.01, "J": 6e-4, "gap": 0.1})
    least = SimpleNamespace(**vars(fitted("backlash", errs=5.1)), model=model, n_parameters=4)

    def at(share):
        return 0.1 * share, least if share == 1.0 else None

    play = RefittedRival(("backlash",), least, least, "backlash.gap", at=at)
    far = rival("coulomb_friction", errs=9.0)
    shown = SimpleNamespace(training=SimpleNamespace(shown=lambda unit: unit))
    given = SimpleNamespace(**vars(evidence()), dataset=shown)
    said = told(given, [play, far], final, Doubts())
    assert "Coulomb friction loses by 9.0 standard errors." in said
    assert "Excluded is backlash with gap of 0.100 rad or more." in said


def test_a_richer_law_must_lose_at_the_size_that_is_of_interest():
    lost = rival("stribeck_friction", errs=0.0, least=8.0, size="stribeck_friction.excess")
    assert undecided(evidence(), [lost], fitted("coulomb_friction")) == []
    tied = rival("stribeck_friction", errs=0.0, least=1.0, size="stribeck_friction.excess")
    assert undecided(evidence(), [tied], fitted("coulomb_friction")) == [tied]


def test_insignificant_rivals_and_supersets_leave_no_doubt():
    nothing, more = rival("gravity_load", errs=0.0), rival("coulomb_friction", "backlash", errs=0.0)
    w = evidence(("gravity_load",))
    assert undecided(w, [nothing, more], fitted("coulomb_friction")) == []


def test_without_rivals_nothing_is_said():
    final = fitted("coulomb_friction", noise=False)
    assert doubts_of(evidence(), [], final) == Doubts()
    assert told(evidence(), [], final, Doubts()) == ""


# -------------------------------------------------------------------- who takes the place of what was chosen


def replaced(simple, errs, rises=False, noise=True):
    """Return what is named where a simpler rival errs by some standard errors more than LuGre's friction, and the force
    that it leaves surely ``rises``.
    """
    motion = SimpleNamespace(
        t_ratio=lambda before, after: before.errs - after.errs,
        refusal=lambda before, after: "" if before.errs - after.errs >= DEFAULT_CRITERIA.min_t else "too little",
        as_good=lambda best, f: True,
        improvement=lambda before, after: SimpleNamespace(worsens=lambda c: False),
    )
    given = SimpleNamespace(
        output_error=motion,
        criteria=DEFAULT_CRITERIA,
        base=fitted(errs=50.0),
        force_rises=lambda before, after: rises and after.effects == (simple,),
        force_change=lambda before, after: None,
    )
    known = {"implausible": [], "residual_is_noise": noise}
    final = SimpleNamespace(effects=("lugre_friction",), errs=0.0, size=(1, 6), log_mse=0.0, **known)
    other = SimpleNamespace(effects=(simple,), errs=errs, size=(1, 1), log_mse=0.1, **known)
    rivals = [RefittedRival(f.effects, f, f) for f in (other, final)]
    return discriminated(given, Selection(final), rivals).chosen.effects[0]


@pytest.mark.parametrize(("errs", "named"), [(1.0, "coulomb_friction"), (4.4, "lugre_friction")])
def test_a_simpler_rival_takes_the_place_only_of_what_is_no_sure_step_beyond_it(errs, named):
    """Both look the same in a table; by 4.4 standard errors they are not."""
    assert replaced("coulomb_friction", errs) == named


@pytest.mark.parametrize(
    ("simple", "noise", "named"),
    [
        ("dahl_presliding", True, "dahl_presliding"),
        ("dahl_presliding", False, "lugre_friction"),
        ("coulomb_friction", True, "lugre_friction"),
    ],
)
def test_the_force_of_a_bristle_that_leaves_but_noise_speaks_for_no_richer_one(simple, noise, named):
    """Dahl's friction, which was true, erred less than LuGre's with four parameters more, and its force rose: the noise
    of the measured way bends a stiffer bristle.
    """
    assert replaced(simple, -0.6, rises=True, noise=noise) == named


# -------------------------------------------------------------------- what no rival holds


def test_two_laws_that_no_rival_has_together_are_not_confirmed():
    rivals = [rival("coulomb_friction", errs=9.0), rival("dahl_presliding", errs=9.0)]
    final = fitted("coulomb_friction", "cogging_torque")
    doubts = doubts_of(evidence(), rivals, final)
    assert doubts.of("coulomb_friction")
    assert doubts.of("cogging_torque")
    said = told(evidence(), rivals, final, doubts)
    assert "None of the rivals of the plan is enough: cogging torque would be needed as well" in said
    assert "--between coulomb_friction+cogging_torque,dahl_presliding+cogging_torque" in said


def with_models(effects, errs, noise=True):
    """Return a fit as `fitted`, with its model."""
    model = motor(**{name: {} for name in effects})
    known = {"model": model, "implausible": [], "size": (len(effects), len(effects)), "log_mse": errs}
    return SimpleNamespace(**vars(fitted(*effects, errs=errs, noise=noise)), **known)


def held_against(errs, diverges=False, noise=True):
    """Return what decides on Coulomb friction with a wave beside it, where Dahl's with a wave errs by so much, and its
    selection; nothing was planned for the wave.
    """
    given = evidence()
    given.base = with_models((), 50.0)
    given.cache = SimpleNamespace(keep=lambda *fits: None)
    given.force_change = lambda before, after: None
    asked = []

    def fitted_from(effects, starts, within=None):
        asked.append((effects, tuple(starts[0].effects)))
        return None if diverges else with_models(effects, errs)

    more = {"fitted_from": fitted_from, "as_good": lambda best, f: True}
    better = SimpleNamespace(worsens=lambda c: False)
    given.output_error = SimpleNamespace(**vars(given.output_error), **more, improvement=lambda before, after: better)
    final = with_models(("coulomb_friction", "cogging_torque"), 0.0, noise)
    alone = [with_models((name,), 20.0) for name in ("coulomb_friction", "dahl_presliding")]
    selection = discriminated(given, Selection(final), [RefittedRival(f.effects, f, f) for f in alone])
    return given, selection, asked


@pytest.mark.parametrize(("errs", "decided"), [(9.0, True), (1.0, False)])
def test_what_is_needed_as_well_is_put_beside_every_rival(errs, decided):
    given, selection, asked = held_against(errs)
    assert asked == [(("dahl_presliding", "cogging_torque"), ("dahl_presliding", "cogging_torque"))]
    doubts = doubts_of(given, selection.rivals, selection.chosen)
    assert not doubts.together
    assert doubts.of("coulomb_friction") is not decided
    said = told(given, selection.rivals, selection.chosen, doubts)

    assert ("Not decided: " in said) is not decided
    assert "Dahl presliding+cogging torque" in said


def test_a_rival_that_is_better_with_it_takes_the_place():
    _, selection, _ = held_against(-9.0)
    assert selection.chosen.effects == ("dahl_presliding", "cogging_torque")


@pytest.mark.parametrize("how", [{"diverges": True}, {"noise": False}])
def test_what_is_needed_as_well_stays_in_doubt_where_not_all_was_held_against_it_or_more_is_left(how):
    given, selection, _ = held_against(9.0, **how)
    assert doubts_of(given, selection.rivals, selection.chosen).together == ("coulomb_friction", "cogging_torque")


def test_two_laws_that_are_no_rivals_at_all_are_told_as_that():
    rivals, final = [rival("coulomb_friction", errs=9.0)], fitted("gravity_load", "cogging_torque")
    said = told(evidence(), rivals, final, doubts_of(evidence(), rivals, final))
    assert "gravity load and cogging torque would be needed together." in said


def test_two_laws_of_a_rival_and_one_law_by_itself_are_in_no_such_doubt():
    both = [rival("coulomb_friction", "cogging_torque", errs=0.0), rival("dahl_presliding", errs=9.0)]
    assert doubts_of(evidence(), both, fitted("coulomb_friction", "cogging_torque")) == Doubts()
    other = [rival("coulomb_friction", errs=9.0), rival("dahl_presliding", errs=9.0)]
    assert doubts_of(evidence(), other, fitted("backlash")) == Doubts()


@pytest.mark.parametrize(
    ("leaves", "noise", "doubted"),
    [(1.0, True, False), (2.0, True, False), (1.3, False, False), (2.0, False, True)],
    ids=["noise", "much, but noise", "structure, but little", "structure"],
)
def test_what_leaves_as_much_structure_as_tells_a_rival_apart_is_not_confirmed(leaves, noise, doubted):
    """A rival leaves three times the noise: 8 of its variance beyond it, of which a quarter is 2."""
    lost, final = rival("dahl_presliding", errs=9.0), fitted("coulomb_friction", leaves=(1.0, leaves), noise=noise)
    doubts = doubts_of(evidence(), [lost], final)
    assert doubts.near == ((lost,) if doubted else ())
    assert doubts.of("coulomb_friction") is doubted
    assert ("more than noise" in told(evidence(), [lost], final, doubts)) is doubted
