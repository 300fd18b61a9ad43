"""`compare`: the scores mean what the contract says, on records with every fault that records have."""

from __future__ import annotations

import json
import os
import re
import sys
from dataclasses import replace
from importlib import resources
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from numpy.testing import assert_allclose

from signlin_ros import cli
from signlin_ros.comparison.equations import force_equations, mass
from signlin_ros.comparison.scores import score
from signlin_ros.console import compare_text
from signlin_ros.diagnosis.compared import Comparison
from signlin_ros.diagnosis.comparison import compare
from signlin_ros.errors import InputError, RecordError
from signlin_ros.follow.data import load_records
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

pytestmark = pytest.mark.slow

DATA = Path(os.environ.get("SIGNLIN_DATA", "../shared/data"))
real = pytest.mark.skipif(not DATA.is_dir(), reason=f"no measurement records at {DATA} (set SIGNLIN_DATA)")
T = np.arange(2000) / 200
HELD = {"input_hold": "forward"}  # inputs are simulated so; what asks the record for it is tested in tests/diagnosis
MOTOR = Model.load("dc_motor").with_options(**HELD)
BARE = MOTOR.without_effect("coulomb_friction")


def multisine(t, size=4.0, seed=0, fastest=3.0):
    rng = np.random.default_rng(seed)
    waves = [np.sin(2 * np.pi * f * t + rng.uniform(0, 6.28)) for f in rng.uniform(0.1, fastest, 10)]
    return size / 3 * np.sum(waves, axis=0)[:, None]


def recorded(model, t=T, u=None, noise=0.01, seed=0, channels=None, x0=None):
    """A simulated record with white noise of a share of each channel's deviation, as the sensors show it."""
    rng = np.random.default_rng(seed)
    u = multisine(t) if u is None else u
    run = simulate(model, t, u, x0)
    measured = {}
    for name in channels or dict.fromkeys((*model.states, *model.outputs)):
        sensor = model.sensors[name]
        shown = sensor.show(np.interp(t - sensor.delay, t, run[name]))
        measured[name] = shown + noise * shown.std() * rng.standard_normal(t.size)
    return ModelData(t, u, measured, None, model.inputs, model.states, model.units)


def as_good_as_the_noise(comparison: Comparison) -> bool:
    channels = comparison.channels.values()
    return all(0.9 < s.rmse_over_noise < 1.1 for c in channels for s in (c.free_run, c.windowed))


def schema():
    return json.loads((resources.files("signlin_ros") / "schemas" / "compare.json").read_text(encoding="utf-8"))


# -------------------------------------------------------------------- scores


def test_a_score_is_what_the_contract_says():
    y, p = np.array([1.0, 2.0, np.nan, 4.0, 6.0]), np.array([1.5, 2.0, 3.0, 4.0, np.nan])
    found = score(y, p, noise=0.1)
    left, right = y[[0, 1, 3]], p[[0, 1, 3]]
    assert found.rmse == pytest.approx(np.sqrt(np.mean((left - right) ** 2)))
    want = 100 * (1 - np.linalg.norm(left - right) / np.linalg.norm(left - left.mean()))
    assert found.fit_percent == pytest.approx(want)
    assert found.rmse_over_noise == pytest.approx(found.rmse / 0.1)


def test_a_score_of_nothing_or_of_a_constant():
    assert score(np.full(3, np.nan), np.zeros(3)) is None
    found = score(np.ones(3), np.zeros(3))
    assert (found.rmse, found.fit_percent, found.rmse_over_noise) == (1.0, None, None)


def test_the_true_model_is_as_good_as_the_noise():
    c = compare(MOTOR, recorded(MOTOR))
    assert as_good_as_the_noise(c)
    assert c.where == ()
    assert not any(m.clear for m in c.missing)
    assert all(t.white and not t.input_correlated for t in c.residual_tests.values())
    assert c.inverse["torque"].relative_error_percent < 3


def test_a_model_without_friction_is_not():
    c = compare(BARE, recorded(MOTOR))
    for channel in c.channels.values():
        assert channel.free_run.rmse_over_noise > 5
        assert 2 < channel.windowed.rmse_over_noise < channel.free_run.rmse_over_noise
    assert all(not t.white and t.input_correlated for t in c.residual_tests.values())
    (torque,) = (m for m in c.missing if m.clear)
    assert (torque.name, torque.unit) == ("torque", "N·m")
    sides = c.directions["torque"]
    assert sides["forward"]["mean"] == pytest.approx(-0.033, rel=0.05)
    assert sides["backward"]["mean"] == pytest.approx(+0.033, rel=0.05)
    assert c.inverse["torque"].relative_error_percent == pytest.approx(100 * 0.033 / 0.27, rel=0.15)


@pytest.mark.parametrize("channels", [["current"], ["speed"], ["position"], ["speed", "position"]])
def test_any_subset_of_the_channels_will_do(channels):
    true, bare = (m.with_options(with_position="position" in channels) for m in (MOTOR, BARE))
    data = recorded(true, channels=channels)
    c = compare(true, data)
    assert list(c.channels) == channels
    assert as_good_as_the_noise(c)
    assert compare(bare, data).channels[channels[0]].windowed.rmse > 1.3 * c.channels[channels[0]].windowed.rmse


def test_the_horizon_decides_how_far_ahead_is_predicted():
    data = recorded(MOTOR)
    errors = [compare(BARE, data, horizon=h).channels["speed"].windowed.rmse for h in (0.01, 0.05, 0.2, 1.0)]
    assert errors == sorted(errors)
    assert compare(BARE, data).horizon == BARE.update_period


def test_windows_start_from_the_past_alone():
    """A jump of the speed at the start of a window is not foreseen, however large."""
    data = recorded(MOTOR)
    spoilt = {**data.measured, "speed": data.measured["speed"].copy()}
    spoilt["speed"][1000:] += 100.0
    a, b = (compare(MOTOR, replace(data, measured=m)).traces[0].windowed[:1000] for m in (data.measured, spoilt))
    assert np.nanmax(np.abs(a - b)) < 1.0


# -------------------------------------------------------------------- initial state


def test_the_initial_state_is_estimated():
    data = recorded(MOTOR, x0=[1.0, -15.0], noise=0.05)
    c = compare(MOTOR, data)
    assert as_good_as_the_noise(c)
    late = recorded(MOTOR.with_options(with_position=True), x0=[0.5, 12.0, 3.0], channels=["position"])
    assert as_good_as_the_noise(compare(MOTOR.with_options(with_position=True), late))


@pytest.mark.parametrize("seed", range(3))
def test_a_free_run_is_never_worse_than_from_the_first_sample(seed):
    data = recorded(MOTOR, noise=0.1, seed=seed, x0=[0.0, 10.0])
    run = simulate(BARE, data.t, data.u, [data.measured[n][0] for n in BARE.states])
    naive = sum(np.mean((data.measured[n] - run[n]) ** 2) / np.var(data.measured[n]) for n in BARE.states)
    c = compare(BARE, data)
    ours = sum(s.free_run.rmse**2 / np.var(data.measured[n]) for n, s in c.channels.items())
    assert ours <= naive * (1 + 1e-9)


def test_a_free_run_that_diverges_is_said_and_is_no_number():
    model = Model.load("bouc_wen")
    t = np.arange(2000) / 100
    data = recorded(model, t, multisine(t, 1.5, fastest=1.0))  # the record itself stays finite
    c = compare(model.with_parameters(gamma=-30.0, n=3.0), data)
    assert all(channel.free_run is None for channel in c.channels.values())
    assert any(re.search(r"no free run.* t = \d", note) for note in c.notes)
    json.dumps(c.to_json(), allow_nan=False)


# -------------------------------------------------------------------- faults of records


def test_missing_samples_are_skipped():
    data = recorded(MOTOR)
    holes = {name: values.copy() for name, values in data.measured.items()}
    holes["speed"][::7], holes["speed"][:5], holes["current"][300:420] = np.nan, np.nan, np.nan
    c = compare(MOTOR, replace(data, measured=holes))
    assert as_good_as_the_noise(c)
    assert c.inverse["torque"].relative_error_percent < 3


def test_a_gap_starts_every_run_anew():
    data = recorded(MOTOR)
    kept = np.r_[0:700, 900:2000]
    cut = {name: values[kept] for name, values in data.measured.items()}
    c = compare(MOTOR, replace(data, t=data.t[kept], u=data.u[kept], measured=cut))
    assert len(c.traces) == 2
    assert as_good_as_the_noise(c)
    assert any("gap" in note for note in c.notes)


def test_uneven_sampling():
    t = np.cumsum(np.random.default_rng(3).uniform(0.003, 0.007, 2000))
    c = compare(MOTOR, recorded(MOTOR, t))
    assert as_good_as_the_noise(c)
    assert any("unevenly sampled" in note for note in c.notes)
    assert c.inverse["torque"].relative_error_percent < 3


def test_several_records():
    data = [recorded(MOTOR), recorded(MOTOR, u=multisine(T, 3.0, seed=5), x0=[0.0, 5.0], noise=0.012)]
    c = compare(MOTOR, data)
    assert (len(c.traces), c.samples) == (2, 4000)
    assert all(0.8 < s.free_run.rmse_over_noise < 1.2 for s in c.channels.values())


def test_short_records():
    data = recorded(MOTOR)
    c = compare(MOTOR, data.part(0, 60))
    assert c.channels["speed"].windowed is None
    assert any("shorter than two windows" in note for note in c.notes)
    with pytest.raises(RecordError, match="fewer than 20 samples"):
        compare(MOTOR, data.part(0, 10))


def test_a_machine_at_rest():
    c = compare(MOTOR, recorded(MOTOR, u=np.zeros((T.size, 1)), noise=0.0))
    assert c.channels["speed"].free_run.fit_percent is None
    jsonschema.validate(json.loads(json.dumps(c.to_json(), allow_nan=False)), schema())


def test_nothing_measured_is_refused():
    with pytest.raises(RecordError, match="none of current, speed is measured"):
        compare(MOTOR, replace(recorded(MOTOR), measured={}))
    with pytest.raises(RecordError, match="at least one record"):
        compare(MOTOR, [])


@pytest.mark.parametrize("horizon", [0.0, -1.0, 0.005, np.nan, np.inf])
def test_a_horizon_that_makes_no_sense_is_refused(horizon):
    with pytest.raises(InputError, match="horizon"):
        compare(MOTOR, recorded(MOTOR), horizon=horizon)


# -------------------------------------------------------------------- models


def test_sensors_and_delays_of_the_model_count():
    for true in (
        MOTOR.with_effect("sensor_offset", speed=1.5).with_effect("sensor_gain", current=1.1),
        MOTOR.with_effect("sensor_delay", speed=0.02),
        MOTOR.with_effect("input_delay", T=0.0123),
    ):
        data = recorded(true)
        assert as_good_as_the_noise(compare(true, data))
        assert compare(MOTOR, data).channels["speed"].windowed.rmse_over_noise > 3


@pytest.mark.parametrize("effect", ["dahl_presliding", "compliant_load", "bouc_wen_hysteresis"])
def test_effects_with_states_that_nobody_measures(effect):
    plain = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.6, "k": 40.0}, **HELD})
    values = {"dahl_presliding": {"F_c": 1.0, "sigma": 300.0}, "compliant_load": {"k": 300.0, "c": 0.1, "J": 0.3}}
    true = plain.with_effect(effect, **values.get(effect, {}))
    data = recorded(true, u=multisine(T, 5.0), channels=["displacement", "velocity"])
    assert as_good_as_the_noise(compare(true, data))
    assert compare(plain, data).channels["velocity"].windowed.rmse_over_noise > 1.5


def test_a_motor_without_inductance_and_one_with_a_second_input():
    quick = Model.from_dict({**MOTOR.to_dict(), "parameters": {**MOTOR.parameters, "L_a": 0.0}})
    assert as_good_as_the_noise(compare(quick, recorded(quick)))
    loaded = MOTOR.with_options(with_load_torque=True)
    u = np.column_stack([multisine(T)[:, 0], 0.01 * np.sin(T)])
    assert as_good_as_the_noise(compare(loaded, recorded(loaded, u=u)))


def test_a_force_element():
    model = Model.load("force_element")
    c = compare(model, recorded(model, u=multisine(T, 0.1), channels=["force"]))
    assert as_good_as_the_noise(c)
    assert c.inverse["force"].relative_error_percent < 1
    stronger = model.with_parameters({"coulomb_friction.mu": 70.0})
    sides = compare(stronger, recorded(model, u=multisine(T, 0.1), channels=["force"])).directions["force"]
    assert_allclose([sides["forward"]["mean"], sides["backward"]["mean"]], [-20.0, 20.0], rtol=0.05)


# -------------------------------------------------------------------- first rows


def test_the_noise_of_a_channel_is_that_of_its_sensor_whatever_the_model():
    data = recorded(MOTOR)
    right, wrong = (compare(model, data) for model in (MOTOR, BARE))
    for name, channel in right.channels.items():
        assert channel.sigma == wrong.channels[name].sigma > 0
        assert channel.to_json()["noise"] == channel.sigma
        assert channel.windowed.rmse == pytest.approx(channel.sigma, rel=0.15)


def test_first_rows_are_of_the_data_that_the_fit_did_not_see():
    data, other = recorded(MOTOR), recorded(MOTOR, noise=0.02)
    rows, own = (compare(BARE, data, validation=v).first_rows for v in (other, None))
    assert rows.horizon == own.horizon == BARE.update_period
    assert rows.given.estimation.channels["speed"].rmse != own.given.estimation.channels["speed"].rmse
    for found in (rows, own):
        assert found.refitted.estimation.channels["speed"].rmse < found.given.estimation.channels["speed"].rmse
        assert found.refitted.force < 1.01 * found.given.force
        assert found.refitted.force_over_noise == found.refitted.force / found.refitted.force_noise


# -------------------------------------------------------------------- output


def test_json_keeps_its_schema_and_the_text_says_it():
    c = compare(BARE, recorded(MOTOR))
    content = json.loads(json.dumps(c.to_json(), allow_nan=False))
    jsonschema.validate(content, schema(), cls=jsonschema.Draft202012Validator)
    text = compare_text(content)
    for word in ("rad/s", "free run", "next 0.2 s", "torque computed from the motion", "missing from the equations"):
        assert word in text
    assert "<pre>" in c._repr_html_()


@pytest.fixture
def files(tmp_path):
    data = recorded(MOTOR.with_options(with_position=True))
    columns = [data.t, data.u[:, 0], *data.measured.values()]
    for name in ("a.csv", "b.csv"):
        head = "t,voltage,current,speed,position"
        np.savetxt(tmp_path / name, np.column_stack(columns), delimiter=",", header=head, comments="", fmt="%.7g")
    BARE.save(tmp_path / "m.yaml")
    return tmp_path


def test_the_command_prints_one_object_or_a_table(files, capsys):
    assert cli.main(["compare", str(files / "m.yaml"), str(files / "a.csv"), "--horizon", "0.1", "--json"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    content = json.loads(out)
    jsonschema.validate(content, schema(), cls=jsonschema.Draft202012Validator)
    assert list(content["channels"]) == ["current", "speed", "position"]
    assert content["horizon"] == 0.1
    assert cli.main(["compare", str(files / "m.yaml"), str(files / "a.csv"), str(files / "b.csv")]) == 0
    assert "2 records, 4000 samples" in capsys.readouterr().out


def test_help_explains_and_a_report_without_the_extra_that_draws_names_it(files, capsys, monkeypatch):
    assert cli.main(["compare", "--help"]) == 0
    assert "signlin compare" in capsys.readouterr().out.split("Examples:")[1]
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert cli.main(["compare", str(files / "m.yaml"), str(files / "a.csv"), "--report", str(files / "r.html")]) == 2
    assert "signlin_ros[plot]" in capsys.readouterr().err
    assert not (files / "r.html").exists()


@pytest.mark.parametrize(
    ("extra", "word"),
    [
        (["--horizon", "0.001"], "horizon"),
        (["--horizon", "soon"], "--horizon"),
        (["--cutoff", "200"], "half the sampling rate"),
        (["--signal", "voltage=u"], "'u'"),
        (["nowhere.csv"], "nowhere.csv"),
    ],
)
def test_bad_input_is_exit_code_2_and_one_line(files, capsys, extra, word):
    assert cli.main(["compare", str(files / "m.yaml"), str(files / "a.csv"), *extra]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert word in err


# -------------------------------------------------------------------- real records


@real
def test_emps_is_fast_and_its_free_run_drifts():
    model, data = load_records(Model.load("emps").with_options(**HELD), [str(DATA / "emps/DATA_EMPS.csv")])
    c = compare(model, data)
    channel = c.channels["displacement"]
    assert channel.free_run.rmse < 0.01
    assert channel.windowed.rmse < 3e-4
    assert c.directions["force"]["forward"]["mean"] == pytest.approx(0, abs=1.5)
    bare = model.without_effect("coulomb_friction").without_effect("constant_load")
    sides = compare(bare, data).directions["force"]
    assert (sides["backward"]["mean"] - sides["forward"]["mean"]) / 2 == pytest.approx(20.39, rel=0.05)
    assert (sides["backward"]["mean"] + sides["forward"]["mean"]) / 2 == pytest.approx(3.165, rel=0.15)


@real
def test_xl330_is_rotary():
    files = [str(DATA / f"xl330/xl330_{n}.csv") for n in ("kp100_sin_sin", "kp400_lift_and_drop")]
    model, data = load_records(Model.load("xl330").with_options(**HELD), files)
    c = compare(model, data)
    assert c.channels["displacement"].unit == "rad"
    assert c.inverse["force"].unit == "N·m"
    assert c.missing[0].unit == "N·m"
    assert c.channels["displacement"].noise.quantum == pytest.approx(2 * np.pi / 4096, rel=0.01)


@pytest.mark.parametrize("name", ["mass_spring_damper", "bouc_wen", "dc_motor", "force_element"])
@pytest.mark.parametrize("loaded", [False, True])
def test_a_force_moves_the_mass_that_the_recorded_equation_has(name, loaded):
    """A force of 1 changes what it acts on by 1 over the mass, with load-dependent friction too."""
    model = Model.load(name)
    if loaded and "load_dependent_friction" not in model.effects and not model.plant.motion_is_imposed():
        model = model.with_effect("load_dependent_friction", kappa_d=0.1, kappa_e=0.2)
    zero, one = (model.with_effect("constant_load", key="probe", F0=F0) for F0 in (0.0, 1.0))
    still = np.zeros((1, len(model.states))), np.zeros((1, len(model.inputs)))
    rates = [
        force_equations(m.structure).rate.outputs.batch(
            [*still[0].T, *still[1].T, *m.p, *([0.0] * len(m.trace.surfaces))]
        )[0][0]
        for m in (zero, one)
    ]
    assert rates[1] - rates[0] == pytest.approx(1.0 / mass(model))
