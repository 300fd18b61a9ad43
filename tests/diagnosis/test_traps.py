"""Traps that fool a naive diagnosis, each with a record that leads into it; simulated by code that is not ours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import yaml

from benchmarks.hidden.drives import CHANNELS, INPUT, MASS, MOTOR, Drive, excite
from benchmarks.hidden.generator import draw, simulate, write
from benchmarks.hidden.laws import STEP
from signlin_ros.diagnosis import add, diagnose
from signlin_ros.effects.bouc_wen_hysteresis import BoucWenHysteresis
from signlin_ros.errors import RecordError, SimulationError
from signlin_ros.fitting.problem import prepare
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate as our_simulation
from tests.diagnosis.test_hidden_effects import halved, records

SMALL = Drive(MOTOR, {"R_a": 0.764, "L_a": 0.0026, "K_t": 0.0805, "K_m": 0.0805, "B": 0.0, "J": 0.0022}, 5.0, 4.0)
STRONG = Drive(MOTOR, {"R_a": 0.38, "L_a": 0.0013, "K_t": 0.52, "K_m": 0.52, "B": 0.105, "J": 0.066}, 45.0, 3.0)
BENCH = Drive(MASS, {"m": 1.0, "c": 0.8, "k": 40.0}, 9.0, 6.3)
STAGE = Drive(MASS, {"m": 0.61, "c": 14.5, "k": 8500.0}, 25.0, 118.0)
AXIS = Drive(MASS, {"m": 95.0, "c": 200.0, "k": 0.0}, 80.0, 2.0)
FS = 200.0


def recorded(
    folder,
    drive,
    hidden,
    *,
    exc=("multisine", "steps"),
    level=0.01,
    off=1.03,
    skip=0,
    only=(),
    seed=0,
    seconds=8.0,
):
    """Write a model and two records, and read them as a user does. ``off``: true over nominal values, alternately."""
    rng = np.random.default_rng(seed)
    names = CHANNELS[drive.plant]
    for part, how in zip(("estimation", "validation"), exc, strict=True):
        t = np.arange(-skip, round(seconds * FS)) / FS
        u = excite(rng, how, drive, t)
        run = simulate(drive, hidden, u, np.zeros_like(u), 1 / FS, skip, STEP)
        assert run is not None
        shown = run.motion.shown
        shown = shown + rng.normal(size=shown.shape) * level * shown.std(axis=0)
        columns = {"t": t[skip:] - t[skip], INPUT[drive.plant]: run.motion.u}
        columns |= {n: shown[:, j] for j, n in enumerate(names) if not only or n in only}
        np.savetxt(
            folder / f"{part}.csv",
            np.column_stack(list(columns.values())),
            "%.8g",
            ",",
            header=",".join(columns),
            comments="",
        )
    nominal = {n: v / (off if i % 2 else 1 / off) for i, (n, v) in enumerate(drive.true.items())}
    if "K_m" in nominal:
        nominal["K_m"] = nominal["K_t"]
    content = {"plant": drive.plant, "parameters": {n: float(v) for n, v in nominal.items()}}
    (folder / "model.yaml").write_text(yaml.safe_dump({"/**": {"ros__parameters": content}}))
    return records(folder)


def proposed(found) -> set[str]:
    return set(found.ladder[-1].effects)


def status(found, effect: str) -> str:
    return next(e.status for e in found.ranking if e.effect == effect)


def test_a_loop_that_yields_early_is_not_called_a_spring_with_friction(tmp_path):
    loop = {"alpha": 0.026, "D": 0.52, "lambda": 1.0, "beta": 0.4, "gamma": 0.33, "n": 1.0, "k": 11.0}
    given = recorded(
        tmp_path,
        STRONG,
        {"bouc_wen_hysteresis": loop},
        exc=("sweep", "multisine"),
        only=("speed", "position"),
        level=0.02,
        seconds=5.0,
    )
    found = diagnose(*given)
    assert proposed(found) == {"bouc_wen_hysteresis"}
    assert found.ladder[-1].validation.over_noise < 1.03


def test_an_axis_with_coulomb_friction_gets_neither_stribeck_nor_presliding(tmp_path):
    found = diagnose(*recorded(tmp_path, AXIS, {"coulomb_friction": {"mu": 21.0}}, level=1e-3, only=("displacement",)))
    assert found.verdict == "missing"
    assert proposed(found) == {"coulomb_friction"}
    assert {status(found, e) for e in ("stribeck_friction", "dahl_presliding", "lugre_friction")} == {"rejected"}


@pytest.mark.long
def test_friction_that_differs_by_direction_is_coulomb_with_a_constant_load(tmp_path):
    hidden = {"coulomb_friction": {"mu": 0.04}, "constant_load": {"F0": 0.015}}
    found = diagnose(*recorded(tmp_path, SMALL, hidden, seconds=16.0))
    assert found.verdict == "missing"
    assert proposed(found) == set(hidden)


@pytest.mark.parametrize(
    ("drive", "hidden", "limits"),
    [
        (AXIS, {"linear_stiffness": {"k": 900.0}}, ("hard_stop", "cubic_stiffness")),
    ],
    ids=lambda v: next(iter(v)) if isinstance(v, dict) else None,
)
def test_what_contains_the_truth_as_its_limit_is_not_put_before_it(tmp_path, drive, hidden, limits):
    found = diagnose(*recorded(tmp_path, drive, hidden))
    assert found.verdict == "missing"
    assert proposed(found) == set(hidden)
    tied = {e.effect for e in found.ranking if e.status == "ambiguous"}
    assert all(status(found, e) != "confirmed" or e in tied for e in limits)


def lasting(data, colours: dict[str, float], seed: int, share=0.02):
    """Return records with noise of a colour of its own in every channel."""
    rng, made = np.random.default_rng(seed), []
    for d in data:
        shown = {}
        for name, y in d.measured.items():
            e = rng.normal(size=y.size)
            for k in range(1, e.size):
                e[k] = colours[name] * e[k - 1] + np.sqrt(1 - colours[name] ** 2) * e[k]
            shown[name] = y + share * y.std() * e
        made.append(replace(d, measured=shown))
    return made


COLOURS = [
    pytest.param(SMALL, {"current": 0.97, "speed": 0.3, "position": 0.6}, id="a current sensor's"),
    pytest.param(BENCH, {"displacement": 0.95, "velocity": 0.3}, id="a displacement's"),
]


@pytest.mark.parametrize(("drive", "colours"), COLOURS[1:])
def test_noise_that_lasts_in_one_channel_is_no_structure(tmp_path, drive, colours):
    model, data, unseen = recorded(tmp_path, drive, {}, level=1e-4)
    assert diagnose(model, lasting(data, colours, 1), lasting(unseen, colours, 2)).verdict == "adequate"


@pytest.mark.parametrize(("drive", "colours"), COLOURS[:1])
def test_an_effect_is_named_beside_noise_that_lasts(tmp_path, drive, colours):
    hidden = {"coulomb_friction": {"mu": 0.06}}
    model, data, unseen = recorded(tmp_path, drive, hidden, level=1e-4)
    found = diagnose(model, lasting(data, colours, 1), lasting(unseen, colours, 2))
    assert found.verdict == "missing"
    assert proposed(found) == {"coulomb_friction"}


def test_what_a_record_cannot_show_is_said(tmp_path):
    stop = {"hard_stop": {"gap": 5.0, "k_s": 500.0}}
    model, data, unseen = recorded(tmp_path, BENCH, stop, seconds=16.0)
    found = diagnose(model, data, unseen)
    assert found.verdict == "adequate"
    entry = next(e for e in found.ranking if e.effect == "hard_stop")
    assert entry.status == "not_excited"
    low, high = found.range["displacement"]
    assert f"{low:.3g} to {high:.3g} m" in entry.why
    assert any("hard stop" in line for line in found.experiments)


@pytest.mark.long
def test_of_what_is_outside_the_catalogue_a_part_may_be_named_and_the_rest_is_told(tmp_path):
    law = {"position_viscosity": {"b": 0.004, "N": 3.0, "phi": 0.5}}
    model, data, unseen = recorded(tmp_path, SMALL, law, seconds=16.0)
    found = diagnose(model, data, unseen)
    assert proposed(found) <= {"viscous_friction"}  # its mean over the way, which is really there
    assert "What is left is" in found.sentence
    assert all(status(found, effect) in ("confirmed", "ambiguous") for effect in proposed(found))
    assert set(found.model.effects) == proposed(found)


@pytest.mark.long
def test_a_wave_of_which_less_than_a_period_is_seen_is_no_cogging():
    """A spring with a quadratic term: a load and the trough of a long wave imitate it."""

    def shaken(seed: int) -> ModelData:
        rng, t, fine = np.random.default_rng(seed), np.arange(6000) * 1e-3, 20
        tones, phases = 2 * np.pi * np.linspace(5, 40, 30), rng.uniform(0, 6, 30)
        u, q, state, v = 0.5 * np.sin(tones * t[:, None] + phases).sum(axis=1), np.empty_like(t), 0.0, 0.0
        for k, force in enumerate(u):
            q[k] = state
            for _ in range(fine):
                v += (force - 3.2 * v - 5200.0 * state - 3.5e5 * state**2) / 0.35 * 1e-3 / fine
                state += v * 1e-3 / fine
        units = {"displacement": "m", "force": "N"}
        shown = {"displacement": q + rng.normal(0.0, 4e-6, q.size)}
        return ModelData(t, u[:, None], shown, None, ("force",), ("displacement",), units)

    model = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 0.344, "c": 3.23, "k": 5040.0}})
    found = diagnose(model, shaken(1), shaken(2))
    assert found.verdict == "unexplained"
    assert status(found, "cogging_torque") == "rejected"


@pytest.mark.long  # each channel alone: in other tests of this file
def test_every_choice_of_channels_works(tmp_path):
    for number, only in enumerate((("velocity",),)):
        folder = tmp_path / str(number)
        folder.mkdir()
        found = diagnose(*recorded(folder, AXIS, {}, only=only, skip=200, seconds=16.0))
        assert found.verdict == "adequate"


def noisy_input(data, share: float, seed: int = 0):
    """Add noise to the inputs of records, in shares of their deviation: the drive knows them no better."""
    rng = np.random.default_rng(seed)
    return [replace(d, u=d.u + share * d.u.std() * rng.normal(size=d.u.shape)) for d in data]


@pytest.mark.parametrize(
    ("drive", "channel", "seconds"),
    [(SMALL, "speed", 8.0), pytest.param(AXIS, "displacement", 16.0, marks=pytest.mark.long)],
    ids=["motor", "axis"],
)
def test_noise_in_the_input_is_no_effect(tmp_path, drive, channel, seconds):
    model, data, unseen = recorded(tmp_path, drive, {}, only=(channel,), level=1e-3, seconds=seconds)
    found = diagnose(model, noisy_input(data, 0.1, 1), noisy_input(unseen, 0.1, 2))
    assert found.verdict == "adequate"


def weaker_one_way(part, gain):
    return [replace(data, u=np.where(data.u < 0, data.u / gain, data.u)) for data in part]


def test_an_amplifier_that_is_weaker_one_way_is_no_load(tmp_path):
    model, *parts = recorded(tmp_path, STAGE, {}, only=("displacement",), level=0.01, seconds=5.0)
    assert diagnose(model, *(weaker_one_way(part, 0.85) for part in parts)).verdict == "unexplained"


def test_weak_cogging_is_named(tmp_path):
    """Weak cogging acts now and then only, so that few blocks of the record show what it explains."""
    record = draw("weak", 6, 26)
    assert record.truth["hidden"] == ["cogging_torque"]
    found = diagnose(*halved(*records(write(record, tmp_path / "record"))))
    assert found.verdict == "missing"
    assert proposed(found) == {"cogging_torque"}


def test_an_effect_is_named_where_the_input_is_noisy_too(tmp_path):
    """Unexplained: the motion gathers the noise of the force."""
    hidden = {"coulomb_friction": {"mu": 20.0}}
    model, data, unseen = recorded(tmp_path, AXIS, hidden, only=("displacement",), level=1e-5, seconds=3.0)
    found = diagnose(model, noisy_input(data, 0.02, 1), noisy_input(unseen, 0.02, 2))
    assert found.verdict == "missing"
    assert proposed(found) == {"coulomb_friction"}


def test_a_late_input_and_a_late_sensor_are_the_same_in_a_single_channel(tmp_path):
    found = diagnose(*recorded(tmp_path, BENCH, {"input_delay": {"T": 0.013}}, only=("displacement",)))
    assert found.verdict == "missing"
    assert status(found, "input_delay") == status(found, "sensor_delay") == "ambiguous"


def test_what_is_added_though_nothing_is_missing_is_not_confirmed(tmp_path):
    model, data, unseen = recorded(tmp_path, SMALL, {})
    found = add("coulomb_friction", model, data, unseen)
    assert found.verdict == "adequate"
    assert status(found, "coulomb_friction") == "rejected"
    assert proposed(found) == {"coulomb_friction"}


def test_a_drive_that_does_not_move_is_no_fault_of_the_diagnosis(tmp_path):
    model, data, unseen = recorded(tmp_path, SMALL, {}, only=("speed",))
    still = [replace(d, measured={n: np.zeros_like(v) for n, v in d.measured.items()}) for d in data]
    with pytest.raises(RecordError, match="moves: nothing can be told"):
        diagnose(model, still, unseen)


def test_a_loop_without_a_shape_of_its_own_is_dahls():
    loop = {"alpha": 0.0, "D": 2.0, "lambda": 1.0, "beta": 0.5, "gamma": 0.01, "n": 1.0, "k": 5.0}
    assert BoucWenHysteresis.simpler(loop) == {"dahl_presliding": {"F_c": 20.0, "sigma": 5.0}}
    for shape in ({"gamma": 0.3}, {"n": 2.0}, {"alpha": 0.4}):
        assert BoucWenHysteresis.simpler(loop | shape) == {}


def test_a_loop_without_width_is_a_spring_that_hardens_or_softens():
    tangent = {"alpha": 0.0, "D": 2.0, "lambda": 1.0, "beta": 0.01, "gamma": -4.0, "n": 2.0, "k": 5.0}
    assert not BoucWenHysteresis.plausible(tangent)
    stops, cubic = BoucWenHysteresis.parts(tangent)
    assert stops["linear_stiffness"] == cubic["linear_stiffness"] == {"k": 5.0}
    assert stops["hard_stop"]["gap"] == pytest.approx(2.0 * np.pi / 2 / 2.0, rel=0.01)  # h = tan(q) / 2 runs off there
    assert set(cubic) == {"linear_stiffness", "cubic_stiffness"}
    for gamma, plausible_one in ((-0.09, True), (0.09, True), (4.0, False)):  # the last softens: atan for n = 2
        assert BoucWenHysteresis.plausible(tangent | {"gamma": gamma}) is plausible_one
        assert BoucWenHysteresis.parts(tangent | {"gamma": gamma}) == []


@pytest.mark.parametrize("seeds", [(1, 2), pytest.param((3, 4), marks=pytest.mark.long)])
def test_a_spring_with_stops_is_no_loop(seeds):
    """A flap with a return spring that runs onto its stop: a loop without width fits it to 1.7 times the noise, and a
    stop alone leaves what noise of its voltage would, which acts.
    """

    def flapped(seed: int) -> ModelData:
        rng, t, h = np.random.default_rng(seed), np.arange(1200) * 0.005, 2.5e-4
        level = np.repeat(rng.uniform(0.0, 7.0, 20), 60)
        u, q, x, w = level + 0.2 * rng.normal(size=t.size), np.empty_like(t), 0.0, 0.0
        for k, voltage in enumerate(u):
            q[k] = x
            for _ in range(20):
                torque = 0.28 * (voltage - 0.28 * w) / 3.8 - 0.01 * w - 0.04 * x - 0.2 * max(x - 1.1, 0.0)
                w += torque / 0.0012 * h
                x += w * h
        shown = {"position": q + rng.normal(0.0, 0.004, t.size)}
        return ModelData(t, u[:, None], shown, None, ("voltage",), ("position",), {"voltage": "V", "position": "rad"})

    values = {"R_a": 3.7, "L_a": 0.0, "K_t": 0.272, "K_m": 0.275, "B": 0.0103, "J": 0.00116}
    model = Model.from_dict({"plant": "dc_motor", "parameters": values, "with_position": True})
    found = diagnose(model, *map(flapped, seeds))
    assert found.verdict == "missing"
    assert proposed(found) == {"linear_stiffness", "hard_stop"}
    assert found.parameters["hard_stop.gap"].value == pytest.approx(1.1, rel=0.02)
    assert any("the voltage is taken to act as recorded" in note for note in found.notes)


def test_a_stop_that_a_record_never_leaves_is_a_spring_and_a_load():
    """Strokes of a cable drive between 3.2 and 3.4 rad: "a hard stop at 2.86 rad", where it had not been."""
    model = Model.from_dict({"plant": "force_element", "parameters": {"c": 0.2, "k": 0.0}, "tolerance": 0.8})
    rng, parts = np.random.default_rng(3), []
    for phase in (0.0, 1.0):
        t = np.arange(600) / 200
        q = 3.3 + 0.1 * np.sin(5.0 * t + phase)
        v = 0.5 * np.cos(5.0 * t + phase)
        force = 0.15 * v + 0.22 * (q - 2.86) + 1e-3 * rng.standard_normal(t.size)
        inputs = {"displacement": q, "velocity": v}
        u = np.column_stack([inputs[n] for n in model.inputs])
        measured = {"force": force} | {n: x for n, x in inputs.items() if n not in model.inputs}
        parts.append(ModelData(t, u, measured, None, model.inputs, model.states, model.units))
    found = diagnose(model, parts[:1], parts[1:], jobs=1)
    assert found.verdict == "missing"
    assert proposed(found) == {"linear_stiffness", "constant_load"}
    ties = {e.effect: e.indistinguishable_from for e in found.ranking if e.effect in proposed(found)}
    assert ties == {"linear_stiffness": (), "constant_load": ("sensor_offset",)}  # of the force that is measured


def swung(level: float, hold: float, seed: int) -> tuple[Model, ModelData]:
    """Return a model with Coulomb friction of a weight that is swung, and a record: friction of another ``level``, and
    more, ``hold``, at rest.
    """
    rng, t, h = np.random.default_rng(seed), np.arange(3000) * 0.005, 5e-4
    u = 0.25 * np.sin(2 * np.pi * rng.uniform(0.1, 0.5, 3) * t[:, None] + rng.uniform(0, 6, 3)).sum(axis=1)
    q, x, w = np.empty_like(t), 0.0, 0.0
    for k, torque in enumerate(u):
        q[k] = x
        for _ in range(10):
            dry, free = level + hold * np.exp(-((w / 0.1) ** 2)), torque - 0.03 * w - 0.3 * np.sin(x)
            after = w + (free - dry * np.sign(w if w else free)) / 0.006 * h
            w = after if w * after > 0 or (w == 0 and abs(free) > dry) else 0.0
            x += w * h
    units = {"force": "N·m", "displacement": "rad"}
    shown = {"displacement": q + rng.normal(0.0, 1e-3, t.size)}
    effects = {"coulomb_friction": {"mu": 0.01}, "gravity_load": {"A": 0.3, "q0": 0.0}}
    model = Model.from_dict(
        {"plant": "mass_spring_damper", "parameters": {"m": 0.006, "c": 0.03, "k": 0.0}, "effects": effects}
    )
    return model, ModelData(t, u[:, None], shown, None, ("force",), ("displacement",), units)


@pytest.mark.long
def test_friction_that_holds_at_rest_is_no_fine_cogging():
    """A wave of any fine order has a valley wherever the weight is held."""
    model, known = swung(0.02, 0.1, 1)
    found = diagnose(model, known, swung(0.02, 0.1, 2)[1])
    assert "cogging_torque" not in proposed(found)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_samples_that_are_too_far_apart_are_told(tmp_path):
    model, data, unseen = recorded(tmp_path, SMALL, {})
    slow = [[replace(d, t=2000 * d.t) for d in part] for part in (data, unseen)]
    with pytest.raises(SimulationError, match="the samples are 10 s apart"):
        diagnose(model, *slow)


def test_what_shows_only_on_unseen_data_is_not_called_adequate(tmp_path):
    (tmp_path / "loaded").mkdir()
    model, data, _ = recorded(tmp_path, SMALL, {}, level=0.02)
    _, _, loaded = recorded(tmp_path / "loaded", SMALL, {"coulomb_friction": {"mu": 0.06}}, level=0.02)
    found = diagnose(model, data, loaded)
    assert found.verdict != "adequate"


def test_viscous_and_coulomb_friction_are_found_together(tmp_path):
    mu, b = 15.0, 200.0
    hidden = {"coulomb_friction": {"mu": mu}, "viscous_friction": {"b": b}}
    found = diagnose(*recorded(tmp_path, AXIS, hidden, only=("velocity",), seconds=5.0))
    assert proposed(found) == set(hidden)
    assert found.parameters["coulomb_friction.mu"].value == pytest.approx(mu, rel=0.05)
    assert found.parameters["viscous_friction.b"].value == pytest.approx(b, rel=0.1)


def test_the_driving_torque_of_a_motor_without_inductance():
    model = Model.from_dict({"plant": "dc_motor", "parameters": {**SMALL.true, "L_a": 0.0}})
    t = np.arange(2000) * 0.005
    u = 4.0 * np.sin(3.0 * t)[:, None]
    speed = our_simulation(model, t, u)["speed"]
    data = ModelData(t, u, {"speed": speed}, None, ("voltage",), ("speed",), {"speed": "rad/s", "voltage": "V"})
    K_t, K_m, R_a = (model.parameters[n] for n in ("K_t", "K_m", "R_a"))
    torque = K_t * (u[:, 0] - K_m * speed) / R_a
    assert prepare(model, [data]).scale.force == pytest.approx(float(np.sqrt(np.mean(torque**2))), rel=0.1)


def test_a_spring_beside_one_that_bends_is_a_spring(tmp_path):
    """A known spring half as stiff again is the same model: which of the two is worse on validation data is chance."""
    hidden = {"linear_stiffness": {"k": 22.0}}
    found = diagnose(*recorded(tmp_path, BENCH, hidden, exc=("slow", "steps"), level=0.02))
    assert found.verdict == "missing"
    assert proposed(found) == {"linear_stiffness"}
