"""What a diagnosis says: doubtful numbers with their errors, shares, where a value came from, the nearest rival."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from signlin_ros.diagnosis import evidence
from signlin_ros.diagnosis.parameters import _moved, given
from signlin_ros.diagnosis.proposal import _origin
from signlin_ros.diagnosis.ranking import sentence_of
from signlin_ros.diagnosis.results import Estimate
from signlin_ros.diagnosis import _percent, _unexplained
from signlin_ros.model import Model

AXIS = Model.from_dict(
    {
        "plant": "mass_spring_damper",
        "parameters": {"m": 95.109, "c": 203.5, "k": 0.0},
        "effects": {"load": {"type": "constant_load", "F0": 3.5}},
    }
)


def problem(rotary=False):
    return SimpleNamespace(base=AXIS, rotary=rotary)


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.384, "38 %"),
        (0.9, "90 %"),
        (0.993, "99.3 %"),
        (0.9994, "99.94 %"),
        (0.9995, "more than 99.9 %"),
        (0.99999, "more than 99.9 %"),
        (1.0, "more than 99.9 %"),
        (0.0, "0 %"),
    ],
)
def test_no_share_is_the_whole(share, text):
    assert _percent(share) == text


def test_doubtful_numbers_are_told_with_their_errors():
    found = {"kappa_d": Estimate(0.0850149, 0.25, "-"), "kappa_e": Estimate(0.240394, 0.02, "-")}
    text = sentence_of("load_dependent_friction", problem(rotary=True), found)
    assert text.endswith("0.09 ± 0.25 of the driving torque, 0.24 of the external one")


def test_a_doubtful_fault_of_a_sensor_is_told_with_its_error():
    found = {"sensor_offset.displacement": Estimate(0.012, 0.013, "m")}
    assert "0.012 ± 0.013 m too much" in sentence_of("sensor_offset", problem(), found)


def test_what_has_no_error_is_told_as_it_is():
    assert "0.085 N against" in sentence_of("coulomb_friction", problem(), {"mu": Estimate(0.085, None, "N")})


def test_parameters_as_given():
    assert given(AXIS, "m") == 95.109
    assert given(AXIS, "load.F0") == 3.5
    assert given(AXIS, "coulomb_friction.mu") is None


@pytest.mark.parametrize(
    ("value", "std", "note"),
    [(2.0, 0.1, "was 3.5"), (2.0, 0.6, ""), (3.3, 0.01, ""), (-3.5, 0.5, "was 3.5")],
)
def test_known_effects_that_moved_far(value, std, note):
    assert _moved(value, std, 3.5) == note
    assert _moved(value, std, None) == ""


@pytest.mark.parametrize(
    ("name", "found", "text"),
    [
        ("m", Estimate(92.8808, 0.21, "kg"), "m: fitted, 92.88 ± 0.21 kg; was 95.109"),
        ("load.F0", Estimate(3.3, 0.1, "N"), "load.F0: fitted, 3.30 ± 0.10 N; was 3.5"),
        ("load.F0", Estimate(0.2169, 0.075, "N", "was 3.5; odd"), "load.F0: fitted, 0.217 ± 0.075 N; was 3.5; odd"),
        (
            "coulomb_friction.mu",
            Estimate(1.0, 0.1, "N", "at its bound"),
            "coulomb_friction.mu: fitted, 1.00 ± 0.10 N; at its bound",
        ),
    ],
)
def test_where_a_value_came_from(name, found, text):
    assert _origin(name, found, AXIS) == text


def findings(**singles):
    """Singles with their evidence (smaller is better) and whether they lower the error on unseen data."""
    steps = [
        SimpleNamespace(ranked=SimpleNamespace(effects=(name,), evidence=evidence), gain=gain)
        for name, (evidence, gain) in singles.items()
    ]
    return SimpleNamespace(singles=steps, pairs=(), declined={"cogging_torque": "why"}, problem=None)


@pytest.mark.parametrize(
    ("singles", "nearest"),
    [
        ({"dahl_presliding": (2.0, 1.0), "coulomb_friction": (1.0, 1.0)}, "coulomb_friction"),
        ({"stribeck_friction": (0.0, 1.0), "coulomb_friction": (1.0, 1.0)}, "coulomb_friction"),  # impossible
        ({"cogging_torque": (0.0, 1.0), "coulomb_friction": (1.0, 1.0)}, "coulomb_friction"),  # refused
        ({"input_saturation": (0.0, -1.0), "coulomb_friction": (1.0, 1.0)}, "coulomb_friction"),  # worse on unseen data
        ({"input_saturation": (0.0, -1.0), "hard_stop": (1.0, -1.0)}, "input_saturation"),
        ({"cogging_torque": (0.0, 1.0), "gravity_load": (0.0, 1.0)}, None),
    ],
)
def test_the_nearest_rival_is_one_that_could_be(singles, nearest, monkeypatch):
    monkeypatch.setattr(evidence, "plausible", lambda problem, r: r.effects != ("stribeck_friction",))
    found = evidence.nearest_rival(findings(**singles), SimpleNamespace(effects=("gravity_load",)), "gravity_load")
    assert (found and found[1]) == nearest


def test_what_is_unexplained_contradicts_nothing(monkeypatch):
    for name in ("_outdone", "_of_another_shape", "_elsewhere"):
        monkeypatch.setattr(f"signlin_ros.diagnosis.verdict.{name}", lambda *_: False)
    final = SimpleNamespace(ranked=SimpleNamespace(effects=("hard_stop",)))
    f = SimpleNamespace(final=final, unaccounted=True, reversed="", at_random=None, varying=None)
    end = "structure that no listed effect explains"
    known = "Hard stop explains 90 % of the missing motion on data that the fit did not see"
    assert _unexplained(f, 0.9, 3.0) == f"{known}; what remains has {end}."
    assert _unexplained(f, 0.0, 3.0) == f"The residual has {end} on data that the fit did not see."
