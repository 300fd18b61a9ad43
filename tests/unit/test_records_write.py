"""Writing records and reading them back to the bit."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from signlin_ros.errors import RecordError
from signlin_ros.records import Record, Signal, read_record, write_record
from signlin_ros.records import write as write_module

finite = st.floats(allow_nan=False, allow_infinity=False)
sample = st.one_of(finite, st.just(math.nan))
names = st.lists(
    st.from_regex(r"[a-z_][a-z0-9_.]{0,12}", fullmatch=True).filter(
        lambda name: name not in ("t", "time", "timestamp", "stamp")
    ),
    min_size=1,
    max_size=4,
    unique=True,
)


@st.composite
def records(draw: st.DrawFn) -> Record:
    t = sorted(draw(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=20, unique_by=lambda x: x + 0.0)))
    columns = {
        name: Signal(np.array(draw(st.lists(sample, min_size=len(t), max_size=len(t)))))
        for name in draw(
            names.filter(lambda found: not any(name.startswith(("t_", "time", "stamp")) for name in found))
        )
    }
    return Record(np.array(t), columns)


def same(a: Record, b: Record) -> None:
    np.testing.assert_array_equal(a.t.view(np.int64), b.t.view(np.int64))
    assert a.signals.keys() == b.signals.keys()
    for name, signal in a.signals.items():
        nan = np.isnan(signal.values)
        np.testing.assert_array_equal(nan, np.isnan(b.signals[name].values))
        np.testing.assert_array_equal(signal.values[~nan].view(np.int64), b.signals[name].values[~nan].view(np.int64))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(record=records())
def test_csv_round_trip(tmp_path: Path, record: Record) -> None:
    path = tmp_path / "run.csv"
    write_record(record, path)
    same(record, read_record(path))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=30)
@given(record=records())
def test_mcap_round_trip(tmp_path: Path, record: Record) -> None:
    path = tmp_path / "run.mcap"
    if np.any(np.diff(np.round((record.t - record.t[0]) * 1e9)) <= 0):
        with pytest.raises(RecordError, match="nanosecond"):
            write_record(record, path)
    else:
        write_record(record, path)
        same(record, read_record(path))


def motor(t: np.ndarray) -> Record:
    rng = np.random.default_rng(3)
    return Record(t, {name: Signal(rng.normal(size=t.size)) for name in ("voltage", "current", "speed")})


def test_csv_text(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    signals = {"voltage": Signal(np.array([1.0, -0.0]), "V"), "x": Signal(np.array([0.1, np.nan]), "mm")}
    write_record(Record(np.array([0.0, 0.005]), signals), path)
    assert path.read_text() == "t,voltage,x [mm]\n0.0,1.0,0.1\n0.005,-0.0,nan\n"
    write_record(Record(np.array([0.0, 0.005]), signals), path, with_units=True)
    assert path.read_text().startswith("t,voltage [V],x [mm]\n")
    assert read_record(path).signals["voltage"].unit == "V"


def test_chunks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(write_module, "_WRITE_CHUNK", 7)
    record = motor(np.arange(20) * 0.1)
    write_record(record, tmp_path / "run.csv")
    same(record, read_record(tmp_path / "run.csv"))


@pytest.mark.parametrize("suffix", [".csv", ".mcap"])
@pytest.mark.parametrize("start", [0.0, -3.0, 1.7e9])
def test_any_clock(tmp_path: Path, suffix: str, start: float) -> None:
    path = tmp_path / f"run{suffix}"
    record = motor(start + np.arange(50) * 0.004 + 1 / 3)
    write_record(record, path)
    same(record, read_record(path))


def test_mcap_topics(tmp_path: Path) -> None:
    from rosbags.highlevel import AnyReader

    path = tmp_path / "run.mcap"
    write_record(motor(np.arange(10) * 0.005), path, joint_name="wheel")
    with AnyReader([path]) as reader:
        assert {c.topic: c.msgcount for c in reader.connections} == {
            "/input": 10,
            "/state": 10,
            "/joint_states": 10,
        }
        first: dict[str, Any] = {
            c.topic: reader.deserialize(raw, c.msgtype) for c, stamp, raw in reader.messages() if stamp == 5_000_000
        }
    layout = first["/state"].layout
    assert (layout.dim[0].label, layout.dim[0].size, layout.data_offset) == ("current,speed", 2, 0)
    assert first["/joint_states"].name == ["wheel"]
    assert first["/joint_states"].velocity[0] == first["/state"].data[1]
    assert len(first["/joint_states"].position) == 0
    assert first["/joint_states"].header.stamp.nanosec == 5_000_000


@pytest.mark.parametrize("start", [0.0, -3.0, 0.25])
def test_a_joint_that_starts_at_0_is_read_back_without_a_note(tmp_path: Path, start: float) -> None:
    path = tmp_path / "run.mcap"
    record = motor(start + np.arange(10) * 0.005)
    write_record(record, path, joint_name="wheel")
    again = read_record(path)
    np.testing.assert_array_equal(again.t, record.t)
    assert not again.notes
    speeds = [s.values for name, s in again.signals.items() if "joint_states.velocity" in name or name == "speed"]
    for values in speeds:
        np.testing.assert_array_equal(values, record.signals["speed"].values)


@pytest.mark.parametrize("suffix", [".csv", ".mcap"])
def test_an_interrupted_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str) -> None:
    path = tmp_path / f"run{suffix}"
    path.write_text("old")

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_record(motor(np.arange(10) * 0.1), path)
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
    assert path.read_text() == "old"


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "real.csv").write_text("old")
    (tmp_path / "run.csv").symlink_to(tmp_path / "real.csv")
    write_record(motor(np.arange(3) * 0.1), tmp_path / "run.csv")
    assert (tmp_path / "run.csv").is_symlink()
    assert len(read_record(tmp_path / "real.csv")) == 3


def test_refusals(tmp_path: Path) -> None:
    record = motor(np.arange(3) * 0.1)
    for path, reason in (
        (tmp_path / "run.xlsx", r"\.csv or \.mcap"),
        (tmp_path / "run", r"\.csv or \.mcap"),
        (tmp_path / "no" / "run.csv", "does not exist"),
    ):
        with pytest.raises(RecordError, match=reason):
            write_record(record, path)
    with pytest.raises(RecordError, match="'time' cannot stand"):
        write_record(Record(record.t, {"time": Signal(record.t)}), tmp_path / "run.csv")
    assert not list(tmp_path.iterdir())


def test_a_record_checks_itself() -> None:
    t = np.array([0.0, 1.0])
    with pytest.raises(RecordError, match="3 values for 2"):
        Record(t, {"a": Signal(np.zeros(3))})
    with pytest.raises(RecordError, match="sample 2"):
        Record(t * 0, {})
    with pytest.raises(RecordError, match="not finite"):
        Record(t * np.nan, {})
    with pytest.raises(RecordError, match="shape"):
        Signal(np.zeros((2, 2)))
