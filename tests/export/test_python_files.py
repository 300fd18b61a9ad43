"""Exported Python files: python-control, CasADi, do-mpc and SymPy get the recorded equations."""

import importlib.util

import numpy as np
import pytest

from signlin_ros.compiled import scales
from signlin_ros.export import export, find_target
from signlin_ros.export.excitation import standard_excitation
from signlin_ros.export.functions import exact_rates, smooth_rates
from signlin_ros.export.matrix import models
from signlin_ros.export.python_text import loaded
from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.simulation import simulate

NAMES = ["dc_motor", "bouc_wen", "lugre_friction", "backlash", "cogging_torque"]


@pytest.fixture(scope="module", params=NAMES)
def model(request):
    return dict(models()).get(request.param) or Model.load(request.param)


def _points(model):
    rng = np.random.default_rng(1)
    return rng.normal(size=(20, len(model.states))), rng.normal(size=(20, len(model.inputs)))


def test_control_file_has_f_j_and_its_linearization(model, tmp_path):
    pytest.importorskip("control")
    find_target("python-control").write(model, tmp_path / "drive.py", standard_excitation(model))
    file, f = loaded(tmp_path / "drive.py"), smooth_rates(model)
    linear = Linearizer(model.with_options(operating_point="start"))
    for x, u in zip(*_points(model), strict=True):
        ours = np.array(f(x, u, model.p, scales(model))).ravel()
        assert file["rates"](0.0, x, u, {}) == pytest.approx(ours, rel=1e-11, abs=1e-11 * np.abs(ours).max())
        system, c = file["linear_system"](x, u)
        point = linear(x, u)
        assert pytest.approx(point.A, rel=1e-10, abs=1e-11 * np.abs(point.A).max()) == system.A
        assert pytest.approx(point.B, rel=1e-11) == system.B
        assert pytest.approx(point.c, rel=1e-9, abs=1e-10 * max(1, np.abs(point.f).max())) == c


def test_casadi_file_has_f_j(model, tmp_path):
    found = export(model, "casadi", tmp_path / "drive.py")
    file, f = loaded(tmp_path / "drive.py"), smooth_rates(model)
    function = file["dynamics"]()
    for x, u in zip(*_points(model), strict=True):
        ours = np.array(f(x, u, model.p, scales(model))).ravel()
        theirs = np.array(function(x, u, file["NOMINAL"])).ravel()
        assert theirs == pytest.approx(ours, rel=1e-11, abs=1e-11 * np.abs(ours).max())
    drive = standard_excitation(model)
    ours = simulate(model, drive.t, drive.u, drive.x0, kind="smooth", rtol=1e-9)[model.plant.velocity]
    theirs = find_target("casadi").run(found.exported, model, drive)[model.plant.velocity]
    assert np.sqrt(np.mean((theirs - ours) ** 2)) < 1e-3 * np.sqrt(np.mean(ours**2))


def test_sympy_file_has_the_exact_equations(model, tmp_path):
    sympy = pytest.importorskip("sympy")
    find_target("sympy").write(model, tmp_path / "drive.py", standard_excitation(model))
    file, f = loaded(tmp_path / "drive.py"), exact_rates(model)
    function = sympy.lambdify([*file["x"], *file["u"]], list(file["xdot"].subs(file["values"])), "math")
    for x, u in zip(*_points(model), strict=True):
        ours = np.array(f(x, u, model.p)).ravel()
        theirs = np.array(function(*x.tolist(), *u.tolist()), dtype=float)
        assert theirs == pytest.approx(ours, rel=1e-11, abs=1e-11 * np.abs(ours).max())


@pytest.mark.slow
@pytest.mark.parametrize("target", ["python-control", "sympy", "casadi"])
def test_run_there_is_close_to_ours(target, tmp_path):
    found = export(Model.load("dc_motor"), target, tmp_path / "drive.py")
    assert found.loss.channels["speed"].percent < 1.0


@pytest.mark.skipif(importlib.util.find_spec("do_mpc") is None, reason="needs do-mpc")
@pytest.mark.filterwarnings("ignore")
def test_do_mpc_model_is_set_up(tmp_path):
    found = export(Model.load("dc_motor"), "do-mpc", tmp_path / "drive.py")
    assert found.loss.channels["speed"].percent < 1.0


def test_delay_is_beside_the_equations(tmp_path):
    delayed = dict(models())["input_delay"]
    found = export(delayed, "casadi", tmp_path / "drive.py")
    assert loaded(tmp_path / "drive.py")["DELAY"] == pytest.approx(0.013)
    assert any("DELAY" in line for line in found.exported.lost)
    assert found.loss.channels["speed"].percent < 1.0
