"""Exported MJCF, run by MuJoCo: what it holds to two percent, what it loses, settings that would be silently wrong."""

import dataclasses
import re

import numpy as np
import pytest

from signlin_ros.export import export
from signlin_ros.export.excitation import standard_excitation
from signlin_ros.export.loss import reference
from signlin_ros.export.matrix import bench, models
from signlin_ros.export.mjcf import TARGET, parts_of
from signlin_ros.export.mjcf_run import run
from signlin_ros.model import Model

pytest.importorskip("mujoco")
HELD = [
    "(none)",
    "viscous_friction",
    "coulomb_friction",
    "stribeck_friction",
    "lugre_friction",
    "dahl_presliding",
    "cogging_torque",
    "torque_ripple",
    "gravity_load",
    "constant_load",
    "quadratic_drag",
    "cubic_viscous_friction",
    "linear_stiffness",
    "cubic_stiffness",
    "asymmetric_stiffness",
    "hard_stop",
    "compliant_load",
    "backlash",
    "input_delay",
    "input_saturation",
    "thermal_resistance",
]
LOST = ["load_dependent_friction", "input_deadzone", "asymmetric_viscous_friction", "play_friction"]


@pytest.fixture(scope="module")
def benches():
    return dict(models())


@pytest.mark.parametrize("effect", HELD)
def test_effect_is_held_to_two_percent_of_the_speed(benches, tmp_path, effect):
    found = export(benches[effect], "mjcf", tmp_path / "m.xml")
    assert not found.exported.lost
    assert found.loss.channels["speed"].percent < 2.0
    if effect != "(none)":
        assert any(line.startswith(effect) for line in found.exported.holds)


@pytest.mark.parametrize("effect", LOST)
def test_what_is_lost_is_said_and_measured(benches, tmp_path, effect):
    found = export(benches[effect], "mjcf", tmp_path / "m.xml")
    assert any(line.startswith(effect) for line in found.exported.lost)
    assert found.loss.channels["speed"].percent > 2.0


@pytest.mark.parametrize("plant", ["mass_spring_damper", "emps", "xl330"])
def test_plants_of_forces_are_held(tmp_path, plant):
    model = Model.load(plant)
    found = export(model, "mjcf", tmp_path / "m.xml")
    assert found.loss.channels[model.plant.velocity].percent < 2.0


def test_torque_constants_that_differ_are_one_with_a_scaled_control(tmp_path):
    model = bench().with_parameters(K_t=0.09, K_m=0.07)
    found = export(model, "mjcf", tmp_path / "m.xml")
    assert found.loss.channels["speed"].percent < 1.0
    assert found.loss.channels["current"].percent < 1.0
    assert "ctrl" in found.exported.settings


@pytest.fixture(scope="module")
def stiff():
    values = {"sigma0": 1000.0, "sigma1": 1.0, "sigma2": 0.001, "F_c": 0.033, "F_s": 0.05, "v_s": 0.5}
    return bench().with_effect("lugre_friction", **values)


def test_stiff_lugre_gets_a_setting_that_was_run(stiff, tmp_path):
    found = export(stiff, "mjcf", tmp_path / "m.xml")
    text = (tmp_path / "m.xml").read_text()
    chosen = found.exported.settings["integrator"]
    assert found.loss.channels["speed"].percent < 2.0
    assert f'integrator="{chosen}"' in text
    assert "keep this integrator" in text
    drive = standard_excitation(stiff)
    speed = reference(stiff, drive)["speed"]
    wrong = text.replace(f'integrator="{chosen}"', 'integrator="implicitfast"')
    off = run(wrong, parts_of(stiff, 1.0, 1.0), stiff, drive)["speed"]
    assert np.sqrt(np.mean((off - speed) ** 2) / np.mean(speed**2)) > 0.05  # without a warning, so the file gives one


def test_run_that_diverges_is_nan_and_no_warning_escapes(stiff, tmp_path):
    found = export(stiff, "mjcf", tmp_path / "m.xml")
    path = tmp_path / "long.xml"
    text = re.sub(r'timestep="[^"]+"', 'timestep="0.005"', (tmp_path / "m.xml").read_text())
    path.write_text(re.sub(r'integrator="\w+"', 'integrator="RK4"', text))
    drive = standard_excitation(stiff)
    broken = TARGET.run(dataclasses.replace(found.exported, files=(path,)), stiff, drive)["speed"]
    assert not np.isfinite(broken).all()


def test_own_law_is_lost_with_the_reason(tmp_path):
    (tmp_path / "grip.py").write_text(
        "from signlin_ros.effects import Effect\nfrom signlin_ros.par import Par\n"
        "class Grip(Effect):\n"
        '    """Grip."""\n'
        '    name = "grip_of_mine"\n    equation = "-a sign(v)"\n'
        '    a = Par("F", nominal=0.02, doc="grip")\n'
        "    def force(self, m, x, p):\n        return -p.a * m.sign(x.velocity)\n"
    )
    content = {
        **Model.load("dc_motor").to_dict(),
        "effect_files": ["grip.py"],
        "effects": {"grip_of_mine": {"a": 0.02}},
    }
    found = export(Model.from_dict(content, str(tmp_path / "m.yaml"), tmp_path), "mjcf", tmp_path / "m.xml")
    assert any("a law of your own" in line for line in found.exported.lost)


def test_file_says_units_sources_and_ranges(tmp_path):
    export(Model.load("dc_motor"), "mjcf", tmp_path / "m.xml")
    text = (tmp_path / "m.xml").read_text()
    assert "R_a = 0.764 Ohm, armature resistance" in text
    assert "R_a: 0.6876 to 0.8404" in text
