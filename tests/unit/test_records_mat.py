"""MAT files."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from signlin_ros.errors import RecordError
from signlin_ros.model import Model
from signlin_ros.records import read_for_model, read_record

T = np.linspace(0, 1, 11)


def test_vectors_matrices_and_scalars(tmp_path: Path) -> None:
    path = tmp_path / "run.mat"
    q = np.arange(22.0).reshape(11, 2)
    savemat(path, {"t": T[:, None], "u": T[None, :], "q": q, "gain": 3.0, "short": [1.0, 2.0], "name": "axis"})
    record = read_record(path)
    assert list(record.signals) == ["u", "q[0]", "q[1]"]
    np.testing.assert_array_equal(record.signals["q[1]"].values, q[:, 1])
    assert record.notes == (
        "'gain' is left out: it is one number",
        "'name' is left out: it is text",
        "'short' is left out: it is 1x2, the time has 11 values",
    )


def test_what_is_left_out_is_said_with_its_reason(tmp_path: Path) -> None:
    path = tmp_path / "run.mat"
    odd = {"z": T + 1j, "none": [], "cube": np.zeros((2, 2, 2)), "cells": np.array([1, "a"], dtype=object)}
    savemat(path, {"t": T, "u": T, **odd, "data": {"k": 1.0, "m": 2.0}})
    record = read_record(path)
    assert list(record.signals) == ["u"]
    assert set(record.notes) == {
        "'z' is left out: it is complex",
        "'none' is left out: it is empty",
        "'cube' is left out: it is of 3 dimensions",
        "'cells' is left out: it is no array of numbers",
        "'data.k', 'data.m' are left out: each is one number",
    }
    with pytest.raises(RecordError, match=r"no column for input 'voltage'.*'z' is left out: it is complex"):
        read_for_model(path, Model.load("dc_motor"))


def test_struct(tmp_path: Path) -> None:
    path = tmp_path / "run.mat"
    savemat(path, {"data": {"time": T, "voltage": 2 * T, "motor": {"speed": 3 * T}}})
    record = read_record(path, {"omega": "data.motor.speed"})
    assert set(record.signals) == {"voltage", "omega"}
    assert record.find("data.voltage") == "voltage"


def test_a_structure_with_time_and_several_signals(tmp_path: Path) -> None:
    path = tmp_path / "run.mat"
    rows = [(2 * T[:, None], "voltage"), (3 * T[:, None], "<speed>"), (4 * T[:, None], "")]
    signals = np.array(rows, dtype=[("values", "O"), ("label", "O")])
    savemat(path, {"scope": {"time": T[:, None], "signals": signals, "blockName": "rig/scope"}})
    record = read_record(path)
    assert {n: one.values[-1] for n, one in record.signals.items()} == {"voltage": 2.0, "speed": 3.0, "3": 4.0}
    assert record.find("scope.speed") == "speed"


def test_time_under_another_name(tmp_path: Path) -> None:
    path = tmp_path / "run.mat"
    savemat(path, {"uhr": T, "u": T})
    with pytest.raises(RecordError, match=r"no time vector.*'uhr', 'u'"):
        read_record(path)
    np.testing.assert_array_equal(read_record(path, {"t": "uhr"}).t, T)


def test_faults_name_the_row(tmp_path: Path) -> None:
    path = tmp_path / "run.mat"
    savemat(path, {"t": [0.0, np.nan, 0.5], "u": [1.0, 2.0, 3.0]})
    with pytest.raises(RecordError, match=r"run\.mat: row 2: .*not a finite number"):
        read_record(path)


def test_version_7_3_and_rubbish(tmp_path: Path) -> None:
    path = tmp_path / "run.mat"
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + b"\x89HDF\r\n\x1a\n" + bytes(200))
    with pytest.raises(RecordError, match=r"7\.3.*-v7"):
        read_record(path)
    path.write_bytes(b"rubbish")
    with pytest.raises(RecordError, match="not a readable MAT file"):
        read_record(path)
    path.write_bytes(b"")
    with pytest.raises(RecordError, match="not a readable MAT file"):
        read_record(path)


def test_groups_and_tables_of_hdf5(tmp_path: Path) -> None:
    """An episode of a robot's demonstration, with a table of its own beside."""
    h5py = pytest.importorskip("h5py")
    t = 0.02 * np.arange(50)
    with h5py.File(tmp_path / "episode_0.hdf5", "w") as file:
        file["action"] = np.outer(t, [1.0, 2.0])
        file.create_group("observations")["qpos"] = np.outer(t, [3.0, 4.0])
        file["observations/images"] = np.zeros((50, 2, 2))
        file["log"] = np.array(list(zip(t, 5.0 * t, strict=True)), dtype=[("time", float), ("u", float)])
    record = read_record(tmp_path / "episode_0.hdf5")
    np.testing.assert_allclose(record.t, t)
    found = {
        name: record.signals[record.require(name)].values[1] / 0.02
        for name in ("action[1]", "observations.qpos[0]", "u")
    }
    assert found == pytest.approx({"action[1]": 2.0, "observations.qpos[0]": 3.0, "u": 5.0})
    (tmp_path / "broken.h5").write_bytes(b"no such file")
    with pytest.raises(RecordError, match=r"broken.h5: not an HDF5 file that can be read"):
        read_record(tmp_path / "broken.h5")
