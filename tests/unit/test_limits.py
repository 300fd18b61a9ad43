"""Small files that would fill the memory, or a page of errors, are refused in one short line."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from signlin_ros.errors import RecordError, one_line
from signlin_ros.records import limits, read_record
from signlin_ros.records.grammar import parse

ROWS = "t,voltage,current,speed\n" + "".join(f"{0.01 * k:g},{k % 3},{0.1 * k:g},{0.2 * k:g}\n" for k in range(400))
LONG = 300


def refused(path: Path) -> str:
    with pytest.raises(RecordError) as caught:
        read_record(path)
    said = str(caught.value)
    assert len(said) < LONG
    assert "\n" not in said
    return said


def zipped(**files: bytes) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return out.getvalue()


PACK: dict[str, Callable[[bytes], bytes]] = {
    ".gz": gzip.compress,
    ".bz2": bz2.compress,
    ".xz": lzma.compress,
    ".zip": lambda content: zipped(**{"a.csv": content}),
}


@pytest.mark.parametrize("suffix", sorted(PACK))
def test_what_unpacks_to_more_than_a_hundred_times_the_file_is_refused(tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"a.csv{suffix}"
    file.write_bytes(PACK[suffix](b"0,0\n" * 2_000_000))
    assert "allowed: at most 2 GB or 100 times the file" in refused(file)
    file.write_bytes(PACK[suffix](ROWS.encode()))
    assert len(read_record(file)) == 400


def test_unpacking_stops_where_it_is_too_much(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "UNPACKED", 3 << 20)

    class Endless(io.RawIOBase):
        given = 0

        def read(self, size: int = -1) -> bytes:
            Endless.given += size
            return b"0" * size

    with pytest.raises(RecordError):
        limits.unpacked(Endless(), 1 << 30, "a.gz")  # type: ignore[arg-type]
    assert Endless.given <= 4 << 20


def test_an_archive_of_many_files_is_refused_in_one_line(tmp_path: Path) -> None:
    file = tmp_path / "many.zip"
    file.write_bytes(zipped(**{f"{k}.csv": b"" for k in range(1001)}))
    assert "has 1,001 files; allowed: at most 1,000" in refused(file)
    file.write_bytes(zipped(**{f"{'x' * 100}{k}.csv": b"" for k in range(900)}))
    assert "and 897 more" in refused(file)


def test_arrays_of_more_than_two_gigabytes_are_refused_before_they_are_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "UNPACKED", 10_000)
    columns = {"t": np.arange(5000) * 0.01, "speed": np.zeros(5000)}
    np.savez_compressed(tmp_path / "a.npz", **columns)
    assert "bytes of arrays" in refused(tmp_path / "a.npz")
    savemat = pytest.importorskip("scipy.io").savemat
    savemat(tmp_path / "a.mat", columns, do_compression=True)
    assert "bytes of arrays" in refused(tmp_path / "a.mat")
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    pq.write_table(pa.table(columns), tmp_path / "a.parquet")
    assert "bytes of arrays" in refused(tmp_path / "a.parquet")
    feather = pytest.importorskip("pyarrow.feather")
    feather.write_feather(pa.table(columns), tmp_path / "a.feather", compression="lz4", chunksize=500)
    assert "bytes of arrays" in refused(tmp_path / "a.feather")


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning", "ignore::UserWarning")
def test_channels_of_a_measurement_file_are_counted_before_they_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asammdf = pytest.importorskip("asammdf")
    t = np.arange(5000) * 0.01
    with asammdf.MDF(version="4.10") as file:
        file.append(asammdf.Signal(samples=np.zeros(5000), timestamps=t, name="speed", unit="rpm"))
        file.save(tmp_path / "a.mf4", compression=2)
    monkeypatch.setattr(limits, "UNPACKED", 10_000)
    monkeypatch.setattr(asammdf.MDF, "iter_channels", lambda *_, **__: pytest.fail("they were read"))
    assert "bytes of arrays" in refused(tmp_path / "a.mf4")


def test_a_recording_that_packs_too_well_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    message = store.types["std_msgs/msg/Float64MultiArray"]
    layout = store.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    writer = Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/state", message.__msgtype__, typestore=store)
        zeros = store.serialize_cdr(message(layout=layout, data=np.zeros(50_000)), message.__msgtype__)
        for k in range(40):
            writer.write(connection, k * 1_000_000, zeros)
    assert "allowed: at most 2 GB or 100 times the file" in refused(next((tmp_path / "bag").glob("*.mcap")))


@pytest.mark.parametrize(
    "cell",
    ["1" * 3_000_000, '"' + "a" * 3_000_000, "a" * 3_000_000, "1e" + "9" * 3_000_000],
    ids=["digits", "open quote", "letters", "exponent"],
)
def test_a_cell_of_megabytes_is_refused_with_its_line(tmp_path: Path, cell: str) -> None:
    file = tmp_path / "a.csv"
    file.write_text(f"{ROWS}{cell},1,2,3\n{ROWS.partition(chr(10))[2]}")
    assert "line 402 has a cell of more than" in refused(file)


def test_a_line_of_many_short_cells_is_read(tmp_path: Path) -> None:
    file, width = tmp_path / "wide.csv", 12_000
    lines = [",".join(["t", *(f"drive/axis{k % 7}/temperature_{k}" for k in range(width))])]
    lines += [",".join([f"{0.01 * k:g}", *(["0.25"] * width)]) for k in range(30)]
    file.write_text("\n".join(lines))
    assert len(lines[0]) > 131_072  # what Python's csv takes for a cell at most
    assert len(read_record(file).signals) == width
    limits.check_cells(",".join(["0.25"] * 400_000), "wider.csv")


def test_a_formula_of_too_many_factors_is_refused() -> None:
    names = {"a": "a"}
    assert parse("*".join(["a"] * 200), names, "x").op == "*"
    for text in ("*".join(["a"] * 3000), "+".join(["a"] * 201), "[" * 100_000, "a" * 20_000, "-" * 5000 + "a"):
        with pytest.raises(RecordError) as caught:
            parse(text, names, "run.csv: speed")
        assert len(str(caught.value)) < LONG


def test_a_long_message_is_cut_in_its_middle() -> None:
    said = one_line("begin " + "x " * 5000 + "end")
    assert len(said) <= 1000
    assert said.startswith("begin")
    assert said.endswith("end")
