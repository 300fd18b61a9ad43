"""A row for every joint at every stamp, as tidy tables have it: a column for each quantity of a joint."""

import numpy as np
import pytest

from signlin_ros.records import read_record

T = 0.005 * np.arange(40)


def long_table(names, order=1, head="time_s,joint,position_rad,torque_nm"):
    lines = [head]
    for k, t in enumerate(T):
        for i, name in list(enumerate(names))[:: order if k % 2 else 1]:
            lines.append(f"{t:.4f},{name},{np.sin(k + i):.6f},{np.cos(k + 2 * i):.6f}")
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("order", [1, -1], ids=["in one order", "in any order"])
@pytest.mark.parametrize(
    ("names", "called"),
    [((1, 2), ("joint1", "joint2")), (("elbow", "shoulder", "wrist"), ("elbow", "shoulder", "wrist"))],
)
def test_joints_in_rows_get_columns(names, called, order, tmp_path):
    (tmp_path / "a.csv").write_text(long_table(names, order))
    record = read_record(tmp_path / "a.csv")
    np.testing.assert_allclose(record.t, T, atol=1e-9)
    assert list(record.labels.values()) == [f"{one}.{what}" for one in called for what in ("position_rad", "torque_nm")]
    for i, name in enumerate(called):
        key = record.find(f"{name}.position_rad")
        np.testing.assert_allclose(record.signals[key].values, np.sin(np.arange(40) + i), atol=1e-6)
    assert any("each time has a row for every 'joint'" in note for note in record.notes)


def test_a_table_of_names_and_values_has_columns_of_these_names(tmp_path):
    rows = [f"{t:.3f},{name},{k + i}" for k, t in enumerate(T) for i, name in enumerate(("pos", "Iq"))]
    (tmp_path / "a.csv").write_text("time,signal,value\n" + "\n".join(rows) + "\n")
    record = read_record(tmp_path / "a.csv")
    np.testing.assert_array_equal(record.signals[record.find("pos")].values, np.arange(40))
    np.testing.assert_array_equal(record.signals[record.find("Iq")].values, np.arange(40) + 1)
    assert any("columns are called Iq and so on" in note for note in record.notes)


def test_a_row_that_was_cut_off_costs_its_stamp_alone(tmp_path):
    (tmp_path / "a.csv").write_text("\n".join(long_table((1, 2)).splitlines()[:-1]) + "\n")
    assert len(read_record(tmp_path / "a.csv")) == len(T) - 1


def test_a_large_table_is_read_so_too(tmp_path):
    t = 0.001 * np.arange(70_000)
    rows = np.column_stack([np.repeat(t, 2), np.tile([1.0, 2.0], t.size), np.repeat(np.sin(t), 2)])
    np.savetxt(
        tmp_path / "a.csv", rows, fmt=("%.6f", "%d", "%.12f"), delimiter=",", header="t,joint,q_rad", comments=""
    )
    record = read_record(tmp_path / "a.csv")
    assert len(record) == t.size
    assert list(record.labels.values()) == ["joint1.q_rad", "joint2.q_rad"]


def test_a_clock_that_is_coarser_than_the_rows_is_no_long_table(tmp_path):
    rows = [f"{t:.3f},{np.sin(k):.6f}" for k, t in enumerate(np.repeat(T, 2))]
    (tmp_path / "a.csv").write_text("t,q\n" + "\n".join(rows) + "\n")
    assert len(read_record(tmp_path / "a.csv")) == 2 * len(T)
