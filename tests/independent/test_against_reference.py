"""The product against the reference: linear models to 1e-9, trajectories to 0.5 % of their deviation."""

import contextlib
import io
import json

import numpy as np
import pytest
from cases import (
    CASES,
    COULOMB,
    GRAVITY,
    LOAD,
    LOOP,
    METHODS,
    MOTOR,
    OSCILLATOR,
    QUASI_STATIC,
    case,
    multisine,
    points,
    sampled,
    write_model,
)
from reference_linearize import Reference
from reference_simulate import read_csv, simulate, write_csv

from signlin_ros import cli

pytestmark = pytest.mark.xdist_group("reference")  # whose kernels are compiled once


def signlin(*arguments):
    """The command line, in this process; its standard output."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        code = cli.main([str(argument) for argument in arguments])
    assert code == 0, " ".join(map(str, arguments))
    return out.getvalue()


def floats(nested):
    return np.array(nested, dtype=float)


def assert_same(A, B, c, expected, where):
    """To 1e-9 of the largest entry of A in the same row, and of 1, and of the entry itself."""
    for name, entries in (("A", A), ("B", B), ("c", c)):
        want = floats(getattr(expected, name))
        found = np.reshape(np.asarray(entries, dtype=float), want.shape)
        rows = np.maximum(1, np.abs(floats(expected.A)).max(axis=1))
        allowed = 1e-9 * np.maximum(rows[:, None] if want.ndim == 2 else rows, np.abs(want))
        bad = ~(np.abs(found - want) <= allowed)
        assert not bad.any(), f"{where}: {name} is\n{found}\nand the reference says\n{want}"


# --- linearize, in this process: every case, method and point


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", CASES)
def test_linearize_is_the_reference(name, method, tmp_path):
    from signlin_ros.linearization import linearize
    from signlin_ros.model import Model

    reference = Reference(CASES[name])
    model = Model.load(write_model(CASES[name], tmp_path / "model.yaml"))
    assert list(model.states) == reference.states
    assert list(model.inputs) == reference.inputs
    for x, u in points(name):
        expected = reference.linearize(x, u, method)
        found = linearize(model, floats(expected.x), floats(expected.u), method)
        assert_same(found.A, found.B, found.c, expected, f"{name}, {method}, x = {x}, u = {u}")
        np.testing.assert_allclose(found.f, floats(expected.f), rtol=1e-9, atol=1e-11)
        assert bool(found.in_valid_range) is expected.in_valid_range, f"x = {x}, u = {u}"


@pytest.mark.parametrize("name", ["motor", "quasi_static", "oscillator", "bouc_wen", "element_dahl"])
def test_midpoint_is_where_f_j_arrives_after_half_a_period(name, tmp_path):
    from signlin_ros.linearization import linearize
    from signlin_ros.model import Model

    content = {**CASES[name], "operating_point": "midpoint", "update_period": 0.1}
    model = Model.load(write_model(content, tmp_path / "model.yaml"))
    for x, u in list(points(name))[:2]:
        expected = Reference(content).linearize(x, u, "termwise")
        start = [x[n] for n in model.states]
        found = linearize(model, np.array(start), floats(expected.u), "termwise")
        np.testing.assert_allclose(found.x, floats(expected.x), rtol=1e-5, atol=1e-6)
        # at the point that the product reports, the rest must agree as ever
        there = dict(zip(model.states, map(float, found.x), strict=True))
        same_point = Reference({**content, "operating_point": "start"}).linearize(there, u, "termwise")
        assert_same(found.A, found.B, found.c, same_point, f"{name} at {there}")


# --- linearize, through the command line

AT_THE_PROMPT = list(CASES)[1::3]


@pytest.mark.parametrize("name", AT_THE_PROMPT)
def test_the_command_line_prints_the_reference(name, tmp_path):
    reference = Reference(CASES[name])
    method = METHODS[AT_THE_PROMPT.index(name) % 3]
    x, u = list(points(name))[(0, 5)[AT_THE_PROMPT.index(name) % 2]]  # an ordinary point, or one at 1e-14
    arguments = [
        f"{option}={','.join(f'{n}={v!r}' for n, v in d.items())}" for option, d in (("--at", x), ("--input", u))
    ]
    model = write_model(CASES[name], tmp_path / "model.yaml")
    out = json.loads(signlin("linearize", model, *arguments, "--method", method, "--json"))
    expected = reference.linearize(x, u, method)
    assert_same(out["A"], out["B"], out["c"], expected, f"{name}, {method}, x = {x}, u = {u}")
    np.testing.assert_allclose(out["f"], floats(expected.f), rtol=1e-9, atol=1e-11)
    assert out["x"] == [x[n] for n in reference.states] == [x[n] for n in out["states"]]
    assert out["u"] == [u[n] for n in reference.inputs] == [u[n] for n in out["inputs"]]
    assert out["method"] == method
    assert out["sign_order"] == reference.j
    assert out["in_valid_range"] is expected.in_valid_range
    assert out["delay"] == CASES[name]["effects"].get("input_delay", {}).get("T", 0.0)


def test_the_command_line_takes_the_models_own_method_and_0_for_what_is_not_named(tmp_path):
    for name, method in (("motor", "termwise"), ("bouc_wen", "optimal")):
        out = json.loads(
            signlin("linearize", write_model(CASES[name], tmp_path / "m.yaml"), "--at", "velocity=0.4", "--json")
        )
        expected = Reference(CASES[name]).linearize({Reference(CASES[name]).v_name: 0.4}, {})
        assert out["method"] == method
        assert_same(out["A"], out["B"], out["c"], expected, name)


# --- simulate, through the command line

SLOW = 2 * np.pi * 0.4
T = sampled(6.0)
STICK_SLIP = {"stribeck_friction": {"mu": 0.025, "excess": 0.03, "v_s": 2.5}}
RECORDS = {
    "stick_slip": (
        case("dc_motor", MOTOR, STICK_SLIP, with_position=True),
        T,
        {"voltage": 1.2 * np.sin(SLOW * T)},
    ),
    "stick_slip_coarse_samples": (
        case("dc_motor", MOTOR, STICK_SLIP),
        T[::8],
        {"voltage": 1.2 * np.sin(SLOW * T[::8])},
    ),
    "gravity_holds_still": (
        case(
            "dc_motor",
            MOTOR,
            COULOMB | {"gravity_load": {"A": 0.08}},
            initial_state={"position": 0.3},
        ),
        T,
        {"voltage": np.where((T > 1) & (T < 1.6), 1.5, 0.0)},
    ),
    "many_effects": (
        case(
            "dc_motor",
            MOTOR,
            STICK_SLIP
            | LOAD
            | GRAVITY
            | {
                "viscous_friction": {"b": 2e-4},
                "cogging_torque": {"A": 0.01, "N": 5.0, "phi": 0.6},
                "hard_stop": {"gap": 1.5, "k_s": 1.0},
            },
        ),
        T,
        {"voltage": 2.0 * np.sin(SLOW * T)},
    ),
    "quasi_static_load_torque": (
        case("dc_motor", QUASI_STATIC, COULOMB, with_load_torque=True),
        T,
        {"voltage": 1.5 * np.sin(SLOW * T), "load_torque": 0.02 * np.sign(np.sin(3.1 * T))},
    ),
    "oscillator": (
        case(
            "mass_spring_damper",
            OSCILLATOR,
            {"coulomb_friction": {"mu": 1.2}},
            initial_state={"displacement": 0.1},
        ),
        T,
        {"force": np.where(T < 4.5, multisine(T, 1.5, (0.3, 0.7, 1.1, 2.3), 1), 0.0)},
    ),
    "bouc_wen": (
        case("bouc_wen", OSCILLATOR | LOOP, initial_state={"hysteresis": 0.2}),
        T,
        {"force": multisine(T, 2.0, (0.3, 0.7, 1.1, 2.3), 2)},
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", RECORDS)
def test_simulate_is_the_reference(name, tmp_path):
    content, t, inputs = RECORDS[name]
    write_csv(tmp_path / "data.csv", {"t": t, **inputs})
    model = write_model(content, tmp_path / "model.yaml")
    signlin("simulate", model, tmp_path / "data.csv", "-o", tmp_path / "out.csv")
    found, expected = read_csv(tmp_path / "out.csv"), simulate(content, t, inputs)
    np.testing.assert_allclose(found["t"], t, atol=1e-12)
    for state, want in expected.items():
        if state in found:
            rms = np.sqrt(np.mean((found[state] - want) ** 2))
            assert rms < 0.005 * np.std(want), f"{state}: {100 * rms / np.std(want):.3f} %"
    for state in Reference(content).states:
        assert state in found
    if content["plant"] == "bouc_wen":
        return
    v = "speed" if content["plant"] == "dc_motor" else "velocity"
    still = np.convolve(expected[v] == 0, np.ones(3), mode="same") == 3  # still at this sample and its neighbours
    assert still.sum() >= 4
    assert np.all(found[v][still] == 0.0), "it must be exactly still while it sticks"
