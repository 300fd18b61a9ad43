"""``per_record``: parameters of which every record has a value of its own, beside those that all of them share."""

from dataclasses import replace

import numpy as np
import pytest

from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
from signlin_ros.diagnosis.dataset import dataset_of
from signlin_ros.diagnosis.output_error import FitCache, estimator_of
from signlin_ros.diagnosis.verbs import add
from signlin_ros.errors import ModelError
from signlin_ros.fitting.candidate import candidate
from signlin_ros.fitting.fit import evaluated
from signlin_ros.fitting.prepare import prepared
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

TRUE = {"m": 1.2, "c": 3.0, "k": 0.0}
OFFSETS = (0.6, -0.8, 0.2)


def mass(per_record=(), F0=0.5, **values):
    effects = {"constant_load": {"F0": F0}}
    content = {"plant": "mass_spring_damper", "parameters": {**TRUE, **values}, "effects": effects, "tolerance": 0.2}
    return Model.from_dict({**content, "per_record": list(per_record), "update_period": 0.1})


def record(model, seed, source, seconds=6.0):
    """Return a record of a mass under smooth forces, its velocity with noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 0.01)
    a, f = rng.uniform(2.0, 4.0, 4), rng.uniform(0.3, 2.5, 4)
    u = np.sum(a[:, None] * np.sin(2 * np.pi * f[:, None] * t + rng.uniform(0, 6, 4)[:, None]), axis=0)[:, None]
    run = simulate(model, t, u, np.zeros(2))
    measured = {n: run[n] + 2e-3 * rng.standard_normal(t.size) for n in ("displacement", "velocity")}
    return ModelData(t, u, measured, np.zeros(2), model.inputs, model.states, model.units, source)


def records(effects=()):
    rows = []
    for i, offset in enumerate(OFFSETS, 1):
        true = mass(F0=offset)
        for name, values in effects:
            true = true.with_effect(name, **values)
        rows.append(record(true, i, f"run{i}.csv"))
    return rows


@pytest.fixture(scope="module")
def measured():
    return records()


def test_own_values_are_found_beside_what_is_shared(measured):
    prepared_records = dataset_of(mass(["constant_load.F0"], c=3.6), measured)
    base = estimator_of(
        prepared_records.training, prepared_records.validation, DEFAULT_CRITERIA, FitCache(), jobs=1
    ).base
    for i, offset in enumerate(OFFSETS, 1):
        found = base.parameters[f"constant_load.F0@{i}"]
        assert found.note == f"of run{i}.csv"
        assert abs(found.value - offset) < 5 * found.std < 0.2
    c = base.parameters["c"]
    assert abs(c.value - TRUE["c"]) < 5 * c.std < 0.2
    assert base.model.value("constant_load.F0") == pytest.approx(
        np.mean([base.parameters[f"constant_load.F0@{i}"].value for i in (1, 2, 3)])
    )


def test_derivatives_to_own_values_are_those_of_the_objective(measured):
    problem, _ = prepared(mass(["constant_load.F0"], c=3.6), measured, measured)
    c = candidate(problem, problem.base, ())
    theta = c.start() + 0.05
    gains = problem.observer_gains[1]
    here = evaluated(problem, c, theta, gains)
    for i, k in enumerate(c.coordinates):
        step = 1e-5 * np.eye(theta.size)[i]
        more, less = (evaluated(problem, c, theta + s * step, gains).objective for s in (1.0, -1.0))
        assert (more - less) / 2e-5 == pytest.approx(2 * here.gradient[i], rel=1e-3, abs=1e-3), k.name


def test_what_a_validation_record_has_of_its_own_is_fitted_to_it(measured):
    model = mass(["constant_load.F0"])
    prepared_records = dataset_of(model, measured[:2], [measured[2]])
    base = estimator_of(
        prepared_records.training, prepared_records.validation, DEFAULT_CRITERIA, FitCache(), jobs=1
    ).base
    shared = dataset_of(mass(), measured[:2], [measured[2]])
    other = estimator_of(shared.training, shared.validation, DEFAULT_CRITERIA, FitCache(), jobs=1).base
    assert np.all(base.validation_rmse < 2.0 * base.noise)
    assert np.any(other.validation_rmse > 1.5 * base.validation_rmse)


def test_a_known_value_is_kept(measured):
    first = replace(measured[0], conditions={"constant_load.F0": OFFSETS[0]})
    problem, _ = prepared(mass(["constant_load.F0"]), [first, *measured[1:]], [first])
    names = [k.name for k in candidate(problem, problem.base, ()).coordinates]
    assert [n for n in names if "F0" in n] == ["constant_load.F0@2", "constant_load.F0@3"]


def test_a_value_that_is_given_as_zero_is_free_too(measured):
    problem, _ = prepared(mass(["constant_load.F0"], F0=0.0), measured, measured)
    names = [k.name for k in candidate(problem, problem.base, ()).coordinates]
    assert [n for n in names if "F0" in n] == [f"constant_load.F0@{i}" for i in (1, 2, 3)]


@pytest.mark.slow
def test_an_effect_is_added_beside_own_values():
    data = records([("coulomb_friction", {"mu": 0.8})])
    found = add("coulomb_friction", mass(["constant_load.F0"]), data, jobs=1)
    mu = found.parameters["coulomb_friction.mu"]
    assert abs(mu.value - 0.8) < max(5 * mu.std, 0.02)
    assert {f"constant_load.F0@{i}" for i in (1, 2, 3)} <= set(found.parameters)
    assert all(f"constant_load.F0@{i}: fitted" in found.yaml for i in (1, 2, 3))
    again = Model.from_yaml(found.yaml) if hasattr(Model, "from_yaml") else None
    assert again is None or again.per_record == ("constant_load.F0",)


def test_what_is_frozen_has_no_value_for_each_record():
    content = {"plant": "mass_spring_damper", "parameters": TRUE, "frozen": ["c"], "per_record": ["c"]}
    with pytest.raises(ModelError, match="per_record: 'c' is frozen"):
        Model.from_dict(content)
