"""Mappings of several records in one: what is said of all, and of one alone."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from signlin_ros.apart import check_given, of_record, together
from signlin_ros.cli import main
from signlin_ros.errors import InputError, ModelError, RecordError
from signlin_ros.model import Model
from signlin_ros.records import read_for_model

PATHS = ("a/run.csv", "b/run.csv", "b/other.csv")
OWN = st.dictionaries(st.sampled_from(["voltage", "speed", "t"]), st.sampled_from(["c1", "c2", "-2 * c3 [rpm]"]))


@given(st.fixed_dictionaries(dict.fromkeys(PATHS, OWN)))
def test_one_mapping_says_what_those_of_the_records_say(signals: dict[str, dict[str, str]]) -> None:
    one = together(signals)
    check_given(one, PATHS)
    for path, own in signals.items():
        assert of_record(one, path) == own


def test_what_all_records_share_is_said_once() -> None:
    assert together({p: {"speed": "c1"} for p in PATHS}) == {"speed": "c1"}
    assert together({"x/a.csv": {"speed": "c1"}, "x/b.csv": {"speed": "c2"}}) == {
        "a.csv:speed": "c1",
        "b.csv:speed": "c2",
    }
    assert of_record({"speed": "c1", "a.csv:speed": "c2"}, "x/a.csv") == {"speed": "c2"}


def test_a_record_that_is_not_there_is_named() -> None:
    with pytest.raises(InputError, match=r"no record 'run_3.csv' is given; there are: run_1.csv, run_2.csv"):
        check_given({"run_3.csv:speed": "c1"}, ["run_1.csv", "run_2.csv"])


def write(path: Path, order: tuple[int, int, int]) -> str:
    rows = ([k % 7 - 3.0, 0.1 * k, 0.2 * k] for k in range(60))
    path.write_text("".join(f"{0.01 * k:g},{','.join(f'{row[i]:g}' for i in order)}\n" for k, row in enumerate(rows)))
    return str(path)


def test_the_command_line_reads_each_record_by_its_own_columns(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one, other = write(tmp_path / "one.csv", (0, 1, 2)), write(tmp_path / "other.csv", (2, 0, 1))
    signals = [
        "voltage=c2",
        "current=c3",
        "speed=c4",
        "other.csv:voltage=c3",
        "other.csv:current=c4",
        "other.csv:speed=c2",
    ]
    said = [word for text in signals for word in ("--signal", text)]
    assert main(["check", "dc_motor", one, other, *said]) == 0
    assert main(["check", "dc_motor", one, *said]) == 2
    assert "no record 'other.csv' is given" in capsys.readouterr().err
    mapping = dict(text.split("=") for text in signals)
    first, second = (read_for_model(path, Model.load("dc_motor"), mapping) for path in (one, other))
    assert first.measured["speed"].tolist() == second.measured["speed"].tolist()
    assert first.u.tolist() == second.u.tolist()


def test_a_model_file_says_where_what_holds_for_one_record_alone_is_said() -> None:
    with pytest.raises(
        ModelError, match=r"'other.csv' alone is said on the command line: --signal 'other.csv:speed=w m'"
    ):
        Model.load("dc_motor").with_options(signals={"other.csv:speed": "w m"})


@pytest.mark.parametrize("spec", ["c3", "c3 [mA]", "-2 * c3", "0.5 * c3 - 1"])
def test_one_column_is_not_two_signals(tmp_path: Path, spec: str) -> None:
    file = write(tmp_path / "one.csv", (0, 1, 2))
    with pytest.raises(RecordError, match="the column 'c3' is read as current and as speed; allowed: a column is one"):
        read_for_model(file, Model.load("dc_motor"), {"voltage": "c2", "current": spec, "speed": "c3"})


def test_a_formula_of_several_columns_may_use_them_again(tmp_path: Path) -> None:
    file = write(tmp_path / "one.csv", (0, 1, 2))
    signals = {"voltage": "c2", "current": "c3", "speed": "0.5 * (c3 + c4)"}
    assert read_for_model(file, Model.load("dc_motor"), signals).measured["speed"][-1] == pytest.approx(8.85)
