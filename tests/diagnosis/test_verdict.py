"""What is said of a proposal of which the last effect is not sure, and of parameters that tell nothing."""

from __future__ import annotations

import numpy as np
import pytest
from signlin_ros.diagnosis.verdict import describe, diagnose

from signlin_ros.diagnosis import verdict
from tests.diagnosis.test_sensitive import drawn
from tests.diagnosis.test_traps import AXIS, proposed, recorded

TWO = {"coulomb_friction": {"mu": 21.0}, "cubic_stiffness": {"k3": 3e4}}


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    return diagnose(*recorded(tmp_path_factory.mktemp("two"), AXIS, TWO, level=1e-3))


def test_a_shorter_proposal_is_told_where_the_last_effect_explains_too_little(found, monkeypatch):
    f = found.findings
    assert found.verdict == "missing"
    assert len(f.steps) == 3
    first, second = f.steps[1].ranked.effects, f.steps[2].ranked.effects
    (dropped,) = set(second) - set(first)
    monkeypatch.setattr(verdict, "_verdict", lambda f, *_: "unexplained" if len(f.steps) == 3 else "missing")
    shorter = describe(f)
    assert shorter.verdict == "missing"
    assert proposed(shorter) == set(first)
    assert [r.effects for r in shorter.ladder] == [(), first]
    entry = next(e for e in shorter.ranking if e.effect == dropped)
    assert entry.status == "rejected"
    assert "% only of what is left" in entry.why
    assert dropped not in shorter.model.effects
    assert (np.array(list(shorter.noise.values())) <= np.array(list(found.noise.values()))).all()
    assert len(describe(f, whole=True).ladder) == 3


def test_nothing_shorter_is_told_where_nothing_shorter_is_enough(found, monkeypatch):
    monkeypatch.setattr(verdict, "_verdict", lambda *_: "unexplained")
    whole = describe(found.findings)
    assert whole.verdict == "unexplained"
    assert whole.ladder[-1].effects == found.ladder[-1].effects


def test_where_a_velocity_starts_and_what_a_loop_remembers_are_found_together(tmp_path):
    """Fitted one by one to the first samples, they left 1.4 times the noise with the true parameters."""
    given, truth = drawn(tmp_path, "single", 125, 37)
    found = diagnose(*given)
    assert found.verdict == "missing"
    assert proposed(found) == {"bouc_wen_hysteresis"}
    true = truth["values"]["bouc_wen_hysteresis"]
    assert found.parameters["bouc_wen_hysteresis.k"].value == pytest.approx(true["k"], rel=0.03)
    assert found.ladder[-1].validation.channels["velocity"].rmse_over_noise < 1.1


def test_what_the_uncertainty_of_parameters_makes_on_other_motion_decides_nothing(tmp_path):
    """A slow record hardly tells the mass, steps depend on it: presliding gained there by chance, the spring lost."""
    given, _ = drawn(tmp_path, "single", 62, 37)
    found = diagnose(*given)
    assert proposed(found) == {"linear_stiffness"}
    assert "known parameters are far from their values" in found.ranking[0].why


def test_several_effects_that_imitate_one_are_not_named_for_what_noise_in_the_input_may_leave(tmp_path):
    """Coulomb friction, presliding and a cubic spring explained 95 %."""
    given, truth = drawn(tmp_path, "outside", 12, 39)
    assert truth["laws"] == ["root_friction"]
    assert diagnose(*given).verdict == "unexplained"
