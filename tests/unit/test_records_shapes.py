"""The same record written in all the ways that people write it reads as the same."""

import gzip
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from signlin_ros.errors import RecordError
from signlin_ros.model import Model
from signlin_ros.records import ModelData, read_for_model, read_records, read_runs

STEPS = 60
T = np.arange(STEPS) * 0.01
ROWS = np.column_stack([T, np.round(3 * np.sin(7 * T), 4), np.round(2 * np.cos(5 * T), 4), np.round(20 * T, 4)])
MOTOR = Model.load("dc_motor")
NAMES = ["t", "voltage", "current", "speed"]


def lines(mark: str = ",", comma: bool = False, rows: np.ndarray = ROWS) -> list[str]:
    text = [mark.join(f"{value:.4f}" for value in row) for row in rows]
    return [line.replace(".", ",") for line in text] if comma else text


def with_header(header: str, body: list[str], end: str = "\n") -> str:
    return end.join([header, *body]) + end


def stamped(stamp: Callable[[float], str], name: str = "t") -> str:
    body = [f"{stamp(row[0])},{row[1]:.4f},{row[2]:.4f},{row[3]:.4f}" for row in ROWS]
    return with_header(",".join([name, *NAMES[1:]]), body)


def clock(t: float, start: float = 34023.0) -> str:
    seconds = start + t
    hours, rest = divmod(seconds, 3600)
    return f"{int(hours) % 24:02d}:{int(rest // 60):02d}:{rest % 60:06.3f}"


def shapes() -> Iterator[tuple[str, str]]:
    plain = ",".join(NAMES)
    yield "plain", with_header(plain, lines())
    yield "crlf", with_header(plain, lines(), "\r\n")
    yield "semicolons and commas", with_header(";".join(NAMES), lines(";", comma=True))
    yield "tabs and commas", with_header("\t".join(NAMES), lines("\t", comma=True))
    yield (
        "quoted decimal commas",
        with_header(plain, [",".join(f'"{c}"' for c in r.split(";")) for r in lines(";", True)]),
    )
    yield "blanks", with_header("  ".join(NAMES), ["   " + line for line in lines("   ")])
    yield "blanks and commas", with_header("  ".join(NAMES), lines("  ", comma=True))
    yield "percent comments", "% recorded by hand\n% t voltage current speed\n" + "\n".join(lines(" ")) + "\n"
    yield "trailing separators", with_header(plain + ",", [line + "," for line in lines()])
    yield "trailing separators in the rows", with_header(plain, [line + "," for line in lines()])
    yield "preamble", "Scope export,v2\nserial;4711\n\nChannels,4,3,2\n" + with_header(plain, lines())
    yield "sep line", "sep=;\n" + with_header(";".join(NAMES), lines(";"))
    yield "row of units", with_header(plain + "\n[s],[V],[A],[rad/s]", lines())
    yield "capital letters", with_header("Time,VOLTAGE,Current,Speed", lines())
    yield "header again", with_header(plain, [*lines()[:30], plain, *lines()[30:]])
    yield "cut off", with_header(plain, lines()) + "0.6100,0.1"
    yield "zeros at the end", with_header(plain, lines()) + "\0" * 40
    yield (
        "text beside",
        with_header(plain + ",mode", [f"{line},{'run' if i % 2 else 'idle'}" for i, line in enumerate(lines())]),
    )
    yield "late row", with_header(plain, [*lines()[:20], lines()[21], lines()[20], *lines()[22:]])
    yield "iso", stamped(lambda t: f"2025-03-30T09:27:{3 + t:06.3f}+02:00")
    yield "clock", stamped(clock, "Time")
    yield "clock over midnight", stamped(lambda t: clock(t, 86399.7), "Time")
    yield "german dates", stamped(lambda t: f"09.11.2025 09:27:{3 + t:06.3f}")
    yield "epoch s", stamped(lambda t: f"{1766147454 + t:.3f}", "timestamp")
    yield "epoch ms", stamped(lambda t: f"{1766147454000 + round(1000 * t)}", "timestamp")
    yield "epoch us", stamped(lambda t: f"{1766147454000000 + round(1e6 * t)}", "stamp")
    yield "epoch ns", stamped(lambda t: f"{1766147454000000001 + round(1e9 * t)}", "%time")
    yield "millis()", stamped(lambda t: f"{round(1000 * t)}", "millis()")
    yield "sec, nsec", stamped(lambda t: f"{1766147454 + int(t + 0.5)},{round((t + 0.5) % 1 * 1e9)}", "secs,nsecs")
    yield "a torque beside", with_header("T," + plain, [f"0.5,{line}" for line in lines()])
    yield "bars", with_header("|".join(NAMES), lines("|"))
    yield "rows counted", with_header("," + plain, [f"{i},{line}" for i, line in enumerate(lines())])
    yield "marks of inches", with_header(plain + ",note", [f'{line},5" wheel' for line in lines()])
    yield (
        "LabVIEW",
        "LabVIEW Measurement\t\nSeparator\tTab\n***End***\t\n\nX_Value\t"
        + with_header("\t".join([*NAMES[1:], "Comment"]), [line + "\t" for line in lines("\t")]),
    )
    yield "not available", with_header(plain, lines()).replace(lines()[5], lines()[5].rsplit(",", 1)[0] + ",#N/A")


SHAPES = dict(shapes())


def same(found: ModelData) -> None:
    np.testing.assert_allclose(found.t - found.t[0], T, atol=1e-6)
    np.testing.assert_allclose(found.u[:, 0], ROWS[:, 1])
    for name, column in (("current", 2), ("speed", 3)):
        there = np.isfinite(found.measured[name])
        assert np.count_nonzero(~there) <= 1
        np.testing.assert_allclose(found.measured[name][there], ROWS[there, column], rtol=1e-12)


@pytest.mark.parametrize("name", SHAPES)
def test_every_shape_reads_as_the_same(tmp_path: Path, name: str) -> None:
    path = tmp_path / "run.csv"
    path.write_text(SHAPES[name], newline="")
    (data,) = read_runs(path, MOTOR)
    same(data)


@pytest.mark.parametrize("suffix", [".gz", ".zip"])
def test_archives(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"run.csv{suffix}"
    if suffix == ".gz":
        path.write_bytes(gzip.compress(SHAPES["plain"].encode()))
    else:
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("folder/run.csv", SHAPES["plain"])
    same(read_for_model(path, MOTOR))
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(RecordError, match="cannot be unpacked"):
        read_for_model(path, MOTOR)


def test_no_header_and_numbers_for_names(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("\n".join(lines()) + "\n")
    same(read_for_model(path, MOTOR, {"voltage": "2", "current": "#3", "speed": "c4"}))
    with pytest.raises(RecordError, match=r"no column for input 'voltage'.*'c2'"):
        read_for_model(path, MOTOR)


def test_rows_that_are_evenly_spaced_need_no_time(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text(with_header(",".join(NAMES[1:]), lines(rows=ROWS[:, 1:])))
    same(read_for_model(path, MOTOR, {"t": "0.01"}))
    same(read_for_model(path, MOTOR, {"t": "10 [ms]"}))
    with pytest.raises(RecordError, match=r"no time column.*--signal t=COLUMN.*--dt"):
        read_for_model(path, MOTOR)


BY_NUMBER = {"t": "c1", "voltage": "c2 [V]", "current": "0.001 * c3", "speed": "c4 [rad/s]"}


@pytest.mark.parametrize("header", ['"Time","data"', "Time,data,x"])
def test_a_header_of_too_few_names_is_not_needed_where_columns_are_called_by_number(
    tmp_path: Path, header: str
) -> None:
    file = tmp_path / "run.csv"
    file.write_text(with_header(header, lines()))
    data = read_for_model(file, MOTOR, BY_NUMBER)
    np.testing.assert_allclose(data.t, T, atol=1e-9)
    np.testing.assert_allclose(data.measured["current"], 1e-3 * ROWS[:, 2])
    assert any("the rows 4: the columns are called c1 to c4" in note for note in data.notes)
    for signals in ({}, {**BY_NUMBER, "t": "Time"}, {"voltage": "data"}):
        with pytest.raises(RecordError, match=r"has 4 cells, the header .*call the columns c1 to c4: --signal NAME=c2"):
            read_for_model(file, MOTOR, signals)


def test_a_restart_with_its_header_and_one_that_is_short(tmp_path: Path) -> None:
    path, plain = tmp_path / "run.csv", ",".join(NAMES)
    path.write_text(with_header(plain, [*lines(), plain, *lines()]))
    runs = read_runs(path, MOTOR)
    assert len(runs) == 2
    for run in runs:
        same(run)
    path.write_text(with_header(plain, [*lines(), *lines()[:8]]))
    (run,) = read_runs(path, MOTOR)
    same(run)
    assert [note.kind for note in run.notes] == ["cut", "left_out"]
    assert [len(record) for record in read_records(path)] == [STEPS, 8]
    assert "the longest" in str(read_for_model(path, MOTOR).notes)


def test_a_wrong_stamp_is_left_out_and_rows_in_no_order_are_refused(tmp_path: Path) -> None:
    path, plain = tmp_path / "run.csv", ",".join(NAMES)
    rows = np.repeat(ROWS, 3, axis=0)
    rows[:, 0] = np.arange(len(rows)) * 0.01
    rows[120, 0] = 0.0
    path.write_text(with_header(plain, lines(rows=rows)))
    (run,) = read_runs(path, MOTOR)
    assert len(run) == len(rows) - 1
    assert "left_out" in [note.kind for note in run.notes]
    order = np.random.default_rng(0).permutation(len(rows))
    path.write_text(with_header(plain, lines(rows=rows[order])))
    with pytest.raises(RecordError, match=r"row \d+ \(line \d+\).*in no order of time"):
        read_runs(path, MOTOR)


def test_columns_with_clocks_of_their_own_are_held_from_their_stamps(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    body = []
    for i, row in enumerate(ROWS):  # the command 3 ms after every fifth state
        body.append(f"{row[0]:.4f},,{row[2]:.4f},{row[3]:.4f}")
        if i % 5 == 0:
            body.append(f"{row[0] + 0.003:.4f},{row[1]:.4f},,")
    path.write_text(with_header(",".join(NAMES), body))
    data = read_for_model(path, MOTOR)
    assert data.acts is not None
    switched = np.flatnonzero(np.diff(data.u[:, 0])) + 1
    np.testing.assert_allclose(data.acts[switched] - data.t[switched], 0.003)
    np.testing.assert_allclose(data.u[switched, 0], ROWS[5::5, 1][: len(switched)])


def test_a_command_that_is_logged_when_it_is_given_is_held(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    body = [
        line if i % 6 == 0 else ",,".join([line.split(",")[0], line.split(",", 2)[2]]) for i, line in enumerate(lines())
    ]
    path.write_text(with_header(",".join(NAMES), body))
    data = read_for_model(path, MOTOR)
    np.testing.assert_allclose(data.u[:, 0], np.repeat(ROWS[::6, 1], 6))
    assert [note.kind for note in data.notes] == ["held"]


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ('t,a\n0,1\n1,"2\n2,3\n', ["row 2 (line 3)", "'a'", "not closed"]),
        ("t,a\n0,1\n1,2,9\n2,3\n", ["row 2 (line 3)", "3 cells", "2 columns", "'1,2,9'"]),
        ("t [furlong],a\n0,1\n1,2\n", ["'furlong'", "t = COLUMN [ms]"]),
        ("x,a\n0,1\n1,2\n", ["'x', 'a'", "--signal t=COLUMN", "--dt"]),
    ],
)
def test_a_refusal_names_the_place_and_what_would_help(tmp_path: Path, text: str, parts: list[str]) -> None:
    path = tmp_path / "run.csv"
    path.write_text(text)
    with pytest.raises(RecordError) as error:
        read_records(path)
    assert all(part in str(error.value) for part in parts), str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("row", ["0.0,1.0,2.0", "0,12345678,2.7"])
def test_one_row_without_a_header_is_refused(row: str, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text(f"{row}\n")
    with pytest.raises(RecordError, match="no time column"):
        read_records(path)
