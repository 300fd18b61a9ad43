"""The real records read whole. They are not part of the project: SIGNLIN_DATA names their folder."""

import os
from pathlib import Path

import numpy as np
import pytest

from signlin_ros.model import Model
from signlin_ros.records import read_for_model, read_record, write_record

DATA = Path(os.environ.get("SIGNLIN_DATA", "../shared/data"))
pytestmark = pytest.mark.skipif(
    not DATA.is_dir(), reason=f"the measurement records are not at {DATA} (set SIGNLIN_DATA to their folder)"
)
FILES = sorted(DATA.rglob("*.csv")) + sorted(DATA.rglob("*.mat")) if DATA.is_dir() else []
FILES = [file for file in FILES if "field" not in file.parts]  # those are test_field.py's


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(DATA)))
def test_every_record_reads(path: Path, tmp_path: Path) -> None:
    record = read_record(path)
    assert len(record) > 1000
    assert np.all(np.diff(record.t) > 0)
    assert all(np.isfinite(signal.values).all() for signal in record.signals.values())
    write_record(record, tmp_path / "copy.csv", with_units=True)
    again = read_record(tmp_path / "copy.csv")
    np.testing.assert_array_equal(again.t, record.t)
    for name, signal in record.signals.items():
        np.testing.assert_array_equal(again.signals[name].values, signal.values)
        assert again.signals[name].unit == signal.unit


def test_emps() -> None:
    model = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 95.1, "c": 203.5, "k": 0.0}})
    signals = {"displacement": "q_meas [m]", "force": "force"}
    data = read_for_model(DATA / "emps/DATA_EMPS.csv", model, signals)
    assert data.u.shape == (24841, 1)
    assert data.u[0, 0] == 89.2344322
    assert list(data.measured) == ["displacement"]
    matlab = read_record(DATA / "emps/DATA_EMPS.mat", {"displacement": "qm"})
    np.testing.assert_allclose(matlab.signals["displacement"].values, data.measured["displacement"], rtol=1e-8)


@pytest.mark.parametrize("name", ["kp100_sin_sin", "kp400_lift_and_drop"])
def test_xl330(name: str) -> None:
    model = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 0.00654, "c": 0.0324, "k": 0.0}})
    data = read_for_model(DATA / f"xl330/xl330_{name}.csv", model, {"displacement": "q_meas", "force": "torque"})
    assert data.units["displacement"] == "rad"
    assert any("unevenly sampled" in note for note in data.notes)


def test_mr_damper() -> None:
    model = Model.from_dict({"plant": "force_element", "parameters": {"c": 800.0, "k": 0.0}})
    signals = {"displacement": "x", "velocity": "v", "force": "F"}
    data = read_for_model(DATA / "mr_damper/ensaio4.1_0V.csv", model, signals)
    raw = read_record(DATA / "mr_damper/ensaio4.1_0V.csv")
    np.testing.assert_array_equal(data.u[:, 0], raw.signals["v"].values / 1000)
    np.testing.assert_array_equal(data.measured["force"], raw.signals["F"].values)
