"""A temperature that was recorded: read in any scale, an input of the model, and told of where it is not used."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from signlin_ros import units
from signlin_ros.checks import check
from signlin_ros.diagnosis import add, diagnose
from signlin_ros.errors import InputError, RecordError
from signlin_ros.follow.data import load_records
from signlin_ros.model import Model
from signlin_ros.records import ModelData

OVEN = [20.0, 21.5, 23.0, 24.0, 25.0, 26.0]


def written(tmp_path: Path, head: str, values: list[float]) -> Path:
    rows = [f"{0.01 * i:g},{0.1 * (i % 7):g},{0.2 * (i % 5):g},{value}" for i, value in enumerate(values)]
    file = tmp_path / "run.csv"
    file.write_text("\n".join([f"t,force,velocity,{head}", *rows]), encoding="utf-8")
    return file


LONG = np.linspace(20.0, 30.0, 200).tolist()


def read(tmp_path: Path, head: str, values: list[float], spec: str | None) -> tuple[Model, ModelData]:
    model = Model.load("mass_spring_damper")
    loaded, (record,) = load_records(model, written(tmp_path, head, values), {"temperature": spec} if spec else None)
    return loaded, record


@pytest.mark.parametrize(
    ("head", "values", "spec"),
    [
        ("oil [degC]", OVEN, "oil"),
        ("oil (°C)", OVEN, "oil"),
        ("oil_celsius", OVEN, "oil"),
        ("oil", OVEN, "oil [degC]"),
        ("oil [K]", [v + 273.15 for v in OVEN], "oil"),
        ("oil [°F]", [1.8 * v + 32.0 for v in OVEN], "oil"),
        ("oil", OVEN, "oil + 273.15"),
        ("temperature [degC]", OVEN, None),
    ],
)
def test_a_temperature_is_read_in_kelvin(tmp_path, head, values, spec):
    model, record = read(tmp_path, head, values, spec)
    assert model.inputs == record.inputs == ("force", "temperature")
    np.testing.assert_allclose(record.u[:, 1], np.array(OVEN) + 273.15, rtol=1e-12)
    assert units.zero(model.units["temperature"]) == 0.0


def test_a_temperature_without_a_unit_is_asked_for(tmp_path):
    with pytest.raises(RecordError, match=r"23.5 K, as no drive is.*--signal .temperature = oil .degC."):
        read(tmp_path, "oil", OVEN, "oil")


def test_one_that_nothing_is_read_from_is_told(tmp_path):
    loaded, record = read(tmp_path, "oil [degC]", LONG, None)
    assert loaded.inputs == ("force",)
    (told,) = [f.sentence for f in check(loaded, [record])[1] if f.check == "spare_temperature"]
    assert "--signal 'temperature = oil'" in told
    loaded, record = read(tmp_path, "oil [bar]", LONG, None)
    assert not [f for f in check(loaded, [record])[1] if f.check == "spare_temperature"]


def test_a_model_that_names_the_column_has_the_input():
    content = {"plant": "dc_motor", "signals": {"temperature": "oil"}}
    model = Model.from_dict({**Model.load("dc_motor").to_dict(), **content})
    assert model.inputs == ("voltage", "temperature")
    warm = model.with_effect("temperature_dependent_friction")
    assert warm.without_effect("temperature_dependent_friction").inputs == model.inputs == warm.inputs
    assert model.u0.tolist() == [0.0, 293.15]


def warmed(seed: int) -> ModelData:
    """Return an axis whose dry friction falls by 1.5 % for each K while its oil warms up from 20 by 40 K."""
    rng, step = np.random.default_rng(seed), 0.01
    t = np.arange(2500) * step
    u = np.repeat(rng.uniform(-9.0, 9.0, 50), 50)
    kelvin = 40.0 * (1.0 - np.exp(-t / 8.0))
    x, v, shown = 0.0, 0.0, np.empty((t.size, 2))
    for k in range(t.size):
        shown[k] = x, v
        for _ in range(20):
            free = v + step / 20 * (u[k] - 1.2 * v) / 0.8
            stop = step / 20 * 3.0 * np.exp(-0.015 * kelvin[k]) / 0.8
            v = float(np.sign(free) * max(abs(free) - stop, 0.0))
            x += step / 20 * v
    measured = {"displacement": shown[:, 0] + rng.normal(0.0, 1e-3, t.size)}
    measured |= {"velocity": shown[:, 1] + rng.normal(0.0, 0.01, t.size)}
    u = np.column_stack([u, kelvin + 293.15])
    names = ("force", "temperature")
    return ModelData(t, u, measured, None, names, ("displacement", "velocity"), {**BASE.units})


BASE = Model.from_dict(
    {
        "plant": "mass_spring_damper",
        "axis": "rotary",
        "parameters": {"m": 0.8, "c": 1.2, "k": 0.0},
        "with_inputs": ["temperature"],
        "input_hold": "forward",
    }
)


@pytest.mark.slow
def test_friction_that_falls_as_the_oil_warms_up_is_named():
    found = diagnose(BASE, warmed(1), warmed(2), jobs=2)
    assert found.verdict == "missing"
    assert "temperature_dependent_friction" in found.ladder[-1].effects
    told = {name: shown.value for name, shown in found.parameters.items()}
    assert told["temperature_dependent_friction.mu"] == pytest.approx(3.0, rel=0.05)
    assert told["temperature_dependent_friction.a_c"] == pytest.approx(0.015, rel=0.1)


def test_without_its_temperature_the_effect_says_what_it_needs():
    data = warmed(1)
    bare = BASE.with_options(with_inputs=[])
    alone = replace(data, u=data.u[:, :1], inputs=("force",))
    with pytest.raises(InputError, match=r"depends on the temperature.*--signal temperature=COLUMN"):
        add("temperature_dependent_friction", bare, alone, alone)
