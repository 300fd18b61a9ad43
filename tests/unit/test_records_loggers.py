"""What loggers write that is no plain table is read as one."""

import json
from pathlib import Path

import numpy as np
import pytest

from signlin_ros.errors import RecordError
from signlin_ros.model import Model
from signlin_ros.records import read_for_model, read_record, read_records

ROWS = [(0.005 * k, 0.1 * k, 2.0 - 0.01 * k) for k in range(40)]
"""Time in s, and two signals."""
LVM = "LabVIEW Measurement\nSeparator\tTab\nX_Columns\tNo\n***End_of_Header***\nChannels\t2\n"
LVM += "Delta_X\t0.005\t0.005\nX0\t0\t0\n"
SCOPE = "Name\tP\nFile\tp\nStarttime of export\t1\n\nName\ta\tName\tb\nSampleTime[ms]\t5\tSampleTime[ms]\t5\n\n"
OCTAVE = (
    "# Created by Octave 8.4.0, Mon Jul 01 10:05:00 2024 UTC <u@rig>\n# name: note\n# type: string\n# length: 1\nx\n\n"
)
OCTAVE += "# name: t\n# type: range\n# base, limit, increment\n0 0.195 0.005\n\n" + "".join(
    f"# name: {name}\n# type: matrix\n# rows: 40\n# columns: 1\n" + "".join(f" {row[k]}\n" for row in ROWS) + "\n\n"
    for k, name in ((1, "a"), (2, "b"))
)
LOGGERS = {
    "no_times.lvm": LVM
    + "***End_of_Header***\nX_Value\ta\tb\tComment\n"
    + "\n".join(f"\t{a}\t{b}" for _, a, b in ROWS),
    "scope.csv": SCOPE + "\n".join(f"{1e3 * t}\t{a}\t{1e3 * t}\t{b}" for t, a, b in ROWS),
    "ticks.csv": SCOPE + "\n".join(f"{1e7 * t:.0f}\t{a}\t{1e7 * t:.0f}\t{b}" for t, a, b in ROWS),
    "trace.trace": "[key]; [value]\n0.Variable; a\n0.Data;\n"
    + "\n".join(f"; {1e3 * t}; {a}" for t, a, _ in ROWS)
    + "\n1.Variable; b\n1.Data;\n"
    + "\n".join(f"; {1e3 * t}; {b}" for t, _, b in ROWS),
    "rigol.csv": "X,a,b,Start,Increment,\nSequence,Volt,Volt,0,5e-3\n"
    + "\n".join(f"{k},{a},{b},,," for k, (_, a, b) in enumerate(ROWS)),
    "rigol_new.csv": "a(V),b(V),t0 = 0.0, tInc = 5e-3,\n" + "\n".join(f"{a},{b},,," for _, a, b in ROWS),
    "tds.csv": "\n".join(
        f"{key},,{t},{a},,{other},,{t},{b},"
        for (t, a, b), key, other in zip(
            ROWS,
            ["Record Length,40", "Source,a", *[","] * 38],
            ["Record Length,40", "Source,b", *[","] * 38],
            strict=True,
        )
    ),
    "siglent.csv": "Record Length,40\nSource,a,b\nSecond,Volt,Volt\n" + "\n".join(f"{t},{a},{b}" for t, a, b in ROWS),
    "in_units.csv": "in s,a in V,b in V\n" + "\n".join(f"{t},{a},{b}" for t, a, b in ROWS),
    "labels.txt": "ready\n" + "\n".join(f"t:{1e3 * t}ms, a: {a}, b: {b}" for t, a, b in ROWS),
    "lines.jsonl": "\n".join(f'{{"t": {t}, "a": {a}, "b": {b}, "s": "x"}}' for t, a, b in ROWS),
    "cells.csv": "Time,a,b\n" + "\n".join(f"{1e3 * t} ms,{a} V,{b} V" for t, a, b in ROWS),
    "boot.txt": "ets Jul 29 2019 12:21\nrst:0x1 (POWERON_RESET),boot:0x13\n"
    + "\n".join(
        f"t={1e3 * t}ms a={a if k % 3 else 1e3 * a}{'V' if k % 3 else 'mV'} b={b}" for k, (t, a, b) in enumerate(ROWS)
    )
    + "\nt=200.0ms a=5",
    "keys.csv": "Model,M\nSample Interval,0.005,\nProbe Attenuation,10,1\nVertical Units,V,V\nLabel,,\n\nTIME,a,b\n"
    + "\n".join(f"{t},{a},{b}" for t, a, b in ROWS),
    "echo.txt": "---\n".join(
        f"header:\n  stamp:\n    sec: 1719000000\n    nanosec: {5_000_000 * k}\n  frame_id: ''\n"
        f"a: {a}\nnames:\n- x\nvelocity: []\nload:\n  b: {b}\n"
        for k, (_, a, b) in enumerate(ROWS)
    ),
    "monitor.txt": "\n".join(f"10:05:{3 + t:06.3f} -> a:{a} b:{b}" for t, a, b in ROWS),
    "console.log": "[INFO] [1719000000.100000000] [driver]: started\n"
    + "\n".join(f"[INFO] [1719000001.{round(1e9 * t):09d}] [driver]: a={a} b={b}" for t, a, b in ROWS),
    "program.log": "\n".join(
        f"2024-07-01 10:05:{3 + t:06.3f} - INFO - a={a}, b={b}".replace(".", ",", 1) for t, a, b in ROWS
    ),
    "blanks.txt": "\n".join(f"Time: {t} s, the a: {a} V, Motor b: {b} rpm" for t, a, b in ROWS),
    "units.csv": "Zeit;a;b\n" + "\n".join(f"{t:.3f} s;{a:.9f} V;{b:.9f} A".replace(".", ",") for t, a, b in ROWS),
    "fortran.txt": "t a b\n" + "\n".join(f"{t:.9E} {a:.9E} {b:.9E}".replace("E", "D") for t, a, b in ROWS),
    "tuples.txt": "\n".join(map(str, ROWS)),
    "objects.log": "\n".join(f'10:05:{3 + t:06.3f} {{"a": {a}, "b": {b}}}' for t, a, b in ROWS),
    "plotter.txt": "10:05:02.900 -> a,b\n" + "\n".join(f"10:05:{3 + t:06.3f} -> {a},{b}" for t, a, b in ROWS),
    "columns.json": json.dumps({"rig": "x", "data": dict(zip(("t", "a", "b"), zip(*ROWS, strict=True), strict=True))}),
    "rows.json": json.dumps([{"t": t, "m": {"a": a}, "b": b, "ok": True, "s": "x"} for t, a, b in ROWS]),
    "foot.csv": "t;a;b\n" + "\n".join(f"{t};{a};{b}" for t, a, b in ROWS) + "\n\nMean;1;2\nLargest;3;4\n",
    "zone.csv": "Zeitstempel;a;b\n"
    + "\n".join(f"2024-07-01T10:05:{3 + t:06.3f}+02:00;{a:.9f};{b:.9f}".replace(".", ",") for t, a, b in ROWS),
    "days.csv": "Date,a,b\n" + "\n".join(f"{45413.4 + t / 86400:.13f},{a},{b}" for t, a, b in ROWS),
    "datenum.csv": "t,a,b\n"
    + "\n".join(f"{739000 + 5 * k / 86400e3:.16g},{a},{b}" for k, (_, a, b) in enumerate(ROWS)),
    "counter.csv": "tick_us,a,b\n"
    + "\n".join(f"{(64000 + 5000 * k) % 2**16},{a},{b}" for k, (_, a, b) in enumerate(ROWS)),
    "old.asc": "Time\ta\tb\ns\tV\tA\n" + "\n".join(f"{t}\t{a}\t{b}" for t, a, b in ROWS),
    "own_times.lvm": LVM.replace("\t0.005\t0.005", "\t0.005\t\t0.005").replace("X0\t0\t0", "X0\t0\t\t0")
    + "Samples\t40\t\t40\nY_Unit_Label\tVolts\t\tAmps\n***End_of_Header***\nX_Value\ta\tX_Value\tb\tComment\n"
    + "\n".join(f"{t}\t{a}\t{t}\t{b}\t" for t, a, b in ROWS),
    "two_comments.dat": "# rig 3\n#t a b\n#[ms] [mV] [A]\n" + "\n".join(f"{1e3 * t} {a} {b}" for t, a, b in ROWS),
    "levels.csv": ",a,b\n,V,A\ntime,,\n" + "\n".join(f"{t},{a},{b}" for t, a, b in ROWS),
    "octave.txt": OCTAVE,
    "octave.mat": OCTAVE,
    "echo.yaml": "---\n".join(
        f"header:\n  stamp:\n    sec: 1719000000\n    nanosec: {5_000_000 * k}\nname:\n- a\nload:\n  b: {b}\na: {a}\n"
        for k, (_, a, b) in enumerate(ROWS)
    ),
    "no_zeros.csv": "Time,a,b\n" + "\n".join(f"9:7:{3 + t:g},{a},{b}" for t, a, b in ROWS),
    "slashes.csv": "time,a,b\n" + "\n".join(f"2021/05/03/12:00:{3 + t:09.6f},{a},{b}" for t, a, b in ROWS),
    "of_the_pi.csv": "pi_time,a,b\n" + "\n".join(f"{7 + t},{a},{b}" for t, a, b in ROWS),
    "of_the_autopilot.csv": "TimeUS,a,b\n" + "\n".join(f"{5000 * k},{a},{b}" for k, (_, a, b) in enumerate(ROWS)),
    "step_once.csv": "a,b,Ts,\n" + "\n".join(f"{a},{b},{'' if t else 0.005}," for t, a, b in ROWS),
    "steps.csv": "a,b,dt [ms]\n" + "\n".join(f"{a},{b},{5.0 + 1e-10 * (k % 2)}" for k, (_, a, b) in enumerate(ROWS)),
    "coarse_first.csv": "stamp,a,b,millis\n"
    + "\n".join(f"{1719000000 + int(0.95 + t)},{a},{b},{5 * k}" for k, (t, a, b) in enumerate(ROWS)),
    "coarse_beside.csv": "time,a,b,pi_time\n" + "\n".join(f"{int(0.95 + t)},{a},{b},{3 + t}" for t, a, b in ROWS),
    "panel.csv": '"Date","Time","Millisecond","a","b"\n'
    + "\n".join(f'"2021/11/30","10:23:{45 + int(0.95 + t)}",{round(950 + 1e3 * t) % 1000},{a},{b}' for t, a, b in ROWS),
    "messages.csv": "ready\nt,a,b\n"
    + "\n".join(f"{t},{a},{b}" for t, a, b in ROWS[:20])
    + "\nWARN: overcurrent on M1\n0.09\n--- RESUMED, again ---\n"
    + "\n".join(f"{t},{a},{b}" for t, a, b in ROWS[20:]),
    "blanks_and_messages.txt": "t a b\n"
    + "\n".join(f"{t} {a} {b}" + "\nmotor is warm" * (k == 9) for k, (t, a, b) in enumerate(ROWS)),
    "cycles.txt": "".join(
        "Data Header:\tTime:\t15.2\tSec\t3/3/2020 2:14:05 PM\na\tb\tTime\nmm\tkN\tSec\n"
        + "".join(f"{a}\t{b}\t{t}\n" for t, a, b in part)
        for part in (ROWS[:20], ROWS[20:])
    ),
    "motion.sto": "Gait\nversion=1\nnColumns=3\nendheader\ntime\ta\tb\n"
    + "\n".join(f"{t:16.8f}\t{a:16.8f}\t{b:16.8f}" for t, a, b in ROWS),
    "a_line_each.txt": "Hello\n" + "\n".join(f"Time:  {1e3 * t} ms\nthe a: {a} V\nMotor b: {b}\n" for t, a, b in ROWS),
    "members.txt": "\n".join(
        f"{{'t': np.float64({t}), <Register.A: 1>: {a}, <Register.B: 2>: {b}, 'on': True}}" for t, a, b in ROWS
    ),
    "messages_of_joints.csv": "time,.name,.position,.effort\n"
    + "\n".join(
        f'{t},"{["a", "b"] if k % 2 else ["b", "a"]}","{(a, b) if k % 2 else (b, a)}",()'
        for k, (t, a, b) in enumerate(ROWS)
    ),
    "topics.csv": "receive time,sequence,topic,value\n"
    + "\n".join(f"{7 + t},{k},a,{a}\n{7 + t},{k},b,{b}" for k, (t, a, b) in enumerate(ROWS)),
    "minus.csv": "t,a,b\n" + "\n".join(f"{t},{a},{1e3 * b}e\u22123" for t, a, b in ROWS),
    "names_over_lines.csv": '"Time\n(ms)","a\n(V)","b"\n' + "\n".join(f"{1e3 * t},{a},{b}" for t, a, b in ROWS),
    "glued.csv": "t,a,b\n" + "\n".join(f"{1e3 * t}ms,{a}V,{b}A" for t, a, b in ROWS),
    "no_marks.csv": "stamp,a,b\n" + "\n".join(f"20231130T1023{45 + t:09.6f}Z,{a},{b}" for t, a, b in ROWS),
    "months.csv": "Time,a,b\n" + "\n".join(f"30-Nov-2023 10:23:{45 + t:09.6f},{a},{b}" for t, a, b in ROWS),
    "names_of_days.csv": "Time,a,b\n" + "\n".join(f"Thu Nov 30 10:23:{45 + t:09.6f} 2023,{a},{b}" for t, a, b in ROWS),
    "camel_case.csv": "timeMs,a,b\n" + "\n".join(f"{1e3 * t},{a},{b}" for t, a, b in ROWS),
    "own_times.csv": "Time,a,Time,b\n" + "\n".join(f"{t},{a},{t + 1e-5},{b}" for t, a, b in ROWS),
    "a_row_each.csv": "t,a,b\n" + "\n".join(f"{t},{a},\n{t},,{b}" for t, a, b in ROWS),
    "of_the_pi.json": json.dumps(dict(zip(("pi_time", "a", "b"), zip(*ROWS, strict=True), strict=True))),
    "rows_alone.json": json.dumps({"test": "x", "fast": ROWS}),
    "header_last.csv": "\n".join(f"{t},{a},{b}" for t, a, b in ROWS) + "\nt,a,b\n",
    "twice.csv": "t,a,b\n" + "\n".join(f"{t},{a},{b}\n{t},{a},{b}" for t, a, b in ROWS),
    "cut.csv": "t,a,b\n" + "\n".join(f"{t},{a},{b}" for t, a, b in ROWS) + "\n0.2,3\n",
}


NAMES = {
    "echo.txt": ("a", "load.b"),
    "echo.yaml": ("a", "load.b"),
    "blanks.txt": ("the a", "Motor b"),
    "tuples.txt": ("c2", "c3"),
    "rows_alone.json": ("c2", "c3"),
    "header_last.csv": ("c2", "c3"),
    "a_line_each.txt": ("the a", "Motor b"),
    "members.txt": ("A", "B"),
    "messages_of_joints.csv": (".position[a]", ".position[b]"),
    "topics.csv": ("a.value", "b.value"),
}
"""What the signals are called, where not ``a`` and ``b``."""
DAYS = {"days.csv": 1e-6, "datenum.csv": 2e-5}
"""How well a time is known in s that is written in days."""


@pytest.mark.parametrize("name", LOGGERS)
def test_loggers_that_write_no_plain_table(name: str, tmp_path: Path) -> None:
    file = tmp_path / name
    file.write_text(LOGGERS[name])
    record = read_record(file, {"t": "tick_us"} if name == "counter.csv" else None)
    assert len(record) == 40
    np.testing.assert_allclose(np.diff(record.t), 0.005, atol=DAYS.get(name, 1e-9))
    for column, signal in zip(np.array(ROWS).T[1:], NAMES.get(name, ("a", "b")), strict=True):
        np.testing.assert_allclose(record.signals[record.require(signal)].values, column, atol=1e-9)


@pytest.mark.parametrize(
    "text",
    [
        "(1719000000.000000) can0 141#FF0B000100000000\n" * 3,
        " (1719000000.000000)  can0  141   [8]  FF 0B 00 01 00 00 00 00\n" * 3,
        "date Mon Jul 1 10:00:00 2024\nbase hex  timestamps absolute\n 0.1 1 141 Rx d 8 FF 0B\n",
    ],
)
def test_raw_frames_are_called_so(text: str, tmp_path: Path) -> None:
    (tmp_path / "run.log").write_text(text)
    with pytest.raises(RecordError, match="frames of a CAN bus, not decoded"):
        read_record(tmp_path / "run.log")


@pytest.mark.parametrize("sent", [2, 3])
def test_a_clock_that_is_coarser_than_the_rows(sent: int, tmp_path: Path) -> None:
    stamps = [0.01 * sent * (k // sent) for k in range(120)]
    (tmp_path / "run.csv").write_text("t,a\n" + "\n".join(f"{t:.2f},{k}" for k, t in enumerate(stamps)))
    record = read_record(tmp_path / "run.csv")
    np.testing.assert_allclose(np.diff(record.t), 0.01, rtol=0.02)
    assert any("share a stamp" in note for note in record.notes)
    jumping = [t + (0.3 if k > 60 else 0.0) for k, t in enumerate(stamps)]
    (tmp_path / "run.csv").write_text("t,a\n" + "\n".join(f"{t:.2f},{k}" for k, t in enumerate(jumping)))
    with pytest.raises(RecordError, match=r"same time stamp but differ.*--dt"):
        read_record(tmp_path / "run.csv")


@pytest.mark.parametrize("cell", ["∞", "-∞", "#DIV/0!", "#NV", "OL", "overflow"])
def test_cells_that_stand_for_no_value(cell: str, tmp_path: Path) -> None:
    rows = [f"{t},{cell if k == 7 else a},{b}" for k, (t, a, b) in enumerate(ROWS)]
    (tmp_path / "run.csv").write_text("t,a,b\n" + "\n".join(rows), encoding="utf-8")
    values = read_record(tmp_path / "run.csv").signals["a"].values
    assert np.flatnonzero(np.isnan(values)).tolist() == [7]


def test_a_workbook_is_to_be_saved_as_text(tmp_path: Path) -> None:
    (tmp_path / "run.xlsx").write_bytes(b"PK")
    with pytest.raises(RecordError, match=r"run.xlsx: a workbook; save the sheet with the record as CSV"):
        read_record(tmp_path / "run.xlsx")


def test_a_time_of_day_is_the_time_whatever_it_is_called(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text("at,a,b\n" + "\n".join(f"10:05:{3 + t:06.3f},{a},x" for t, a, _ in ROWS))
    record = read_record(tmp_path / "run.csv", wanted=["a"])
    assert np.diff(record.t) == pytest.approx(0.005)
    assert any("'at' holds times of day" in note for note in record.notes)
    assert np.diff(read_record(tmp_path / "run.csv", {"t": "at"}).t) == pytest.approx(0.005)


def test_damaged_stamps_are_no_fault(tmp_path: Path) -> None:
    """A message whose stamp cannot be read is left out; a day that is none counts as the day's time."""
    text = LOGGERS["echo.txt"].replace("nanosec: 35000000\n", "nanosec: 35e00[0\n")
    (tmp_path / "run.txt").write_text(text.replace("nanosec: 40000000\n", "nanosec: 4_0x\n"))
    assert len(read_record(tmp_path / "run.txt")) == 38
    (tmp_path / "run.log").write_text(LOGGERS["program.log"].replace("2024-07-01", "2024-37-01"))
    assert len(read_record(tmp_path / "run.log")) == 40


PARTS = {
    "nested.jsonl": ("\n".join(f'{{"t": {t}, "m": {{"a": {a}, "q": [0, {b}]}}}}' for t, a, b in ROWS), "m.a", "m.q[1]"),
    "lists.csv": ("t,m,s\n" + "\n".join(f'{t},"[{a}, {b}]",x' for t, a, b in ROWS) + '\n0.2,"[1.0"', "m[0]", "m[1]"),
    "blanks.csv": ("t,m\n" + "\n".join(f'{t},"[{a} {b}]"' for t, a, b in ROWS), "m[0]", "m[1]"),
    "groups.csv": ("t,a,b\n" + "\n".join(f'"{t}","{1e4 * a:,.3f}","{b:.3f}"' for t, a, b in ROWS), "1e-4 * a", "b"),
}
"""What holds parts, or numbers in groups of three; and where the signals stand in it."""


@pytest.mark.parametrize("name", PARTS)
def test_values_in_parts(name: str, tmp_path: Path) -> None:
    file = tmp_path / name
    text, *columns = PARTS[name]
    file.write_text(text)
    record = read_record(file)
    assert len(record) == 40
    for column, want in zip(columns, np.array(ROWS).T[1:], strict=True):
        factor, _, key = column.rpartition(" * ")
        got = float(factor or 1.0) * record.signals[record.require(key)].values
        np.testing.assert_allclose(got, want, atol=1e-9)


def test_a_number_in_groups_without_a_decimal_sign_stays_a_question(tmp_path: Path) -> None:
    file = tmp_path / "whole.csv"
    file.write_text("t,a\n" + "\n".join(f'{t},"{k},000"' for k, (t, _, _) in enumerate(ROWS, 1)))
    with pytest.raises(RecordError, match="not a number"):
        read_record(file)


@pytest.mark.parametrize("code", ["9.91E+37", "-3.40282347e+38", "1.7976931348623157e308"])
def test_numbers_that_stand_for_none_are_missing_samples(code: str, tmp_path: Path) -> None:
    rows = [f"{t},{a},{code if k == 7 else b}" for k, (t, a, b) in enumerate(ROWS)]
    file = tmp_path / "codes.csv"
    file.write_text("t,force,velocity [mm/s]\n" + "\n".join(rows))
    data = read_for_model(
        file, Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 1.0, "k": 1.0}})
    )
    assert np.flatnonzero(np.isnan(data.measured["velocity"])).tolist() == [7]
    assert [note for note in data.notes if "stands for none: missing samples" in note]


def test_a_line_beyond_any_limit_is_refused_with_its_place(tmp_path: Path) -> None:
    file = tmp_path / "long.csv"
    rows = [f"{t},{a},{b}" for t, a, b in ROWS]
    file.write_text("\n".join(["t,a,b", *rows[:20], "1" * 140_000, *rows[20:]]) + "\n")
    with pytest.raises(RecordError, match=r"row 21 \(line 22\) has 1 cells, the header 3 columns"):
        read_record(file)


def test_an_index_of_elapsed_times_without_a_name_is_the_time(tmp_path: Path) -> None:
    """pandas writes a table whose index is a TimedeltaIndex so."""
    rows = [f"0 days 00:00:{0.05 * k:09.6f},{k},{k % 5}" for k in range(30)]
    file = tmp_path / "run.csv"
    file.write_text("\n".join([",voltage,speed", *rows]) + "\n", encoding="utf-8")
    found = read_record(file)
    np.testing.assert_allclose(found.t, 0.05 * np.arange(30), atol=1e-9)
    assert set(found.signals) == {"voltage", "speed"}


def test_a_clock_with_a_semicolon_before_its_milliseconds(tmp_path: Path) -> None:
    """Trends of programmable controllers: a date, and 09:26:53;005."""
    rows = [f'"Data","3/14/2025","09:26:53;{5 * k:03d}",{k},{k % 5}' for k in range(30)]
    file = tmp_path / "run.csv"
    file.write_text("\n".join(['"Header:","Date","Time","voltage","speed"', *rows]) + "\n", encoding="utf-8")
    np.testing.assert_allclose(read_record(file).t, 0.005 * np.arange(30), atol=1e-9)


def test_one_field_after_the_other_of_a_data_base(tmp_path: Path) -> None:
    """The annotated CSV of a time-series database: all rows of one field, then all of the next, of the same stamps."""
    stamps = [f"2025-03-14T09:26:{0.05 * k:09.6f}Z" for k in range(30)]
    body = [f",,{f},{s},{f + 0.1 * k},{n}" for f, n in enumerate(("voltage", "speed")) for k, s in enumerate(stamps)]
    head = ["#datatype,string,long,dateTime:RFC3339,double,string", ",result,table,_time,_value,_field"]
    file = tmp_path / "run.csv"
    file.write_text("\n".join([*head, *body]) + "\n", encoding="utf-8")
    found = read_record(file)
    np.testing.assert_allclose(found.t, 0.05 * np.arange(30), atol=1e-9)
    for f, name in enumerate(("voltage", "speed")):
        np.testing.assert_allclose(found.signals[f"{name}._value"].values, f + 0.1 * np.arange(30), atol=1e-12)
    cut = tmp_path / "cut.csv"  # of another length: each with its own stamps
    cut.write_text("\n".join([*head, *body[:-3]]) + "\n", encoding="utf-8")
    for f, (name, count) in enumerate((("voltage", 30), ("speed", 27))):
        values = read_record(cut).signals[f"{name}._value"].values
        np.testing.assert_allclose(values[:count], f + 0.1 * np.arange(count), atol=1e-12)
        assert np.isnan(values[count:]).all()


def test_two_columns_of_one_name_that_differ_are_a_question(tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    rows = [f"{0.01 * k:g},{k % 7},{k % 5},{2 * (k % 5)}" for k in range(40)]
    file.write_text("\n".join(["t,voltage,speed,speed", *rows]) + "\n", encoding="utf-8")
    model = Model.load("dc_motor")
    with pytest.raises(RecordError, match=r"'speed' is ambiguous: 'speed \(column 3\)', 'speed \(column 4\)'"):
        read_for_model(file, model)
    for spec in ("#4", "speed (column 4)"):
        taken = read_for_model(file, model, {"speed": spec}).measured["speed"]
        np.testing.assert_array_equal(taken, 2.0 * (np.arange(40) % 5))


def test_a_pointer_of_a_store_of_large_files_is_called_so(tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    file.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:4d7a2146\nsize 12345\n", encoding="utf-8")
    with pytest.raises(RecordError, match="git lfs pull"):
        read_record(file)


@pytest.mark.parametrize(
    ("head", "row"),
    [
        pytest.param("Timestamp,voltage,speed", "{ticks},{u},{w}", id="file times of Windows, in 100 ns since 1601"),
        pytest.param("Timestamp,voltage,speed", "{net},{u},{w}", id="ticks of .NET, in 100 ns since the year 1"),
        pytest.param('"",time,voltage,speed', '"{number}",{t:g},{u},{w}', id="names of rows, from 1, as R writes them"),
        pytest.param("t,voltage,speed\ns,V,rad/s\nf8,f8,f8", "{t:g},{u},{w}", id="types below the units"),
        pytest.param("t,voltage,speed\nREAL,LREAL,REAL", "{t:g},{u},{w}", id="types below the names"),
        pytest.param(
            "t,voltage,other,speed", "{t:g},{u},missing,{w}", id="a value that is missing, as Julia writes it"
        ),
    ],
)
def test_further_tables(head: str, row: str, tmp_path: Path) -> None:
    rows = []
    for k in range(40):
        ticks, u, w = 133_864_000_130_000_000 + 50_000 * k, k % 7, k % 5
        rows.append(row.format(ticks=ticks, net=ticks + 504_911_232_000_000_000, number=k + 1, t=0.005 * k, u=u, w=w))
    file = tmp_path / "run.csv"
    file.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    found = read_record(file)
    np.testing.assert_allclose(found.t - found.t[0], 0.005 * np.arange(40), atol=1e-9)
    np.testing.assert_array_equal(found.signals["voltage"].values, np.arange(40) % 7)
    np.testing.assert_array_equal(found.signals["speed"].values, np.arange(40) % 5)


def test_numbers_of_base_16_are_read_and_their_sign_by_a_formula(tmp_path: Path) -> None:
    rows = [(k, -300 + 20 * k) for k in range(40)]
    (tmp_path / "run.csv").write_text("t [ms],raw,w\n" + "\n".join(f"{k},0x{v & 0xFFFF:04X},{v}" for k, v in rows))
    record = read_record(tmp_path / "run.csv", {"speed": "0.5 * int16(raw)", "turns": "w [rpm]"})
    np.testing.assert_array_equal(record.signals["speed"].values, [0.5 * v for _, v in rows])
    assert record.signals["turns"].unit == "rpm"
    raw = read_record(tmp_path / "run.csv").signals["raw"].values
    np.testing.assert_array_equal(raw, [v % 2**16 for _, v in rows])


def test_results_of_modelica(tmp_path: Path) -> None:
    from scipy.io import savemat

    names = ["time", "mass.s", "-force", "mass.m"]
    letters = ["".join(column) for column in zip(*(name.ljust(8) for name in names), strict=True)]
    info = np.array([[0, 2, 2, 1], [1, 2, -3, 2], [0, 0, 0, 0], [-1, -1, -1, 0]], dtype=np.int32)
    content = {"Aclass": ["Atrajectory", "1.1", "", "binTrans"], "name": letters, "description": letters}
    content |= {"dataInfo": info, "data_1": np.zeros((2, 2)), "data_2": np.array(ROWS).T}
    savemat(tmp_path / "run.mat", content, format="4")
    record = read_record(tmp_path / "run.mat")
    np.testing.assert_allclose(record.t, [t for t, _, _ in ROWS])
    np.testing.assert_allclose(record.signals[record.require("mass.s")].values, [a for _, a, _ in ROWS])
    np.testing.assert_allclose(record.signals[record.require("-force")].values, [-b for _, _, b in ROWS])
    assert not [name for name in record.signals if name.endswith("m")]


@pytest.mark.parametrize(
    ("name", "way"), [("a.bag", "rosbags-convert"), ("a.ulg", "ulog2csv"), ("a.pkl", "to_parquet")]
)
def test_files_of_other_kinds_are_told_what_makes_a_record_of_them(name: str, way: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(b"\0")
    with pytest.raises(RecordError, match=way):
        read_record(tmp_path / name)


def test_topics_with_stamps_of_their_own(tmp_path: Path) -> None:
    """Each is a series of its own, in whatever order the blocks stand."""
    file = tmp_path / "plot.csv"
    other = [(t + 0.002, b) for t, _, b in ROWS]
    rows = [f"{t},motor.a,{a}" for t, a, _ in ROWS] + [f"{t},b,{b}" for t, b in other]
    file.write_text("\n".join(["elapsed time,topic,value", *rows]) + "\n")
    record = read_record(file)
    np.testing.assert_allclose(record.series["b.value"].t, [t for t, _ in other], atol=1e-9)
    np.testing.assert_allclose(record.series["motor.a.value"].values, [a for _, a, _ in ROWS], atol=1e-9)


def test_topics_of_words_and_more_topics_than_are_wanted(tmp_path: Path) -> None:
    """The log of a robot has a hundred topics; those that are asked for are kept."""
    file = tmp_path / "log.csv"
    rows = [
        f"{t},{name},{k + t}" for t, _, _ in ROWS for k, name in enumerate(map(str, (f"/n/{i}" for i in range(70))))
    ]
    rows += [f"{t},/motor/volts,{a}" for t, a, _ in ROWS] + [f"{t},/enabled,true" for t, _, _ in ROWS]
    file.write_text("\n".join(["Timestamp,Key,Value", *rows]) + "\n")
    data = read_for_model(file, Model.load("dc_motor"), {"voltage": "/motor/volts.Value", "speed": "/n/3.Value"})
    np.testing.assert_allclose(data.u[:, 0], [a for _, a, _ in ROWS])
    np.testing.assert_allclose(data.measured["speed"], [3 + t for t, _, _ in ROWS])
    assert any("8 others, of words or more seldom, are left out" in note for note in data.notes)


def test_topics_of_a_log_that_begins_anew_are_not_mixed(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    once = [f"{t},{name},{x}" for t, a, b in ROWS for name, x in (("a", a), ("b", b), *([("a", a)] if not t else []))]
    file.write_text("\n".join(["time,topic,value", *once, *once]) + "\n")
    runs = read_records(file)
    assert [len(run) for run in runs] == [40, 40]
    for run in runs:
        np.testing.assert_allclose(run.signals["b.value"].values, [b for _, _, b in ROWS])


def test_a_column_of_words_beside_values_names_none(tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    file.write_text("t,state,a\n" + "\n".join(f"{t},{'on' if a > 1 else 'off'},{a}" for t, a, _ in ROWS))
    assert list(read_record(file).signals) == ["a"]


@pytest.mark.parametrize(
    ("head", "row", "asked"),
    [
        ("time_us,a", lambda t: f"{0.1 * t:.5f}", r"states us, in which its steps would be 5e-10 s: is it in s\?"),
        ("Time_ms,a,TimeString", lambda t: f"{86.4 * t}", r"'Time_ms' goes on by .*'TimeString' by 117 s"),
        ("time_min,a,stamp_ms", lambda t: f"{600 * t}", r"goes on by .* say which is right"),
    ],
)
def test_a_clock_that_another_one_or_its_own_steps_belie_is_asked_for(head, row, asked, tmp_path) -> None:
    """What is said of the time is taken as it is said."""
    file, model = tmp_path / "run.csv", Model.load("dc_motor")
    beside = {"TimeString": lambda t: f",30.11.2021 10:{int(10 * t):02d}:{round(600 * t) % 60:02d}"}
    beside["stamp_ms"] = lambda t: f",{round(1e3 * t)}"
    last = beside.get(head.split(",")[-1], lambda t: "")
    file.write_text("\n".join([head, *(f"{row(t)},{a}{last(t)}" for t, a, _ in ROWS)]) + "\n")
    signals = {"voltage": "0", "current": "a"}
    with pytest.raises(RecordError, match=asked):
        read_for_model(file, model, signals)
    time = head.split(",")[0]
    assert len(read_for_model(file, model, {**signals, "t": f"{time} [s]"})) == 40


def test_clocks_that_run_at_other_rates_are_no_other_units(tmp_path: Path) -> None:
    """A simulator's time is slower than the calendar's."""
    file = tmp_path / "run.csv"
    rows = [f"{t},{1719000000000 + round(3e3 * t)},{a}" for t, a, _ in ROWS]
    file.write_text("\n".join(["time [s],timestamp_ms,a", *rows]) + "\n")
    np.testing.assert_allclose(read_record(file).t, [t for t, _, _ in ROWS])


def test_which_time_is_taken_is_told(tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    file.write_text("sensor_time [ms],motor_time [ms],a\n" + "\n".join(f"{1e3 * t},{2e3 * t},{a}" for t, a, _ in ROWS))
    record = read_record(file)
    assert "'sensor_time [ms]' is taken for it" in str(record.notes[0])
    assert "so does 'motor_time [ms]': --signal t=COLUMN takes another one" in str(record.notes[0])
    np.testing.assert_allclose(read_record(file, {"t": "motor_time"}).t, [2 * t for t, _, _ in ROWS])


def test_rows_with_a_fault_are_no_messages(tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    rows = [f"{t},{a},{b}" for t, a, b in ROWS]
    file.write_text("\n".join(["t,a,b", *rows[:9], "0.0425,1", *rows[9:]]) + "\n")
    with pytest.raises(RecordError, match=r"row 10 \(line 11\) has 2 cells, the header 3 columns"):
        read_record(file)


def test_a_restart_in_the_middle_is_a_run_of_its_own(tmp_path: Path) -> None:
    file = tmp_path / "serial.log"
    rows = "\n".join(f"{t},{a},{b}" for t, a, b in ROWS)
    file.write_text(f"t,a,b\n{rows}\n0.2,4.1\nets Jun  8 2016 00:22:57\n\nrst:0x1 (POWERON_RESET),boot:0x13\n{rows}\n")
    runs = read_records(file)
    assert [len(run) for run in runs] == [40, 40]
    assert any(
        "3 lines among the rows are no rows and left out, the first (line 42) '0.2,4.1'" in n for n in runs[0].notes
    )


def test_a_file_of_another_kind_that_is_no_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "run.rec").write_bytes(b"RIFF\x00\x00\x01\x02")
    with pytest.raises(RecordError, match=r"unknown kind '\.rec'"):
        read_record(tmp_path / "run.rec")


def test_signals_with_times_of_their_own_beside_each_other(tmp_path: Path) -> None:
    """Each is taken at its own times, though one stops before the other, and it is told."""
    file = tmp_path / "scope.csv"
    rows = [f"{1e3 * t},{a}," + (f"{2e3 * t},{b}" if k < 25 else ",") for k, (t, a, b) in enumerate(ROWS)]
    file.write_text("\n".join(["Time_1 [ms],a,Time_2 [ms],b", *rows]) + "\n")
    record = read_record(file)
    for name, times, values in (
        ("a", [t for t, _, _ in ROWS], [a for _, a, _ in ROWS]),
        ("b", [2 * t for t, _, _ in ROWS[:25]], [b for _, _, b in ROWS[:25]]),
    ):
        there = np.isfinite(record.signals[name].values)
        np.testing.assert_allclose(record.t[there], times, atol=1e-9)
        np.testing.assert_allclose(record.signals[name].values[there], values)
    assert any("every signal has a time of its own in front of it" in note for note in record.notes)


def test_a_second_table_below_the_first_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    first, second = ([f"{t},{x}" for t, *both in ROWS for x in [both[k]]] for k in (0, 1))
    file.write_text("\n".join(["t,a", *first, "", "t,b", *second]) + "\n")
    with pytest.raises(RecordError, match=r"line 43, 't,b', names the columns of another table: put it"):
        read_record(file)


@pytest.mark.parametrize(
    ("head", "unit", "factor"),
    [
        ("speedRpm", "rpm", np.pi / 30),
        ("wheelVelocityDegPerSec", "deg/s", np.pi / 180),
        ("VelocityRotationsPerSec", "turns/s", 2 * np.pi),
        ("armVelocityRadPerSec", "rad/s", 1.0),
    ],
)
def test_units_in_camel_case(head: str, unit: str, factor: float, tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    file.write_text(f"timeMs,AppliedVolts,{head}\n" + "\n".join(f"{1e3 * t},{a},{b}" for t, a, b in ROWS))
    data = read_for_model(file, Model.load("dc_motor"), {"voltage": "AppliedVolts", "speed": head})
    np.testing.assert_allclose(data.measured["speed"], [factor * b for _, _, b in ROWS], rtol=1e-9)
    assert factor == 1.0 or any(f"speed is converted from {unit} to rad/s" in note for note in data.notes)


def test_a_few_rows_of_one_tick_are_dropped_and_told(tmp_path: Path) -> None:
    """A robot's log at 500 Hz that now and then has two samples of one tick."""
    file = tmp_path / "robot.csv"
    rows = [f"{0.002 * k:.3f},{np.sin(0.02 * k):.6f}" for k in range(200)]
    for k in (150, 90, 40):
        rows.insert(k + 1, rows[k] if k == 90 else f"{0.002 * k:.3f},0.5")
    file.write_text("\n".join(["timestamp,q", *rows]) + "\n")
    record = read_record(file)
    np.testing.assert_allclose(record.t, 0.002 * np.arange(200), atol=1e-9)
    np.testing.assert_allclose(record.signals["q"].values, np.sin(0.02 * np.arange(200)), atol=1e-6)
    said = " ".join(record.notes)
    assert "1 repeated row dropped (same stamp, same values)" in said
    assert "2 repeated rows dropped (the stamp of the row before, others)" in said


def test_a_labview_file_whose_x_begins_anew_at_every_write_has_no_time(tmp_path: Path) -> None:
    """What is to be said is said, and reads it; a channel that holds nothing is left out."""
    file = tmp_path / "writes.lvm"
    head = LVM.replace("X_Columns\tNo", "X_Columns\tOne") + "***End_of_Header***\nX_Value\ta\tb\tComment\n"
    file.write_text(head + "".join(f"0.0\t{k}.5\tNaN\n0.1\t{k}.25\tNaN\n" for k in range(60)))
    with pytest.raises(RecordError, match=r"no time column.*it has 'a'.*--dt"):
        read_record(file)
    record = read_record(file, {"t": "0.05"})
    assert list(record.signals) == ["a"]
    assert len(record) == 120
    assert any("its X begins anew 60 times, at every write, and is no time" in note for note in record.notes)


@pytest.mark.parametrize("ends", ["first", "last"])
def test_rows_that_come_in_bursts_of_any_size_are_even(ends: str, tmp_path: Path) -> None:
    sizes = np.random.default_rng(4).integers(1, 7, 60)
    last = np.cumsum(sizes) - 1
    of = np.repeat(last if ends == "last" else last - sizes + 1, sizes)
    (tmp_path / "run.csv").write_text("t,a\n" + "\n".join(f"{0.01 * k:.2f},{n}" for n, k in enumerate(of)))
    record = read_record(tmp_path / "run.csv")
    np.testing.assert_allclose(np.diff(record.t), 0.01, rtol=0.02)
    assert any("come in bursts" in note for note in record.notes)


def test_a_few_rows_that_are_too_early_cut_nothing(tmp_path: Path) -> None:
    order = [*range(40), 46, *range(40, 46), *range(47, 90), 95, *range(90, 95), *range(96, 120)]
    stamps = [0.01 * k for k in order]
    stamps[70] = 5000.0  # and one that is wrong
    (tmp_path / "run.csv").write_text("t,a\n" + "\n".join(f"{t:.2f},{k}" for t, k in zip(stamps, order, strict=True)))
    (run,) = read_records(tmp_path / "run.csv")
    assert run.signals["a"].values.tolist() == [k for k in range(120) if k != order[70]]
    assert {note.kind for note in run.notes} >= {"sorted", "left_out"}


def test_two_columns_of_one_clock_are_no_parts_of_it(tmp_path: Path) -> None:
    rows = [f"{1_080_042_607_500 + 10_000_000 * k},{1080.0426075 + 0.01 * k:.7f},{k}V" for k in range(60)]
    (tmp_path / "run.csv").write_text("MonoNS,MonoS,a\n" + "\n".join(rows))
    np.testing.assert_allclose(np.diff(read_record(tmp_path / "run.csv").t), 0.01, rtol=1e-6)


def test_a_time_in_millionths_of_a_day_that_is_called_ms(tmp_path: Path) -> None:
    lines, begin = [], 40_000.5
    for k in range(900):
        day, date = begin + 0.01 * k / 86_400.0, f"06.07.2009 12:00:{int(0.01 * k):02d}"
        lines += [f'"{name}";"{date}";{k + n};1;{day * 1e6:.9f}' for n, name in enumerate(("Drive_U", "Drive_I"))]
    (tmp_path / "run.csv").write_text('"VarName";"TimeString";"VarValue";"Validity";"Time_ms"\n' + "\n".join(lines))
    record = read_record(tmp_path / "run.csv")
    np.testing.assert_allclose(np.diff(record.t), 0.01, rtol=1e-2)
    assert any("millionths of a day" in note for note in record.notes)


def test_data_types_stand_above_units_or_below(tmp_path: Path) -> None:
    for rows in (("f8\tf8\tf8", "s\tV\t1/min"), ("s\tV\t1/min", "f8\tf8\tf8")):
        head = ["ETASAsciiItemFile\trecord", "sampleCount\t30", "time\tmot_u\tmot_n", *rows]
        body = [f"{0.01 * k:.2f}\t{k}\t{2 * k}" for k in range(30)]
        (tmp_path / "run.txt").write_text("\n".join([*head, *body]))
        signals = read_record(tmp_path / "run.txt").signals
        assert {name: signals[name].unit for name in ("mot_u", "mot_n")} == {"mot_u": "V", "mot_n": "1/min"}


KEYED = {
    "labchart.txt": "Interval=\t0.005 s\nExcelDateTime=\t4.4e+004\nChannelTitle=\tU\tN\nRange=\t20 V\t200 V\n"
    "UnitName=\tV\trpm\n" + "\n".join(f"{t:.3f}\t{a:.3f}\t{b:.3f}" for t, a, b in ROWS),
    "yokogawa.csv": '"Header Size",6\n"TraceName","U","N"\n"BlockSize",40,40\n"VUnit","V","rpm"\n'
    '"HResolution",5.0E-03,5.0E-03\n"Date","2021/03/04"\n\n' + "\n".join(f"{a:.5E},{b:.5E}," for _, a, b in ROWS),
    "graphtec.csv": "Vendor,GRAPHTEC\nSampling interval,5ms\n\nLogic/Pulse,Off\nData\nNumber,Date&Time,ms,U,N,X,Alarm\n"
    "NO.,Time,ms,V,rpm,V,\n"
    + "\n".join(
        f"{k + 1},2021/03/04 10:11:{12 + (995 + 5 * k) // 1000},{(995 + 5 * k) % 1000:3d},"
        f'+{a:9.4f},+{b:9.4f},-   1.0,"LL"'
        for k, (_, a, b) in enumerate(ROWS)
    ),
}


@pytest.mark.parametrize("name", KEYED)
def test_names_behind_keys_and_signs_apart(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(KEYED[name] + "\n")
    record = read_record(tmp_path / name)
    np.testing.assert_allclose(record.t - record.t[0], [t for t, _, _ in ROWS], atol=1e-9)
    assert (record.signals["U"].unit, record.signals["N"].unit) == ("V", "rpm")
    np.testing.assert_allclose(record.signals["N"].values, [b for _, _, b in ROWS], atol=1e-3)


HEADED = {
    "catman.asc": "HBM_CATMAN_DATAFILE_40\tcatmanEasy\nMesskanäle:\t3\nZeit  1 - Standardrate\tU\tN\ns\tV\t1/min\n"
    "\tMX840A_0_CH1\tMX840A_0_CH2",
    "mts.txt": "Data Acquisition: Timed\t\tTime: 12.5 Sec\nTime\tU\tN\nSec\tV\tsegments/min",
    "signal_express.txt": "channel names:\t\t\nTime\tU\tN\ndt:\t\t\n0.005\t0.005\t0.005\ndata:\t\t",
}


@pytest.mark.parametrize("name", HEADED)
def test_names_are_those_of_all_columns(name: str, tmp_path: Path) -> None:
    """Below them stand units, known or not, and what names no column of values."""
    rows = "\n".join(f"{t:.3f}\t{a:.3f}\t{b:.3f}" for t, a, b in ROWS)
    (tmp_path / name).write_text(f"{HEADED[name]}\n{rows}\n")
    record = read_record(tmp_path / name)
    np.testing.assert_allclose(record.t - record.t[0], [t for t, _, _ in ROWS], atol=1e-9)
    np.testing.assert_allclose(record.signals["N"].values, [b for _, _, b in ROWS], atol=1e-3)
    assert record.signals["U"].unit == ("" if name.startswith("signal") else "V")


def test_objects_behind_a_stamp_and_a_topic_are_called_by_it(tmp_path: Path) -> None:
    lines = [
        f'2021-03-04T10:11:12.{5 * k:03d}000Z rig/motor {{"u":{a:.3f},"n":{b:.3f}}}' for k, (_, a, b) in enumerate(ROWS)
    ]
    (tmp_path / "mqtt.log").write_text("\n".join(lines) + "\n")
    record = read_record(tmp_path / "mqtt.log")
    np.testing.assert_allclose(record.t, [t for t, _, _ in ROWS], atol=1e-9)
    assert set(record.signals) == {"rig/motor.u", "rig/motor.n"}
