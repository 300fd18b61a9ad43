"""`import signlin_ros as sl`: the public names, their docstrings, and records from memory."""

from __future__ import annotations

import inspect
import subprocess
import sys

import numpy as np
import pytest

import signlin_ros as sl

COMPLETE = {"GL08", "SS01", "PR01", "PR02", "PR07", "RT01", "RT03", "YD01"}
"""Of numpydoc's checks: there is a docstring with a summary; parameters, returns and what they mean are there."""


def test_the_public_names_are_few_and_there():
    assert len(sl.__all__) < 40
    assert sorted(sl.__all__) == sorted(dir(sl))
    for name in sl.__all__:
        assert getattr(sl, name).__doc__, name


def test_nothing_is_imported_before_it_is_asked_for():
    code = "import sys, signlin_ros; sys.exit(any(m in sys.modules for m in ('numpy', 'casadi', 'numba')))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("name", [n for n in sl.__all__ if inspect.isfunction(getattr(sl, n))])
def test_docstrings_are_complete(name):
    from numpydoc.validate import validate

    place = getattr(sl, name)
    found = validate(f"{place.__module__}.{place.__qualname__}")["errors"]
    assert [error for error in found if error[0] in COMPLETE] == []


def motor_table(seed: int = 0, seconds: float = 10.0):
    """Columns of a motor with Coulomb friction, and the same model without it."""
    model = sl.Model.load("dc_motor")
    t = np.arange(0.0, seconds, 0.005)
    u = 2.0 * np.sin(2.5 * t) + 1.5 * np.sin(7.0 * t)
    run = sl.simulate(model, t, u)
    noise = np.random.default_rng(seed).normal(size=(2, t.size))
    columns = {
        "t": t,
        "voltage": u,
        "current [A]": run["current"] + 0.02 * noise[0],
        "speed": run["speed"] + 0.1 * noise[1],
    }
    return model.without_effect("coulomb_friction"), columns


@pytest.mark.slow
def test_a_table_is_compared_and_diagnosed():
    bare, table = motor_table()
    compared = sl.compare(bare, table)
    assert compared.to_frame().loc["speed", "unit"] == "rad/s"
    found = sl.diagnose(bare, table, motor_table(1)[1])
    assert found.verdict == "missing"
    assert [e.effect for e in found.missing] == ["coulomb_friction"]
    assert found.to_frame().loc["coulomb_friction", "status"] == "confirmed"
    assert found.plot().axes
    assert compared.plot().axes


def test_a_trajectory_and_a_record_are_tables(tmp_path):
    _, table = motor_table(seconds=1.0)
    model = sl.Model.load("dc_motor")
    run = sl.simulate(model, table["t"], table["voltage"])
    assert list(run.to_frame().columns) == ["voltage", "current", "speed"]
    assert run.plot().axes
    run.to_frame().reset_index().to_csv(tmp_path / "run.csv", index=False)
    assert sl.read_record(tmp_path / "run.csv").to_frame()["speed"].size == table["t"].size


def test_a_record_that_was_read_is_taken_as_its_file_is(tmp_path):
    bare, table = motor_table(seconds=2.0)
    run = sl.simulate(sl.Model.load("dc_motor"), table["t"], table["voltage"])
    run.to_frame().reset_index().to_csv(tmp_path / "run.csv", index=False)
    read = sl.compare(bare, sl.read_record(tmp_path / "run.csv")).to_frame()
    assert read.equals(sl.compare(bare, tmp_path / "run.csv").to_frame())


def test_a_table_without_a_time_is_refused():
    with pytest.raises(sl.InputError, match="no column 't' in s; it has speed"):
        sl.check("dc_motor", {"speed": [1.0, 2.0]})


def test_old_modules_are_functions_too_and_warn():
    import signlin_ros.simulate

    assert signlin_ros.simulate is not None
    with pytest.warns(DeprecationWarning, match="signlin_ros.simulate is signlin_ros.simulation"):
        from signlin_ros.simulate import Stepper
    assert Stepper is sl.Stepper
    model = sl.Model.load("dc_motor")
    assert sl.simulate(model, [0.0, 0.1], [1.0, 1.0])["speed"][-1] > 0.0  # called as a function, whichever it is
