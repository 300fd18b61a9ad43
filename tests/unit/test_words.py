"""What a diagnosis says: doubtful numbers with their errors, where a value came from, the nearest rival."""

from __future__ import annotations

import ast
from pathlib import Path
from types import SimpleNamespace

import pytest

from signlin_ros.diagnosis.evidence import Evidence
from signlin_ros.diagnosis.findings import nearest
from signlin_ros.diagnosis.output_error import FitCache
from signlin_ros.diagnosis.proposal import _origin
from signlin_ros.diagnosis.results import ParameterEstimate
from signlin_ros.diagnosis.wording.verdicts import shown
from signlin_ros.model import Model
from signlin_ros.model.numbers import numbers

DIAGNOSIS = Path(__file__).parents[2] / "signlin_ros" / "diagnosis"
AXIS = Model.from_dict(
    {
        "plant": "mass_spring_damper",
        "parameters": {"m": 95.109, "c": 203.5, "k": 0.0},
        "effects": {"load": {"type": "constant_load", "F0": 3.5}},
    }
)


def test_parameters_as_given():
    found = numbers(AXIS)
    assert (found["m"], found["load.F0"]) == (95.109, 3.5)
    assert "coulomb_friction.mu" not in found


@pytest.mark.parametrize(
    ("name", "found", "text"),
    [
        ("m", ParameterEstimate(92.8808, 0.21, "kg"), "m: fitted, 92.88 ± 0.21 kg; was 95.109"),
        ("load.F0", ParameterEstimate(3.3, 0.1, "N"), "load.F0: fitted, 3.30 ± 0.10 N; was 3.5"),
        (
            "load.F0",
            ParameterEstimate(0.2169, 0.075, "N", "was 3.5; odd"),
            "load.F0: fitted, 0.217 ± 0.075 N; was 3.5; odd",
        ),
        (
            "coulomb_friction.mu",
            ParameterEstimate(1.0, 0.1, "N", "at its bound"),
            "coulomb_friction.mu: fitted, 1.00 ± 0.10 N; at its bound",
        ),
    ],
)
def test_where_a_value_came_from(name, found, text):
    assert _origin(name, found, AXIS) == text


def judged(rotary=False):
    return SimpleNamespace(dataset=SimpleNamespace(training=SimpleNamespace(turns=rotary)))


def told(effect, rotary=False, **found):
    """Return what is said of an effect of a fitted model; values and standard errors (None: not known)."""
    plain = {n: value for n, (value, _) in found.items()}
    model = AXIS.with_effect(effect, **plain)
    units = {n: p.unit for n, p in model.par_declarations().items()}
    parameters = {
        f"{effect}.{n}": ParameterEstimate(value, std, units[f"effects.{effect}.{n}"])
        for n, (value, std) in found.items()
    }
    f = SimpleNamespace(model=model, parameters=parameters)
    return shown(judged(rotary), f, effect)


def test_doubtful_numbers_are_told_with_their_errors():
    text = told("load_dependent_friction", True, kappa_d=(0.0850149, 0.25), kappa_e=(0.240394, 0.02))
    assert "0.09 ± 0.25 of the driving torque, 0.24 of the external one" in text


def test_what_has_no_error_is_told_as_it_is():
    assert "0.085" in told("coulomb_friction", mu=(0.085, None))


def test_a_doubtful_fault_of_a_sensor_is_told_with_its_error():
    parameters = {"sensor_offset.displacement": ParameterEstimate(0.012, 0.013, "m")}
    f = SimpleNamespace(model=AXIS, parameters=parameters)
    assert "0.012 ± 0.013 m too much" in shown(
        SimpleNamespace(dataset=SimpleNamespace(training=SimpleNamespace(turns=False))), f, "sensor_offset"
    )


@pytest.mark.parametrize(
    ("tried", "best"),
    [
        ({("coulomb_friction",): 1.0, ("dahl_presliding",): 2.0}, "coulomb_friction"),
        ({("coulomb_friction", "gravity_load"): 0.5, ("dahl_presliding",): 2.0}, "dahl_presliding"),
        ({("coulomb_friction", "gravity_load"): 0.5}, None),
        ({}, None),
    ],
)
def test_the_nearest_is_the_best_single_effect_that_was_fitted_out(tried, best):
    fits = [SimpleNamespace(effects=effects, log_mse=level) for effects, level in tried.items()]
    found = nearest(Evidence(None, SimpleNamespace(cache=FitCache(weighed=fits)), None))
    assert (found and found.effects[0]) == best


# ---------------------------------------------------------------- where sentences are


def sentences(path: Path) -> list[str]:
    """Return the texts of a module of five words and more, but for docstrings and what is raised."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    raised = {id(n) for r in ast.walk(tree) if isinstance(r, ast.Raise) for n in ast.walk(r)}
    told = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
    texts = [n for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str)]
    return [n.value for n in texts if id(n) not in raised | told and len(n.value.split()) > 4]


def test_every_sentence_of_a_diagnosis_is_in_one_package():
    found = {p.name: sentences(p) for p in DIAGNOSIS.rglob("*.py") if p.parent.name != "wording"}
    others = {
        "comparison.py",
        "compared.py",
        "proposal.py",
        "estimator.py",
        "trials.py",
    }  # `compare`; comments of a file; errors
    assert {n: texts for n, texts in found.items() if texts and n not in others} == {}
    assert sum(len(sentences(p)) for p in DIAGNOSIS.rglob("wording/*.py")) > 40
