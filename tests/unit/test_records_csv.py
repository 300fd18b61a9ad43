"""CSV files: what is understood, and what is refused with its place."""

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from signlin_ros.errors import RecordError
from signlin_ros.records import Record, read_record
from signlin_ros.records.formats import regular

Read = Callable[..., Record]


@pytest.fixture
def read(tmp_path: Path) -> Read:
    def read(text: str | bytes, name: str = "run.csv", **options: object) -> Record:
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_record(path, **options)  # type: ignore[arg-type]

    return read


def refused(read: Read, text: str | bytes, **options: object) -> str:
    with pytest.raises(RecordError) as error:
        read(text, **options)
    message = str(error.value)
    assert "run.csv" in message
    assert "\n" not in message
    return message


@pytest.mark.parametrize("mark", [";", "\t"])
def test_decimal_commas_anywhere(read: Read, mark: str) -> None:
    rows = (("t", "voltage", "note"), ("0", "0", "a, b"), ("0,01", "1,5", "1.2.3"), ("0,02", '"-2,5e-1"', "c"))
    record = read("\n".join(mark.join(row) for row in rows))
    np.testing.assert_array_equal(record.t, [0, 0.01, 0.02])
    np.testing.assert_array_equal(record.signals["voltage"].values, [0, 1.5, -0.25])
    assert "decimal commas read as points" in record.notes


def test_commas_beside_decimal_points_are_refused(read: Read) -> None:
    message = refused(read, "t;voltage\n0;1\n0.01;1,234\n")
    assert "row 2 (line 3), column 'voltage': '1,234' is not a number; other numbers have a decimal point" in message


@pytest.mark.parametrize("cell", ["1.2", "", "a, b"])
def test_points_in_another_column_do_not_hide_decimal_commas(read: Read, cell: str) -> None:
    record = read(f"t;voltage;version\n0,00;1,5;{cell}\n0,01;2,5;1.2\n", wanted=["voltage"])
    np.testing.assert_array_equal(record.t, [0, 0.01])
    np.testing.assert_array_equal(record.signals["voltage"].values, [1.5, 2.5])
    assert "decimal commas read as points" in record.notes


def test_a_cell_with_comma_and_point_is_named_as_it_stands(read: Read) -> None:
    message = refused(read, "t;voltage\n0;2,5\n1;12.34,5\n")
    assert "row 2 (line 3), column 'voltage': '12.34,5' is not a number; other numbers have a decimal comma" in message


@pytest.mark.parametrize("grouped", ["-1.234,5", "-1'234,5", "-1 234,5", "-1\u00a0234,5", "-1\u202f234,5"])
def test_digits_in_groups_of_three_are_one_number(read: Read, grouped: str) -> None:
    found = read(f"t;voltage\n0;2,5\n1;{grouped}\n2;-0,5\n").signals["voltage"].values
    np.testing.assert_array_equal(found, [2.5, -1234.5, -0.5])


def test_commas_and_points_in_one_column_are_refused(read: Read) -> None:
    message = refused(read, "t;voltage\n0,0;1.5\n0,1;2,5\n")
    assert "row 2 (line 3), column 'voltage': '2,5' is not a number; other numbers have a decimal point" in message


PLAIN = "t,voltage,speed\n0,1,2\n0.1,3,4\n0.2,5,6\n"


def test_plain(read: Read) -> None:
    record = read(PLAIN)
    assert list(record.signals) == ["voltage", "speed"]
    np.testing.assert_array_equal(record.t, [0, 0.1, 0.2])
    np.testing.assert_array_equal(record.signals["speed"].values, [2, 4, 6])
    assert record.notes == ()
    assert len(record) == 3


def test_arrays_are_read_only(read: Read) -> None:
    record = read(PLAIN)
    for array in (record.t, record.signals["voltage"].values):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff" + PLAIN,
        PLAIN.replace("\n", "\r\n"),
        PLAIN.replace("\n", "\r"),
        PLAIN.replace(",", "\t"),
        PLAIN.replace(",", ";"),
        PLAIN.replace(",", " , "),
        PLAIN.rstrip("\n"),
        PLAIN + "\n\n  \n",
        "# a comment\n\n" + PLAIN + "# the end\n",
        PLAIN.replace("0.1,3,4\n", "# mid\n\n0.1,3,4 # spike?\n"),
        '"t","voltage","speed"\n"0","1","2"\n"0.1","3","4"\n0.2,5,6\n',
        "t;voltage;speed\n0,0;1,0;2,0\n0,1;3,0;4,0\n0,2;5,0;6,0\n",
        "# t,voltage,speed\n0,1,2\n0.1,3,4\n0.2,5,6\n",
        "t,voltage,speed,\n0,1,2,\n0.1,3,4,\n0.2,5,6,\n",
        "t,voltage,speed\n0,1,2\n0.1,3,4\n0.2,5,6\n,,\n",
        PLAIN.encode("utf-16"),
    ],
)
def test_dialects(read: Read, text: str | bytes) -> None:
    record = read(text)
    np.testing.assert_array_equal(record.t, [0, 0.1, 0.2])
    assert list(record.signals) == ["voltage", "speed"]
    np.testing.assert_array_equal(record.signals["voltage"].values, [1, 3, 5])


def test_units_and_notes_in_the_header(read: Read) -> None:
    record = read("t [ms],force [N] (=gtau*u),torque_enable [0/1],x [mm]\n0,1,0,1000\n5,2,1,2000\n10,3,1,3000\n")
    np.testing.assert_array_equal(record.t, [0, 0.005, 0.01])
    assert {name: signal.unit for name, signal in record.signals.items()} == {
        "force": "N",
        "torque_enable": "0/1",
        "x": "mm",
    }
    assert (
        record.find("force")
        == record.find("force [N] (=gtau*u)")
        == record.find("force[N](=gtau*u)")
        == record.find("force [N]")
        == "force"
    )


def test_latin_1(read: Read) -> None:
    assert read("t,torque [N·m]\n0,1\n1,2\n".encode("latin-1")).signals["torque"].unit == "N·m"


def test_one_name_in_two_units_keeps_the_whole_heads(read: Read) -> None:
    record = read("t,q [rad],q [deg]\n0,1,57\n1,2,114\n")
    assert list(record.signals) == ["q [rad]", "q [deg]"]
    with pytest.raises(RecordError, match=r"ambiguous: 'q \[rad\]', 'q \[deg\]'"):
        record.find("q")


def test_missing_samples_are_nan(read: Read) -> None:
    record = read("t,a,b,c\n0,,1,2\n1,nan,2,\n2,3,,\n3,1,NA, \n")
    np.testing.assert_array_equal(record.signals["a"].values, [np.nan, np.nan, 3, 1])
    np.testing.assert_array_equal(record.signals["b"].values, [1, 2, np.nan, np.nan])
    np.testing.assert_array_equal(record.signals["c"].values, [2, np.nan, np.nan, np.nan])


def test_mapping(read: Read) -> None:
    record = read("t,u_motor [V],q\n0,1,2\n1,3,4\n", signals={"voltage": "u_motor", "position": "q"})
    assert list(record.signals) == ["voltage", "position"]
    assert record.signals["voltage"].label == "u_motor [V]"
    assert record.find("u_motor [V]") == record.find("u_motor") == "voltage"


def test_mapping_of_the_time(read: Read) -> None:
    record = read("clock [us],a\n0,1\n5000,2\n", signals={"t": "clock"})
    np.testing.assert_array_equal(record.t, [0, 0.005])


def test_a_second_time_column_may_hold_text(read: Read) -> None:
    record = read("timestamp,t,a\n2024-01-01T00:00:00,0,1\n2024-01-01T00:00:01,1,2\n")
    assert list(record.signals) == ["a"]
    record = read("timestamp,a\n2024-01-01T00:00:00,1\n2024-01-01T00:00:00.5,2\n")
    np.testing.assert_array_equal(record.t, [0.0, 0.5])
    assert record.notes[0].kind == "clock"


def test_mapping_wins_over_a_column_of_that_name(read: Read) -> None:
    record = read("t,voltage,u\n0,1,2\n1,3,4\n", signals={"voltage": "u"})
    np.testing.assert_array_equal(record.signals["voltage"].values, [2, 4])
    assert any("'voltage' is left out" in note for note in record.notes)


def test_mapping_may_swap(read: Read) -> None:
    record = read("t,a,b\n0,1,2\n1,3,4\n", signals={"a": "b", "b": "a"})
    np.testing.assert_array_equal(record.signals["a"].values, [2, 4])
    np.testing.assert_array_equal(record.signals["b"].values, [1, 3])


def test_mapping_to_nothing(read: Read) -> None:
    message = refused(read, "t,u_motor [V]\n0,1\n1,3\n", signals={"voltage": "u_moter"})
    assert "'u_moter'" in message
    assert "'u_motor [V]'" in message


def test_text_columns_are_left_out(read: Read) -> None:
    record = read("t,mode,a\n0,idle,1\n1,run,2\n")
    assert list(record.signals) == ["a"]
    assert record.notes == ("column 'mode' holds text and is left out",)


def test_only_the_wanted_columns_must_be_numbers(read: Read) -> None:
    text = "t,a,b,c\n0,1,2,3\n1,x,4,inf\n"
    assert "'a': 'x'" in refused(read, text)
    record = read(text, wanted=["b"])
    assert list(record.signals) == ["b"]
    assert len(record.notes) == 2
    assert "'a': 'x'" in refused(read, text, wanted=["a"])


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ["empty"]),
        ("\n \n", ["empty"]),
        ("# only\n# comments\n", ["comments"]),
        ("t,voltage\n", ["no rows"]),
        ("t,voltage\n,\n", ["no rows"]),
        ("t,voltage\n0,1\n", ["only 1 row"]),
        ("t,voltage\n0,1\n0,1\n", ["only 1 row"]),
        ("3,1\n3,2\n2,4\n", ["no header", "'c1', 'c2'", "--dt"]),
        ("voltage,speed\n0,1\n1,2\n", ["no time column", "'voltage', 'speed'"]),
        ("voltage\n0\n1\n", ["no time column", "--dt"]),
        ("t,a\n0,1\n1,abc\n2,3\n", ["row 2 (line 3)", "'a'", "'abc'"]),
        ("t,a\n0,1\n# x\n\n1,1_0\n", ["row 2 (line 5)", "'1_0'"]),
        ("t,a\n0,1\n1,2,3\n", ["row 2 (line 3)", "3 cells", "2 columns"]),
        ("t,a,b\n0,1,2\n1,2\n", ["row 2 (line 3)", "2 cells", "3 columns"]),
        ("t,a\n0,1\nnan,2\n2,3\n", ["row 2 (line 3)", "time stamp"]),
        ("t,a\n0,1\n,2\n2,3\n", ["row 2 (line 3)", "time stamp"]),
        ("t,a\n0,1\ninf,2\n2,3\n", ["row 2 (line 3)", "time stamp"]),
        ("t,a\n9,1\n7,2\n5,3\n3,4\n1,5\n0,6\n", ["row 2 (line 3)", "comes after 9", "no order"]),
        (
            "t,a\n0,1\n1,2\n1,3\n",
            ["row 2 (line 3) and row 3 (line 4)", "same time stamp", "'a' is 2.0 and 3.0"],
        ),
        ("t,a\n0,1\n1,inf\n", ["row 2 (line 3)", "'a'", "inf"]),
        ("t,a\n0,1\n1,-inf\n", ["row 2 (line 3)", "'a'", "-inf"]),
        ("t,,a\n0,1,2\n1,2,3\n", ["column 2", "no name"]),
        ("t [V],a\n0,1\n1,2\n", ["'t [V]'", "'V'", "ms"]),
        ("stamp,a\n700000000000000000,1\n700000000005000000,2\n", ["'stamp'", "unit", "[ns]"]),
        (b"\x00\x01\x02", ["no text file"]),
        (",\n", ["nothing but separators"]),
    ],
)
def test_faults(read: Read, text: str | bytes, parts: list[str]) -> None:
    message = refused(read, text)
    for part in parts:
        assert part in message


def test_repeated_rows_are_dropped_with_a_note(read: Read) -> None:
    record = read("t,a,b\n0,1,\n1,2,3\n1,2,3\n2,,4\n2,,4\n2,,4\n3,5,6\n")
    np.testing.assert_array_equal(record.t, [0, 1, 2, 3])
    assert record.notes == ("3 repeated rows dropped (same stamp, same values), the first row 3 (line 4)",)


def test_a_row_that_came_late_is_sorted_in(read: Read) -> None:
    record = read("t,a\n0,1\n2,3\n1,2\n3,4\n")
    np.testing.assert_array_equal(record.signals["a"].values, [1, 2, 3, 4])
    assert record.where(1) == "row 3 (line 4)"
    assert record.notes[0].kind == "sorted"


def test_a_gap_is_noted_with_its_place(read: Read) -> None:
    rows = [i for i in range(50) if i not in (20, 21)]
    record = read("t,a\n" + "".join(f"{i / 10},{i}\n" for i in rows))
    (note,) = record.notes
    assert note.startswith("1 gap in the time stamps (steps over 1.5 times the median of 0.1 s)")
    assert note.endswith("the first after row 20 (line 21), the longest, 0.3 s, after t = 1.9 s")
    record = read("timestamp,a\n" + "".join(f"{1406221416.5 + i / 10:.1f},{i}\n" for i in rows))
    assert record.notes[0].endswith("0.3 s, after t = 1406221418.400 s")


def test_the_time_may_be_a_formula_of_columns_by_number(read: Read) -> None:
    record = read("sec,ms,a\n0,0,1\n0,100,2\n1,0,3\n", signals={"t": "#1 + 0.001 * #2"})
    np.testing.assert_allclose(record.t, [0.0, 0.1, 1.0])


def test_what_follows_a_long_gap_is_said_to_start_anew(read: Read) -> None:
    rows = [*range(30), *range(60, 90), *range(2000, 2030)]
    (note,) = read("t,a\n" + "".join(f"{i / 10},{i}\n" for i in rows)).notes
    assert note.kind == "gap"
    assert note.endswith("; what follows 2 of them, over 5 times it, starts anew")


def test_uneven_sampling_is_noted(read: Read) -> None:
    t = np.cumsum(np.random.default_rng(1).uniform(0.09, 0.11, 50))
    record = read("t,a\n" + "".join(f"{x!r},0\n" for x in t.tolist()))
    assert len(record.notes) == 1
    assert record.notes[0].startswith("unevenly sampled: steps of 0.09")


def test_missing_file_and_other_kinds(read: Read, tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text(PLAIN)
    with pytest.raises(RecordError, match=r"no such file.*'run\.csv'"):
        read_record(tmp_path / "rum.csv")
    (tmp_path / "run.rtf").write_bytes(b"PK")
    with pytest.raises(RecordError, match=r"\.csv.*\.mcap"):
        read_record(tmp_path / "run.rtf")
    assert len(read_record(str(tmp_path / "run.csv"))) == 3


def test_a_large_file_takes_about_a_second(read: Read) -> None:
    """No loop over the samples in Python: 100,000 rows in far less than the seconds such a loop needs under
    any load.
    """
    import time

    table = np.random.default_rng(0).normal(size=(100_000, 4))
    table[:, 0] = np.arange(100_000) * 1e-3
    text = "t,a,b,c\n" + "\n".join(",".join(map(repr, row)) for row in table.tolist())
    start = time.process_time()
    record = read(text)
    assert time.process_time() - start < 2.0
    np.testing.assert_array_equal(record.signals["c"].values, table[:, 3])


def large(header: str, rows: int, line: Callable[[int], str], end: str = "\n") -> str:
    return header + "".join(f"{line(k)}\n" for k in range(rows)).rstrip("\n") + end


LARGE = {
    "plain": large("t,a [m],b\n", 3000, lambda k: f"{0.01 * k:.17g},{float(np.sin(k))!r},{k % 7}"),
    "empty cells": large("t,a,b\n", 3000, lambda k: f"{0.01 * k:g},{'' if k % 3 else k},{k}"),
    "empty column": large("t,a,\n", 3000, lambda k: f"{0.01 * k:g},{k},"),
    "nan": large("t;a\n", 3000, lambda k: f"{0.01 * k:g};{'nan' if k == 1500 else -1e-3 * k}"),
    "no header": large("", 3000, lambda k: f"{0.01 * k:g}\t{k * k}"),
    "units": large("log of a rig\n\nt,speed\ns,rad/s\n", 3000, lambda k: f"{0.01 * k:g},{k}"),
    "header in a comment": large("# t a b\n", 3000, lambda k: f"{0.01 * k:.18e} {k:.18e} {-k:.18e}"),
    "carriage returns": large("t,a\r\n", 3000, lambda k: f"{0.01 * k:g},{k}\r"),
    "no end": large("t,a\n", 3000, lambda k: f"{0.01 * k:g},{k}", ""),
    "ends on blanks": large("t,a\n", 3000, lambda k: f"{0.01 * k:g},{k}", "\n\n \n"),
    "cut off": large("t,a\n", 3000, lambda k: f"{0.01 * k:g},{k}", "\n30."),
    "comment": large("t,a\n", 3000, lambda k: "# here" if k == 1500 else f"{0.01 * k:g},{k}"),
    "comment behind": large("t,a\n", 3000, lambda k: f"{0.01 * k:g},{k}" + " # here" * (k == 1500)),
    "blank line": large("t,a\n", 3000, lambda k: "" if k == 1500 else f"{0.01 * k:g},{k}"),
    "separators only": large("t,a\n", 3000, lambda k: "," if k == 1500 else f"{0.01 * k:g},{k}"),
    "header again": large("t,a\n", 3000, lambda k: "t,a" if k == 1500 else f"{0.01 * (k % 1500):g},{k}"),
    "decimal commas": large("t;a\n", 3000, lambda k: f"{k};0,{k:04d}"),
    "stamps in ns": large("t_ns,a\n", 3000, lambda k: f"{1_700_000_000_000_000_001 + 10_000_000 * k},{k}"),
    "torn": large("t,a\n", 3000, lambda k: f"{0.01 * k:g},{'1.2.3' if k == 1500 else k}"),
    "ragged": large("t,a\n", 3000, lambda k: f"{0.01 * k:g},{k}" + ",1" * (k == 1500)),
    "words": large("t,a\n", 3000, lambda k: f"{0.01 * k:g},{'inf' if k == 1500 else k}"),
    "signs": large("t,a\n", 3000, lambda k: f"{0.01 * k:g},{-k:+d}"),
}


@pytest.mark.parametrize("name", LARGE)
@pytest.mark.parametrize("pyarrow", [True, False])
def test_large_tables_are_read_as_small_ones_are(
    name: str, pyarrow: bool, read: Read, monkeypatch: pytest.MonkeyPatch
) -> None:
    def outcome() -> tuple[object, ...]:
        try:
            record = read(LARGE[name])
        except RecordError as error:
            return (str(error),)
        values = {n: (s.values.tobytes(), s.unit, s.label, s.number) for n, s in record.signals.items()}
        lines = None if record.rows is None or record.rows.line is None else record.rows.line.tolist()
        return record.t.tobytes(), values, lines, tuple(map(str, record.notes))

    slow = outcome()
    monkeypatch.setattr(regular, "MIN_REGULAR_LENGTH", 0)
    if pyarrow:
        pytest.importorskip("pyarrow")
    else:
        monkeypatch.setattr(regular, "find_spec", lambda _: None)
    assert outcome() == slow


@pytest.mark.parametrize("name", ["plain", "empty cells", "nan", "no header", "units", "header in a comment", "no end"])
def test_large_plain_tables_take_the_quick_way(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(regular, "MIN_REGULAR_LENGTH", 0)
    found = regular.regular(LARGE[name], "run.csv")
    assert (found is not None) == (name != "empty cells" or find_spec("pyarrow") is not None)
