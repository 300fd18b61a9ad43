"""The exported FMU, run by FMPy: f_j to a part in a million, whatever the steps; valid by the standard's schema."""

import zipfile

import numpy as np
import pytest

from signlin_ros.export import export
from signlin_ros.export.base import ExportedDrive
from signlin_ros.export.fmu import TARGET
from signlin_ros.export.loss import reference
from signlin_ros.model import Model
from signlin_ros.simulation import simulate

fmpy = pytest.importorskip("fmpy")


@pytest.fixture(scope="module")
def unit(tmp_path_factory):
    model = Model.load("dc_motor")
    out = tmp_path_factory.mktemp("fmu") / "motor.fmu"
    found = export(model, "fmu", out)
    if found.exported.settings["binary"] == "sources only":
        pytest.skip("no compiler for a binary")
    return model, found, out


def _drive():
    t = np.arange(0.0, 10.0, 0.01)
    return ExportedDrive(t, 3.0 * np.sin(2 * np.pi * 1.1 * t)[:, None], t, np.zeros(2))


def test_ten_seconds_with_twenty_reversals_are_our_smooth_run(unit):
    model, found, _ = unit
    drive = _drive()
    theirs = TARGET.run(found.exported, model, drive)
    ours = simulate(model, drive.t, drive.u, drive.x0, kind="smooth", rtol=1e-11)
    assert np.count_nonzero(np.diff(np.sign(ours["speed"]))) >= 20
    for name in model.states:
        assert np.abs(theirs[name] - ours[name]).max() < 1e-6 * np.abs(ours[name]).max()
    exact = reference(model, drive)
    assert np.abs(exact["speed"] - ours["speed"]).max() > 1e-4  # what sign_j itself loses is another thing


def test_parameters_can_be_set(unit):
    _, _, out = unit
    u = np.array([(0.0, 2.0), (3.0, 2.0)], dtype=[("time", float), ("voltage", float)])
    ends = [
        fmpy.simulate_fmu(
            str(out), fmi_type=kind, stop_time=3.0, input=u, start_values={"coulomb_friction.mu": mu}, output=["speed"]
        )["speed"][-1]
        for mu in (0.0, 0.033)
        for kind in ("CoSimulation", "ModelExchange")
    ]
    assert ends[0] == pytest.approx(ends[1], rel=1e-4)
    assert ends[2] == pytest.approx(ends[3], rel=1e-4)
    assert ends[0] - ends[2] == pytest.approx(0.033 / 0.0805 * 0.764 / 0.0805, rel=0.02)


def test_unit_is_valid_and_holds_its_sources(unit):
    from fmpy.validation import validate_fmu

    _, found, out = unit
    assert validate_fmu(str(out)) == []
    assert {"modelDescription.xml", "sources/fmi2.c", "sources/model.h"} <= set(zipfile.ZipFile(out).namelist())
    assert found.loss.channels["speed"].percent < 1.0
