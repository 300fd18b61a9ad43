"""Records that strangers have, by the kinds of ``strangers/README.md``: read, refused with a way that works, or
diagnosed as their ``answer.txt`` says. SIGNLIN_DATA names the folder above them.
"""

import os
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from signlin_ros.checks.finding import Finding
from signlin_ros.checks.run import check, require_sound
from signlin_ros.cli import signlin
from signlin_ros.diagnosis.comparison import compare
from signlin_ros.diagnosis.results import Diagnosis
from signlin_ros.diagnosis.verbs import diagnose
from signlin_ros.errors import InputError, RecordError
from signlin_ros.follow.data import load_records, load_sides
from signlin_ros.model import Model
from signlin_ros.records import ModelData, read_for_model

STRANGERS = Path(os.environ.get("SIGNLIN_DATA", "../shared/data")) / "field" / "strangers"
pytestmark = pytest.mark.skipif(
    not STRANGERS.is_dir(),
    reason=f"the records of strangers are not at {STRANGERS} (set SIGNLIN_DATA to the folder that holds field/)",
)
GERMAN = {"force": "Moment", "displacement": "Winkel", "velocity": "Drehzahl"}
ARM = {"voltage": "action[0]", "speed": "observation.state[0]", "current": "observation.state[1]"}


def model_of(folder: str) -> Model:
    return Model.load(STRANGERS / folder / "model.yaml")


def read(folder: str, file: str, signals: dict[str, str] | None = None) -> ModelData:
    return read_for_model(STRANGERS / folder / file, model_of(folder), signals)


def checked(folder: str, *files: str, cures: tuple[str, ...] = (), signals: dict[str, str] | None = None):
    model, records = load_records(
        model_of(folder), [STRANGERS / folder / f for f in files or ("a.csv", "b.csv")], signals
    )
    return check(model, records, cures)


def found(folder: str, name: str, *files: str) -> list[Finding]:
    return [f for f in checked(folder, *files)[1] if f.check == name]


def diagnosed(folder: str, signals: dict[str, str] | None = None, known: str = "a", unseen: str = "b") -> Diagnosis:
    suffix = ".parquet" if folder == "lerobot_parquet" else ".csv"
    paths = [[STRANGERS / folder / f"{one}{suffix}"] for one in (known, unseen)]
    model, first, second = load_sides(model_of(folder), *paths, signals)
    records, findings = check(model, [*first, *(second or ())], validated=True)
    require_sound(findings)
    return diagnose(model, records[: len(first)], records[len(first) :])


def named(result: Diagnosis) -> set[str]:
    return {entry.effect for entry in result.missing}


# ------------------------------------------------------------------ files


def test_labview_is_read_whatever_it_is_called() -> None:
    for file in ("one.lvm", "one.txt"):
        data = read("labview_lvm", file)
        assert len(data) == 2400
        assert data.measured["current"][0] == pytest.approx(0.018646)
        assert data.t[1] == pytest.approx(0.005)
    with pytest.raises(RecordError, match=r"its time is 't \[s\]'; leave --signal t=c1 out"):
        read("labview_lvm", "one.txt", {"t": "c1", "voltage": "c2"})


def test_scope_of_twincat_is_read_with_its_whole_header() -> None:
    data = read("twincat_scope", "a.csv")
    assert data.t[-1] == pytest.approx(11.995)
    assert (data.u[-1, 0], data.measured["speed"][-1]) == pytest.approx((-4.8, -40.046606))


def test_a_trace_of_codesys_has_names_and_its_own_time() -> None:
    data = read("codesys_trace", "trace.csv", {"voltage": "Main_Control.Velocidad_Scaled"})
    assert np.diff(data.t) == pytest.approx(0.02)
    with pytest.raises(RecordError, match="leave --signal t=c2 out, and name the others as the file does"):
        read("codesys_trace", "trace.csv", {"t": "c2", "voltage": "c3"})


def test_an_oscilloscope_states_its_step() -> None:
    mapping = {"voltage": "CH1", "current": "CH2", "speed": "CH3"}
    for signals in (mapping, {**mapping, "t": "0.005"}):
        data = read("rigol_csv", "a.csv", signals)
        assert data.t[1] == pytest.approx(0.005)
        assert data.measured["current"][1] == pytest.approx(-0.0027)


def test_lists_in_cells_are_columns_and_episodes_runs() -> None:
    _, runs = load_records(model_of("lerobot_parquet"), STRANGERS / "lerobot_parquet" / "a.parquet", ARM)
    assert [len(run) for run in runs] == [1200, 1200]
    assert runs[0].measured["speed"][:2] == pytest.approx([-0.05928104, -0.11114048])


def test_a_structure_with_times_of_its_own_is_read_by_row() -> None:
    mapping = {name: f"test_telemetry.{of}.data[1]" for name, of in (("voltage", "pwm"), ("current", "current"))}
    data = read("robometry_mat", "a.mat", mapping)
    assert len(data) == 2400
    assert np.ptp(data.u) > 1.0
    with pytest.raises(RecordError, match=r"it has .*'test_telemetry.pwm.data\[1\]'"):
        read("robometry_mat", "a.mat", {"voltage": "test_telemetry.pwm.data", "t": "test_telemetry.pwm.timestamps"})


@pytest.mark.parametrize(
    ("file", "signals", "second"),
    [
        ("matlab_timetable.csv", {}, -0.002697),
        ("blank_third_row.csv", {}, -2.70e-3),
        ("simplefoc_banner.txt", {"t": "0.005", "voltage": "c1", "current": "c2", "speed": "c3"}, -0.0027),
        ("label_value.txt", {"voltage": "u", "current": "i", "speed": "w"}, -0.003),
    ],
)
def test_small_formats(file: str, signals: dict[str, str], second: float) -> None:
    data = read("small_formats", file, signals)
    assert np.diff(data.t) == pytest.approx(0.005)
    assert data.measured["current"][1] == pytest.approx(second)


def test_revolutions_a_minute_are_written_in_many_ways() -> None:
    pytest.importorskip("asammdf")
    data = read("small_formats", "per_minute.mf4", {"voltage": "u_cmd", "speed": "n_mot", "current": "i_mot"})
    assert any(note.kind == "converted" and "from 1/min" in note for note in data.notes)
    assert 80.0 < np.nanmax(np.abs(data.measured["speed"])) < 130.0


def test_grad_is_a_degree() -> None:
    data = read("grad_is_degree", "a.csv", GERMAN)
    assert data.measured["displacement"][1] == pytest.approx(np.deg2rad(0.0393))
    assert data.measured["velocity"][1] == pytest.approx(np.deg2rad(0.862))


def test_nothing_measured_is_told_with_a_way_that_works(tmp_path: Path) -> None:
    folder = STRANGERS / "no_measured"
    arguments = ["--dt", "0.0008", "--signal"]
    shown = CliRunner().invoke(
        signlin, ["check", str(folder / "model.yaml"), str(folder / "curr.csv"), *arguments, "force=1"]
    )
    assert "must stand in one file" in shown.output
    files = [str(folder / name) for name in ("curr.csv", "pos.csv")]
    with pytest.raises(RecordError, match=r"must stand in one file; .*paste -d, a.csv b.csv > both.csv"):
        CliRunner().invoke(
            signlin,
            ["compare", str(folder / "model.yaml"), *files, *arguments, "force=Joint_1"],
            catch_exceptions=False,
        )
    rows = zip(*(Path(file).read_text().splitlines() for file in files), strict=False)
    both = tmp_path / "both.csv"
    both.write_text("\n".join(map(",".join, rows)) + "\n")
    data = read_for_model(
        both, model_of("no_measured"), {"t": "0.0008", "force": "1", "displacement": "0.0174533 * #7"}
    )
    assert data.measured["displacement"][0] == pytest.approx(np.deg2rad(50.402), rel=1e-4)


# ------------------------------------------------------------------ checks


@pytest.mark.parametrize(
    ("folder", "files"),
    [("position_command_prbs", ("prbs.csv", "prbs2.csv")), ("position_command_ramp", ("ramp_a.csv", "ramp_b.csv"))],
)
def test_a_commanded_position_is_no_force(folder: str, files: tuple[str, ...]) -> None:
    every = found(folder, "position_command", *files)
    assert every
    assert all(f.open and "commanded position" in f.sentence and "servo" in f.sentence for f in every)
    with pytest.raises(RecordError, match="settles at the number of the force"):
        require_sound(every)


def test_an_effort_of_nothing_is_refused() -> None:
    for folder in ("effort_denormal", "effort_zero"):
        every = found(folder, "nothing_measured")
        assert [f.channel for f in every] == ["force", "force"]
        assert all(f.open and "the force is nothing" in f.sentence for f in every)


def test_a_current_of_nothing_is_left_out() -> None:
    records, findings = checked("current_denormal")
    assert all(set(record.measured) == {"speed"} for record in records)
    assert sum(f.check == "nothing_measured" and f.applied for f in findings) == 2


@pytest.mark.parametrize(
    ("folder", "channel", "counts"),
    [
        ("position_glitch", "displacement", (1, 1)),
        ("velocity_flickers", "speed", (14, 14)),
        ("velocity_spikes_at_turn", "speed", (79, 32)),
    ],
)
def test_wild_samples_are_left_out_before_anything_is_blamed(
    folder: str, channel: str, counts: tuple[int, int]
) -> None:
    records, findings = checked(folder)
    assert [int(np.isnan(record.measured[channel]).sum()) for record in records] == list(counts)
    assert not any(f.doubtful for f in findings)


def test_bursts_of_zeros_are_readings_that_failed() -> None:
    records, findings = checked("zeros_in_bursts")
    assert [f.applied for f in findings if f.check == "two_sources"] == [True, True]
    assert not any((record.measured["speed"] == 0.0).any() for record in records)


def test_a_unit_belongs_to_the_columns_of_a_log() -> None:
    offers = found("cure_one_record", "unit_or_sign")
    assert len({f.sentence for f in offers}) == 1
    assert len(offers) == 2
    records, _ = checked("cure_one_record", cures=("scale_force",))
    before = [read("cure_one_record", file) for file in ("a.csv", "b.csv")]
    factors = [float(b.u[5, 0] / r.u[5, 0]) for b, r in zip(before, records, strict=True)]
    assert factors[0] == pytest.approx(factors[1])
    assert 40.0 < factors[0] < 62.0
    with pytest.raises(InputError, match="scale_force"):
        checked("cure_one_record", cures=("force_in_Ncm",))


def test_the_noise_of_a_force_is_no_rounding() -> None:
    model, first, second = load_sides(
        model_of("noise_of_1e-12"), *([STRANGERS / "noise_of_1e-12" / file] for file in ("a.csv", "b.csv"))
    )
    rows = compare(model, first, validation=second).first_rows
    assert rows is not None
    assert rows.refitted.force_noise is not None
    assert rows.refitted.force_noise > 1e-3


# ------------------------------------------------------------------ verdicts


@pytest.mark.slow
@pytest.mark.parametrize(
    ("folder", "signals", "mu"),
    [
        ("position_glitch", None, 0.150),
        pytest.param("velocity_flickers", None, 0.010, marks=pytest.mark.long),
        pytest.param("velocity_spikes_at_turn", None, 0.010, marks=pytest.mark.long),
        pytest.param("zeros_in_bursts", None, 0.010, marks=pytest.mark.long),
        pytest.param("null_effect_confirmed", None, 0.010, marks=pytest.mark.long),
        pytest.param("lerobot_parquet", ARM, 0.010, marks=pytest.mark.long),
        ("grad_is_degree", GERMAN, 0.150),
    ],
)
def test_coulomb_friction_alone(folder: str, signals: dict[str, str] | None, mu: float) -> None:
    result = diagnosed(folder, signals)
    assert (result.verdict, named(result)) == ("missing", {"coulomb_friction"})
    assert result.parameters["coulomb_friction.mu"].value == pytest.approx(mu, rel=0.05)


@pytest.mark.long
def test_friction_that_falls_is_told_with_its_time() -> None:
    result = diagnosed("friction_falls")
    assert (result.verdict, named(result)) == ("unexplained", {"coulomb_friction"})
    assert "changes slowly along the record" in result.sentence


@pytest.mark.long
def test_a_supply_that_sags_warms_no_winding() -> None:
    result = diagnosed("thermal_of_20_ms")
    assert named(result) == {"coulomb_friction"}
    assert result.parameters["coulomb_friction.mu"].value == pytest.approx(0.010, rel=0.05)


@pytest.mark.long
def test_a_wave_that_no_sample_shows_is_no_part() -> None:
    result = diagnosed("parts_without_gain")
    assert result.verdict == "unexplained" or named(result) == {"coulomb_friction"}
    assert not named(result) & {"cogging_torque", "sensor_delay"}


@pytest.mark.long
def test_what_is_left_is_not_adequate(monkeypatch: pytest.MonkeyPatch) -> None:
    """The command of a position, taken as it is."""
    folder = STRANGERS / "position_command_prbs"
    model, first, second = load_sides(model_of("position_command_prbs"), [folder / "prbs.csv"], [folder / "prbs2.csv"])
    assert diagnose(model, first, second).verdict == "unexplained"
