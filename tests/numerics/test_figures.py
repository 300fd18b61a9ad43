"""The paper's figures against independently computed values, and against the method's theory."""

from __future__ import annotations

import builtins
import json
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from signlin_ros import figures
from signlin_ros.errors import InputError, MissingExtraError
from signlin_ros.figures import line
from signlin_ros.figures import motor as figure_4
from signlin_ros.figures import oscillator as figure_5
from signlin_ros.figures.motor import MotorRuns
from signlin_ros.figures.oscillator import OscillatorRuns
from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.simulation import simulate


@pytest.fixture(scope="module")
def motor() -> MotorRuns:
    return figure_4.run_motor()


@pytest.fixture(scope="module")
def oscillator() -> OscillatorRuns:
    return figure_5.run_oscillator()


@pytest.fixture(scope="module")
def errors(oscillator: OscillatorRuns) -> dict[str, list[float]]:
    return figure_5.errors_by_period(oscillator)


# Computed beforehand by another program; as many digits as it printed.


@pytest.mark.parametrize(
    ("name", "speed", "digits"), [("start", 21.015, 3), ("exact", 20.954, 3), ("no_friction", 24.844, 3)]
)
def test_the_motor_is_as_fast_at_the_reversal(motor: MotorRuns, name: str, speed: float, digits: int) -> None:
    found = figure_4.motor_numbers(motor)["speed_at_reversal"]
    assert found["unit"] == "rad/s"
    assert found[name] == pytest.approx(speed, abs=10**-digits)


@pytest.mark.parametrize(
    ("name", "error"), [("start", 4.60), ("no_friction", 3.59), ("midpoint", 0.26), ("smooth", 0.05)]
)
def test_the_motor_s_speed_is_off_by_as_much(motor: MotorRuns, name: str, error: float) -> None:
    found = figure_4.motor_numbers(motor)["speed_rmse"]
    assert found["unit"] == "rad/s"
    assert found[name] == pytest.approx(error, abs=0.005)


def test_the_motor_leaves_the_valid_range_at_j_over_3(motor: MotorRuns) -> None:
    exact = np.abs(motor.runs["exact"]["speed"])
    assert np.array_equal(motor.valid, exact <= 50 / 3)


def test_the_lag_of_start_is_the_damping_at_standstill(motor: MotorRuns) -> None:
    """K_f = mu j at rest: from there the first linear model hardly moves in a period; the exact motor does."""
    model = motor.model
    at_rest = Linearizer(model)([0.0, 0.0], [figure_4.MOTOR_VOLTAGE])
    mu, J = model.value("coulomb_friction.mu"), model.value("J")
    assert at_rest.A[1, 1] == pytest.approx(-(mu * model.sign_order + model.value("B")) / J)
    first = round(model.update_period / figure_4.MOTOR_STEP)
    assert motor.runs["start"]["speed"][first] < 0.05 * motor.runs["exact"]["speed"][first]


def test_the_midpoint_costs_nothing_at_the_reversal(motor: MotorRuns) -> None:
    """Both operating points settle on the speed of f_j, not on that of the motor: the order j is what is left."""
    found = figure_4.motor_numbers(motor)["speed_at_reversal"]
    assert found["midpoint"] == pytest.approx(found["smooth"], abs=1e-3)
    assert found["start"] == pytest.approx(found["smooth"], abs=0.01)


def test_the_motor_follows_f_j_at_the_order_of_its_operating_point() -> None:
    """Order in the update period against f_j: 1 for start, more for midpoint; in motion, away from the reversal."""
    model = Model.load("dc_motor")
    t = np.arange(0, 0.8 + 1e-9, 0.0025)
    u, x0 = np.full((t.size, 1), 2.0), [0.5, 2.0]
    truth = simulate(model, t, u, x0, kind="smooth", rtol=1e-11)["speed"]
    periods = (0.04, 0.02, 0.01)
    orders = {}
    for point in ("start", "midpoint"):
        found = []
        for period in periods:
            held = model.with_options(operating_point=point, update_period=period)
            error = simulate(held, t, u, x0, kind="piecewise")["speed"] - truth
            found.append(np.sqrt(np.mean(error**2)))
        orders[point] = np.polyfit(np.log(periods), np.log(found), 1)[0]
    assert orders["start"] == pytest.approx(1.0, abs=0.2)
    assert orders["midpoint"] == pytest.approx(2.0, abs=0.3)


# ---------------------------------------------------------------- hysteresis: numbers from outside


@pytest.mark.parametrize(("point", "error"), [("start", 1.83), ("midpoint", 0.21)])
def test_the_restoring_force_is_off_by_as_much(
    errors: Mapping[str, list[float]], oscillator: OscillatorRuns, point: str, error: float
) -> None:
    """RMS error over 40 s in % of the standard deviation. With `midpoint` the other program let the input go on over
    the half period that it predicted; here it is held, as it is online, which makes 0.204 of its 0.2115.
    """
    found = figure_5.oscillator_numbers(oscillator, errors)["force_rmse_against_exact"]
    assert found[point] == pytest.approx(error, abs=0.01)


@pytest.mark.parametrize(("state", "largest"), [("displacement", 0.91), ("hysteresis", 1.35)])
def test_the_non_smooth_oscillator_goes_as_far(
    errors: Mapping[str, list[float]], oscillator: OscillatorRuns, state: str, largest: float
) -> None:
    found = figure_5.oscillator_numbers(oscillator, errors)["largest"]
    assert found[state]["value"] == pytest.approx(largest, abs=0.005)
    assert oscillator.force("exact").std() == pytest.approx(0.703, abs=0.0005)


def test_three_times_the_force_takes_the_hysteresis_to_30(oscillator: OscillatorRuns) -> None:
    """beta + gamma < 0: the loop never saturates."""
    run = simulate(oscillator.model, oscillator.t, 3 * oscillator.u)
    assert np.abs(run["hysteresis"]).max() == pytest.approx(30, abs=0.5)


# ---------------------------------------------------------------- hysteresis: theory only, whatever the parameters


def test_the_error_of_the_oscillator_falls_with_the_period(errors: Mapping[str, list[float]]) -> None:
    """Against f_j: order 1 for start; about 1.7 or better for midpoint."""
    orders = {name: figure_5.observed_orders(values) for name, values in errors.items()}
    assert orders["start"][-1] == pytest.approx(1.0, abs=0.35)
    overall = np.polyfit(np.log(figure_5.OBSERVED_PERIODS), np.log(errors["midpoint"]), 1)[0]
    assert 1.5 <= overall <= 2.5


def test_the_midpoint_is_better_on_the_oscillator(errors: Mapping[str, list[float]], oscillator: Any) -> None:
    assert all(m < s for m, s in zip(errors["midpoint"], errors["start"], strict=True))
    found = figure_5.oscillator_numbers(oscillator, errors)["force_rmse_against_exact"]
    assert found["midpoint"] < found["start"]


def test_the_restoring_force_is_what_accelerates_the_mass(oscillator: OscillatorRuns) -> None:
    """m v' = F - c v - restoring force, by central differences: the force is not a formula of its own."""
    model, run, dt = oscillator.model, oscillator.runs["exact"], figure_5.OSCILLATOR_STEP
    v = run["velocity"]
    acceleration = (v[2:] - v[:-2]) / (2 * dt)
    held = (oscillator.u[1:-1, 0] + oscillator.u[:-2, 0]) / 2  # the input before and after the sample
    expected = held - model.value("c") * v[1:-1] - model.value("m") * acceleration
    force = oscillator.force("exact")
    assert np.sqrt(np.mean((force[1:-1] - expected) ** 2)) < 1e-3 * force.std()


# ---------------------------------------------------------------- figure 3: tangent and line through the origin


def test_of_falling_friction_the_tangent_s_slope_alone_is_an_unstable_drive() -> None:
    model = line.coasting_shaft()
    T, L = line.tangent_and_line(model, line.LINE_SPEED)
    J, mu = model.value("m"), model.value("stribeck_friction.mu")
    f = -mu * (1 + np.exp(-1)) / J  # at v_s, where the excess, as large as mu, has fallen to 1/e
    for linear in (T, L):
        assert linear.A[1, 1] * line.LINE_SPEED + linear.c[1] == pytest.approx(f, rel=1e-6)
    assert T.A[1, 1] == pytest.approx(2 * mu / J * np.exp(-1) / line.LINE_SPEED, rel=1e-6)
    assert (L.A[1, 1], L.c[1]) == (pytest.approx(f / line.LINE_SPEED, rel=1e-6), 0)
    assert T.c[1] < f


def test_coasting_in_closed_form_is_the_linear_model() -> None:
    t = np.linspace(0, line.COASTING, 2001)
    x = line.coasted(t, 3.0, -20.0)
    np.testing.assert_allclose(np.gradient(x, t)[1:-1], (3.0 * x - 20.0)[1:-1], rtol=1e-4)
    assert x[0] == line.LINE_SPEED


# ---------------------------------------------------------------- the files


@pytest.mark.slow
def test_all_is_written_and_the_files_hold_the_numbers(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra plot")
    written = figures.make_figures(tmp_path / "new" / "folder")
    names = [Path(file).name for file in written["files"]]
    assert names == [
        *("beyond_order.png", "beyond_sign.png", "figure_1.png", "figure_2.png", "figure_3.png"),
        *("figure_4.json", "figure_4.png", "figure_5.json", "figure_5.png", "figure_6.png"),
    ]
    for file in map(Path, written["files"]):
        if file.suffix == ".json":
            assert json.loads(file.read_text(encoding="utf-8")) == json.loads(json.dumps(written[file.stem]))
        else:
            assert size_of_png(file) > (500, 300)


def size_of_png(file: Path) -> tuple[int, int]:
    data = file.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = struct.unpack(">II", data[16:24])
    return width, height


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="file"):
        figures.make_figures(tmp_path / "file")


def test_without_matplotlib_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def no_matplotlib(name: str, *rest: Any, **more: Any) -> Any:
        if name.split(".", maxsplit=1)[0] == "matplotlib":
            raise ModuleNotFoundError(name=name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", no_matplotlib)
    with pytest.raises(MissingExtraError, match=r"signlin_ros\[plot\]"):
        figures.make_figures(tmp_path)
