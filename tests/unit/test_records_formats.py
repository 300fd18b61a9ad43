"""Parquet, Arrow, MDF4, TDMS, NumPy's .npz, MAT 7.3 and Simulink's structures, each written by its own library."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from signlin_ros.errors import RecordError
from signlin_ros.files import ARRAYS, TABLES
from signlin_ros.model import Model
from signlin_ros.records import ModelData, read_for_model
from signlin_ros.records.formats.tables import READERS

T = np.arange(50) * 0.01
U, C, W = np.sin(9 * T), 1e3 * np.cos(5 * T), 60.0 * T
MOTOR = Model.load("dc_motor")


def same(data: ModelData) -> None:
    np.testing.assert_allclose(data.t, T, atol=1e-9)
    np.testing.assert_allclose(data.u[:, 0], U)
    np.testing.assert_allclose(data.measured["current"], C / 1000)
    np.testing.assert_allclose(data.measured["speed"], W * np.pi / 30)


def test_every_table_has_a_reader() -> None:
    assert {*READERS, *ARRAYS} == set(TABLES)


def test_parquet(tmp_path: Path) -> None:
    pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "run.parquet"
    table = {"t": T, "voltage": U, "current_mA": C, "speed [rpm]": W, "mode": ["idle"] * T.size}
    parquet.write_table(pa.table(table), path)
    same(read_for_model(path, MOTOR))
    stamps = (1766147454000000001 + np.round(T * 1e9).astype(np.int64)).astype("datetime64[ns]")
    parquet.write_table(pa.table({**table, "t": stamps}), path)
    same(read_for_model(path, MOTOR))
    path.write_bytes(b"rubbish")
    with pytest.raises(RecordError, match=r"not a readable \.parquet file"):
        read_for_model(path, MOTOR)


@pytest.mark.parametrize("suffix", [".feather", ".arrow"])
def test_arrow(tmp_path: Path, suffix: str) -> None:
    pa, ipc = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.ipc")
    path = tmp_path / f"run{suffix}"
    table = pa.table({"t": T, "voltage": U, "current_mA": C, "speed [rpm]": W, "mode": ["idle"] * T.size})
    lz4 = ipc.IpcWriteOptions(compression="lz4")  # as Feather does
    with ipc.new_file(path, table.schema, options=lz4) as file:
        file.write_table(table)
    same(read_for_model(path, MOTOR))
    path.write_bytes(b"rubbish")
    with pytest.raises(RecordError, match=rf"not a readable \{suffix} file"):
        read_for_model(path, MOTOR)


def test_npz(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    np.savez(path, t=T, voltage=U, y=np.column_stack([C, W]), meta=np.array({"rig": 3}))
    mapped = {"current": "y[0] [mA]", "speed": "y[1] [rpm]"}
    data = read_for_model(path, MOTOR, mapped)
    same(data)
    assert any("'meta' is left out" in str(note) for note in data.notes)
    np.savez_compressed(path, dt=0.01, voltage=U, current_mA=C, speed_rpm=W)
    same(read_for_model(path, MOTOR))
    for rubbish in (b"rubbish", path.read_bytes()[:300]):
        path.write_bytes(rubbish)
        with pytest.raises(RecordError, match=r"not a readable \.npz file"):
            read_for_model(path, MOTOR)


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning", "ignore::UserWarning")
def test_mdf(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    path = tmp_path / "run.mf4"
    with asammdf.MDF(version="4.10") as file:
        for name, values, unit in (("voltage", U, "V"), ("current", C, "mA"), ("speed", W, "rpm")):
            file.append(asammdf.Signal(samples=values, timestamps=T, name=name, unit=unit))
        file.save(path)
    same(read_for_model(path, MOTOR))


def test_tdms(tmp_path: Path) -> None:
    tdms = pytest.importorskip("nptdms")
    path = tmp_path / "run.tdms"
    step = {"wf_increment": 0.01, "wf_start_offset": 0.0}
    channels = [
        tdms.ChannelObject("log", name, values, {**step, "unit_string": unit})
        for name, values, unit in (("voltage", U, "V"), ("current", C, "mA"), ("speed", W, "rpm"))
    ]
    with tdms.TdmsWriter(path) as writer:
        writer.write_segment(channels)
    same(read_for_model(path, MOTOR))


def test_mat_7_3(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "run.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        group = file.create_group("data")
        for name, values in (("t", T), ("voltage", U), ("current_mA", C), ("speed_rpm", W)):
            group[name] = values[None, :]
        file["title"] = np.frombuffer("run".encode("utf-16le"), dtype=np.uint16)
        file["title"].attrs["MATLAB_class"] = np.bytes_("char")
    block = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    raw = path.read_bytes()
    path.write_bytes(block + raw[len(block) :])
    same(read_for_model(path, MOTOR))


def simulink(values: np.ndarray, label: str) -> dict[str, object]:
    return {"time": T[:, None], "signals": {"values": values[:, None], "dimensions": 1.0, "label": label}}


@pytest.mark.parametrize("way", ["structures", "rows", "columns", "step", "tout"])
def test_simulink(tmp_path: Path, way: str) -> None:
    path = tmp_path / "run.mat"
    written = {
        "structures": {"voltage": simulink(U, "u"), "current": simulink(C, "i"), "speed": simulink(W, "w")},
        "rows": {"ans": np.array([T, U, C, W])},
        "columns": {"log": np.array([T, U, C, W]).T},
        "step": {"u": U[:, None], "y": np.column_stack([C, W]), "Ts": 0.01},
        "tout": {"tout": T[:, None], "yout": np.column_stack([U, C, W])},
    }
    savemat(path, written[way])
    first = {"rows": ("ans[1]", "ans[2]", "ans[3]"), "columns": ("log[1]", "log[2]", "log[3]"),
             "step": ("u", "y[0]", "y[1]"), "tout": ("yout[0]", "yout[1]", "yout[2]"),
             "structures": ("voltage", "current", "speed")}[way]  # fmt: skip
    mapped = {"voltage": first[0], "current": f"{first[1]} [mA]", "speed": f"{first[2]} [rpm]"}
    same(read_for_model(path, MOTOR, mapped))
