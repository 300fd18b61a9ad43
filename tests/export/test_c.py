"""Exported C: clean under strict warnings, the same numbers as ours, on this machine and compiled for others."""

import ctypes
import importlib.util
import subprocess

import numpy as np
import pytest

from signlin_ros.compiled import scales
from signlin_ros.export import export
from signlin_ros.export.base import NotRunError
from signlin_ros.export.c import TARGET
from signlin_ros.export.compiler import STRICT_FLAGS, build, compiler, zig
from signlin_ros.export.excitation import standard_excitation
from signlin_ros.export.functions import smooth_rates
from signlin_ros.export.matrix import models
from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.sign import sign_j
from signlin_ros.simulation import simulate


def _has_compiler():
    try:
        compiler()
    except NotRunError:
        return False
    return True


needs_compiler = pytest.mark.skipif(not _has_compiler(), reason="no C compiler on this machine")
NAMES = ["dc_motor", "mass_spring_damper", "bouc_wen", "emps", "xl330"]
EFFECTS = ["stribeck_friction", "lugre_friction", "backlash", "load_dependent_friction", "hard_stop", "torque_ripple"]


def _model(name):
    return dict(models())[name] if name in EFFECTS else Model.load(name)


@pytest.fixture(scope="module", params=[*NAMES, *EFFECTS])
def exported(request, tmp_path_factory):
    """A model, what was exported, and the compiled library."""
    folder = tmp_path_factory.mktemp("c")
    model = _model(request.param)
    found = export(model, "c", folder / "drive.c")
    library = folder / "drive.so"
    build([folder / "drive.c"], library)
    return model, found, ctypes.CDLL(str(library))


def _call(function, *arrays, out):
    result = np.zeros(out)
    pointer = ctypes.POINTER(ctypes.c_double)
    function(
        *(np.ascontiguousarray(a, dtype=float).ctypes.data_as(pointer) for a in arrays), result.ctypes.data_as(pointer)
    )
    return result


def _points(model, count=60):
    rng = np.random.default_rng(0)
    n, m = len(model.states), len(model.inputs)
    size = 10.0 ** rng.uniform(-3, 0.5, (count, 1))
    return rng.normal(size=(count, n)) * size, rng.normal(size=(count, m)) * size


@needs_compiler
def test_rates_are_those_of_the_model(exported):
    model, _, library = exported
    f = smooth_rates(model)
    for x, u in zip(*_points(model), strict=True):
        ours = np.array(f(x, u, model.p, scales(model))).ravel()
        theirs = _call(library.drive_f, x, u, out=ours.size)
        assert theirs == pytest.approx(ours, rel=1e-12, abs=1e-12 * np.abs(ours).max())


@needs_compiler
def test_linearization_is_that_of_the_model(exported):
    model, _, library = exported
    linear = Linearizer(model.with_options(operating_point="start"))
    n, m = len(model.states), len(model.inputs)
    for x, u in zip(*_points(model, 20), strict=True):
        ours = linear(x, u)
        A, B, c = np.zeros((n, n)), np.zeros((n, m)), np.zeros(n)
        pointer = ctypes.POINTER(ctypes.c_double)
        valid = library.drive_linearize(*(a.ctypes.data_as(pointer) for a in (x, u, A, B, c)))
        largest = np.abs(ours.A).max()
        assert pytest.approx(ours.A, rel=1e-11, abs=1e-12 * largest) == A
        assert pytest.approx(ours.B, rel=1e-12, abs=1e-12) == B
        assert pytest.approx(ours.c, rel=1e-11, abs=1e-11 * max(1.0, np.abs(ours.f).max())) == c
        assert bool(valid) is ours.in_valid_range
        assert _call(library.drive_A, x, u, out=n * n) == pytest.approx(A.ravel(), rel=1e-12, abs=1e-12 * largest)
        assert _call(library.drive_B, x, u, out=n * m) == pytest.approx(B.ravel(), rel=1e-12, abs=1e-12)


@needs_compiler
def test_step_is_one_of_runge_and_kutta(exported):
    model, _, library = exported
    f = smooth_rates(model)

    def rates(x, u):
        return np.array(f(x, u, model.p, scales(model))).ravel()

    h = 1e-5
    for x, u in zip(*_points(model, 20), strict=True):
        k1 = rates(x, u)
        k2 = rates(x + h / 2 * k1, u)
        k3 = rates(x + h / 2 * k2, u)
        ours = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + rates(x + h * k3, u))
        theirs = np.array(x)
        pointer = ctypes.POINTER(ctypes.c_double)
        library.drive_step(theirs.ctypes.data_as(pointer), u.ctypes.data_as(pointer), ctypes.c_double(h))
        assert theirs == pytest.approx(ours, rel=1e-12, abs=1e-12 * max(1.0, np.abs(ours).max()))


@needs_compiler
def test_sign_is_sign_j(exported):
    model, _, library = exported
    library.drive_sign.restype = ctypes.c_double
    for z in (0.0, 1e-9, 0.3, -0.3, 1.0, -1.0, 3.0, 20.9, 500.0):
        ours = float(sign_j(z, model.sign_order))
        assert library.drive_sign(ctypes.c_double(z)) == pytest.approx(ours, rel=1e-13)


@needs_compiler
@pytest.mark.parametrize(
    ("effect", "values", "force"),
    [
        ("coulomb_friction", {"mu": 0.03}, lambda q, v, tau: -0.03 * sign_j(v, 50)),
        ("viscous_friction", {"b": 0.01}, lambda q, v, tau: -0.01 * v),
        ("cogging_torque", {"A": 0.02, "N": 7.0, "phi": 0.4}, lambda q, v, tau: -0.02 * np.sin(7 * q + 0.4)),
        (
            "load_dependent_friction",
            {"kappa_d": 0.2, "kappa_e": 0.0},
            lambda q, v, tau: -0.2 * tau * sign_j(tau, 50) * sign_j(v, 50),
        ),
        # bristles that slide: z = g/sigma0 sign(v)
        ("dahl_presliding", {"F_c": 0.033, "sigma": 2.0}, lambda q, v, tau: -0.033 / sign_j(v, 50)),
    ],
)
def test_friction_is_the_force_of_the_effects(tmp_path, effect, values, force):
    model = Model.load("dc_motor").without_effect("coulomb_friction").with_effect(effect, **values)
    export(model, "c", tmp_path / "drive.c")
    build([tmp_path / "drive.c"], tmp_path / "drive.so")
    friction = ctypes.CDLL(str(tmp_path / "drive.so")).drive_friction
    friction.restype = ctypes.c_double
    for q, v, tau in ((0.3, 2.0, 0.05), (-1.0, -3.0, 0.1), (2.0, 0.4, -0.2)):
        theirs = friction(*(ctypes.c_double(value) for value in (q, v, tau)))
        assert theirs == pytest.approx(float(force(q, v, tau)), rel=1e-9)


@needs_compiler
def test_run_of_the_compiled_file_is_the_smooth_run(exported):
    model, found, _ = exported
    drive = standard_excitation(model)
    ours = simulate(model, drive.t, drive.u, drive.x0, kind="smooth", rtol=1e-9)
    theirs = TARGET.run(found.exported, model, drive)
    for name in model.states:
        assert np.sqrt(np.mean((theirs[name] - ours[name]) ** 2)) < 5e-3 * np.sqrt(np.mean(ours[name] ** 2))
    assert set(found.loss.channels) <= set(model.states)


@needs_compiler
def test_own_effect_is_exported_with_its_law(tmp_path):
    (tmp_path / "grip.py").write_text(
        "from signlin_ros.effects import Effect\nfrom signlin_ros.par import Par\n"
        "class Grip(Effect):\n"
        '    """Grip."""\n'
        '    name = "grip"\n    equation = "-a sign(v) exp(-|v|)"\n'
        '    a = Par("F", nominal=0.02, doc="grip")\n'
        "    def force(self, m, x, p):\n        return -p.a * m.sign(x.velocity) * m.exp(-m.abs(x.velocity))\n"
    )
    content = {**Model.load("dc_motor").to_dict(), "effect_files": ["grip.py"], "effects": {"grip": {"a": 0.02}}}
    model = Model.from_dict(content, str(tmp_path / "m.yaml"), tmp_path)
    found = export(model, "c", tmp_path / "drive.c")
    assert found.loss.channels["speed"].percent < 5.0
    assert "drive_P_grip_a 0.02" in (tmp_path / "drive.h").read_text()


def test_names_units_and_ranges_are_in_the_header(tmp_path):
    export(Model.load("dc_motor"), "c", tmp_path / "drive.c")
    text = (tmp_path / "drive.h").read_text()
    assert "drive_P_R_a 0.764 /* Ohm, armature resistance" in text
    assert "R_a: 0.6876 to 0.8404" in text
    assert "malloc(" not in text + (tmp_path / "drive.c").read_text()


MACHINES = ["aarch64-linux-musl", "thumb-freestanding-eabihf -mcpu=cortex_m4", "x86_64-windows-gnu"]


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="needs ziglang (signlin_ros[cross])")
@pytest.mark.parametrize("machine", MACHINES)
def test_compiles_for_other_machines(tmp_path, machine):
    export(Model.load("dc_motor"), "c", tmp_path / "drive.c")
    if "freestanding" in machine:  # no C library there: what of it is needed is declared
        (tmp_path / "math.h").write_text(
            "#ifndef MATH_H\n#define MATH_H\ndouble fabs(double); double exp(double); double sin(double);"
            " double cos(double); double pow(double, double); double sqrt(double);\n#endif\n"
        )
    target, *more = machine.split()
    command = [
        *zig(),
        "-target",
        target,
        *more,
        *STRICT_FLAGS,
        "-O2",
        "-I",
        str(tmp_path),
        "-c",
        str(tmp_path / "drive.c"),
    ]
    done = subprocess.run([*command, "-o", str(tmp_path / "drive.o")], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "drive.o").stat().st_size > 0
