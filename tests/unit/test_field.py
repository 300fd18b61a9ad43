"""Records as people have them are read, or refused with the way out. SIGNLIN_DATA names their folder; the right answer
of each is in its README.
"""

import os
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from signlin_ros.cli import signlin
from signlin_ros.diagnosis.comparison import compare
from signlin_ros.errors import RecordError
from signlin_ros.follow.data import load_records
from signlin_ros.model import Model
from signlin_ros.records import ModelData, read_for_model, read_runs

FIELD = Path(os.environ.get("SIGNLIN_DATA", "../shared/data")) / "field"
pytestmark = pytest.mark.skipif(
    not FIELD.is_dir(),
    reason=f"the records from the field are not at {FIELD} (set SIGNLIN_DATA to the folder above it)",
)
MOTOR = Model.load("dc_motor")
PLOTJUGGLER = {
    "voltage": "/cmd/data",
    "current": "/joint_states/wheel/effort",
    "speed": "/joint_states/wheel/velocity",
}
BAG = {
    "voltage": "/cmd.data",
    "speed": "/joint_states.velocity[wheel]",
    "position": "/joint_states.position[wheel]",
}


def read(name: str, signals: dict[str, str] | None = None) -> ModelData:
    return read_for_model(FIELD / "csv" / f"{name}.csv", MOTOR, signals)


def same(found: ModelData, name: str = "plain", rounding: float = 5e-3) -> None:
    """The same record, to the digits that the file keeps, in `rounding` of the plain one's spread."""
    right = read(name)
    np.testing.assert_allclose(found.t - found.t[0], right.t - right.t[0], atol=1e-3 + 1e-9)
    np.testing.assert_allclose(found.u, right.u, atol=rounding)
    for channel in right.measured:
        np.testing.assert_allclose(found.measured[channel], right.measured[channel], atol=rounding)


@pytest.mark.parametrize(
    "name", ["upper", "dup_header", "hash_in_cell", "semicolon_comma", "header_trailing_comma", "preamble", "units_row"]
)
def test_shapes(name: str) -> None:
    same(read(name))


@pytest.mark.parametrize("name", ["suffix_units", "mV", "paren_units", "turns", "imperial", "degps", "rps", "u_per_s"])
def test_units_are_converted_and_said(name: str) -> None:
    found = read(name)
    same(found, rounding=0.04)  # the coarsest has five decimals of a turn
    if name != "u_per_s":
        assert any(note.kind == "converted" and note.channel == "speed" for note in found.notes)


def test_units_of_a_damper() -> None:
    data = read_for_model(FIELD / "csv" / "imperial_damper.csv", Model.load("force_element"))
    assert data.measured["force"][0] == pytest.approx(-0.012013199739158154 * 4448.2216152605)
    assert data.u[0, 0] == pytest.approx(0.0612095574974799 * 0.0254)
    assert data.measured["displacement"][0] == pytest.approx(0.0015324801206588745 * 0.0254)


@pytest.mark.parametrize("name", ["epoch_ns", "epoch_ms", "sec_nsec", "iso_time"])
def test_clocks(name: str) -> None:
    found = read(name)
    same(found)
    assert any(note.kind == "clock" for note in found.notes)


@pytest.mark.parametrize("verb", ["simulate", "compare", "diagnose", "add", "refine"])
def test_a_time_without_a_unit_is_asked_for_by_every_verb(verb: str, tmp_path: Path) -> None:
    file, out = str(FIELD / "csv" / "millis_nounit.csv"), ["-o", str(tmp_path / "out.csv")]
    if verb in ("add", "refine"):
        out = ["-o", str(tmp_path / "out.yaml")]
    effect = ["constant_load"] if verb == "add" else []
    given = out if verb in ("simulate", "add", "refine") else []
    with pytest.raises(RecordError, match=r"is it in ms\?.*t \[ms\].*--dt"):
        CliRunner().invoke(signlin, [verb, *effect, "dc_motor", file, *given], catch_exceptions=False)
    same(read("millis_nounit", {"t": "t [ms]"}))
    same(read("millis_nounit", {"t": "0.01"}))


def test_topic_echo_without_a_header_by_number() -> None:
    same(read("rostopic_echo_noheader", {"voltage": "8", "current": "7", "speed": "6"}))
    same(read("rostopic_echo_noheader", {"t": "c1 + 1e-9*c2", "voltage": "c8", "current": "c7", "speed": "c6"}))


def test_columns_with_clocks_of_their_own() -> None:
    found, right = read("plotjuggler", PLOTJUGGLER), read("plain")
    assert found.acts is not None
    np.testing.assert_allclose(found.measured["speed"], right.measured["speed"][2::2])
    np.testing.assert_allclose(found.t - found.acts, 0.01, atol=1e-6)
    np.testing.assert_allclose(found.u[:, 0], right.u[1::2, 0][: len(found)])


def test_an_open_quote_is_refused_in_one_line() -> None:
    with pytest.raises(RecordError, match=r"row 4 \(line 5\), column 'note': a quote is opened and not closed: .*5 in"):
        read("quote_large")


def test_a_restart_cuts_the_record_in_two() -> None:
    runs = read_runs(FIELD / "csv" / "restart.csv", MOTOR)
    assert len(runs) == 2
    for run in runs:
        same(run)
        assert [note.kind for note in run.notes] == ["cut"]


def test_a_direction_column_gives_the_sign() -> None:
    same(read("sign_column", {"voltage": "sign(dir) * pwm"}))


def test_factor_offset_and_sign_bit() -> None:
    data = read(
        "feetech",
        {
            "t": "timestamp",
            "voltage": "12 * 0.001 * signbit(load, 10)",
            "current": '6.5e-3 * "current (5)"',
            "speed": "0.0015339808 * signbit(speed, 15)",
        },
    )
    np.testing.assert_allclose(data.t, [0.0, 0.101, 0.202, 0.303, 0.404], atol=1e-9)
    np.testing.assert_allclose(data.u[:, 0], [0.48, 0.912, 0.864, -0.384, -0.912])
    np.testing.assert_allclose(data.measured["speed"] / 0.0015339808, [0, -300, -350, 0, 350])


def test_a_broken_header_is_refused_with_the_line() -> None:
    with pytest.raises(RecordError, match=r"line 4\) has 7 cells, the header 6 columns .*0\.014019152 0\.000000"):
        read("moteus_dyno")


@pytest.mark.parametrize(
    ("name", "signals"),
    [
        ("to_workspace", {}),
        ("to_file", {"voltage": "ans[1]", "current": "ans[2]", "speed": "ans[3]"}),
        ("u_y_Ts", {"voltage": "u", "current": "y[0]", "speed": "y[1]"}),
        ("v73", {}),
    ],
)
def test_mat(name: str, signals: dict[str, str]) -> None:
    if name == "v73":
        pytest.importorskip("h5py")
    data = read_for_model(FIELD / "mat" / f"{name}.mat", MOTOR, signals)
    assert set(data.measured) == {"current", "speed"}
    np.testing.assert_allclose(np.diff(data.t), 0.01)
    assert np.ptp(data.measured["speed"]) > 10.0


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["cmd_1us_before", "cmd_1us_after", "order_changes", "nan_velocity", "no_effort", "stamp_zero", "clock_back"],
)
def test_a_command_beside_the_state_acts_when_it_came(name: str) -> None:
    model, data = load_records(MOTOR, FIELD / "bags" / name, BAG)
    found = compare(model, data)
    assert found.channels["speed"].free_run.rmse_over_noise < 1.05
    assert found.channels["position"].free_run.rmse_over_noise < 1.1


@pytest.mark.parametrize("name", ["clock_back", "clock_back_all"])
def test_a_clock_that_jumps_back_cuts_a_bag_in_two(name: str) -> None:
    _, runs = load_records(MOTOR, FIELD / "bags" / name, BAG)
    assert [len(run) for run in runs] == [800, 800]
    cut = [note for note in runs[0].notes if note.kind == "cut"]
    assert len(cut) == 1
    assert "message 801" in cut[0]
