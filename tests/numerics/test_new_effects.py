"""What the laws of the catalogue say, in simulations: play, ripple, pinching, temperature, a learned curve."""

import numpy as np
import pytest

from signlin_ros.model import Model
from signlin_ros.simulation import simulate

ELEMENT = Model.from_dict({"plant": "force_element", "parameters": {"c": 0.0, "k": 0.0}})


def moved(model, velocity, t, *more):
    """The force that an imposed velocity (T,) takes."""
    return simulate(model, t, np.column_stack([velocity, *more]))["force"]


@pytest.mark.parametrize("gap", [0.0, 0.05])
def test_after_a_reversal_a_play_takes_no_force_over_twice_its_gap(gap):
    F_c, sigma = 3.0, 200.0
    model = ELEMENT.with_effect("play_friction", F_c=F_c, sigma=sigma, gap=gap)
    t = np.arange(0.0, 4.0, 1e-3)
    velocity = np.where(t < 2.0, 0.2, -0.2)
    force, way = moved(model, velocity, t), 0.2 * (t - 2.0)  # way since the reversal
    assert force[t < 2.0][-1] == pytest.approx(F_c, rel=1e-3)
    bend = F_c / sigma
    unbent = bend * np.log(2.0)  # dz' = v (1 + dz / bend), from bend to 0
    free = (t > 2.0) & (way > unbent + 1e-3) & (way < unbent + 2 * gap - 1e-3)
    assert np.all(np.abs(force[free]) < 1e-6 * F_c)
    assert free.any() == (gap > 0)
    taken = (t > 2.0) & (way > 20 * bend + 2 * gap)
    np.testing.assert_allclose(force[taken], -F_c, rtol=1e-3)


def test_a_play_without_a_gap_is_dahls_friction():
    t = np.arange(0.0, 6.0, 1e-3)
    velocity = 0.1 * np.sin(2.0 * t) + 0.05 * np.sin(7.0 * t)
    play = ELEMENT.with_effect("play_friction", F_c=3.0, sigma=200.0, gap=0.0)
    dahl = ELEMENT.with_effect("dahl_presliding", F_c=3.0, sigma=200.0)
    np.testing.assert_allclose(moved(play, velocity, t), moved(dahl, velocity, t), atol=1e-3)


def test_pinched_loops_are_narrow_in_the_middle_and_as_high_at_the_ends():
    t = np.arange(0.0, 4 * np.pi, 2e-3)
    values = {"F_c": 3.0, "sigma": 60.0}
    dahl = ELEMENT.with_effect("dahl_presliding", **values)
    pinched = ELEMENT.with_effect("pinching_hysteresis", **values, zeta=0.95, z_p=0.02)
    plain, slipping = (moved(model, 0.3 * np.cos(t), t) for model in (dahl, pinched))
    assert slipping.max() == pytest.approx(plain.max(), rel=0.02)
    second = slice(t.size // 2, None)
    work = [np.trapezoid(force[second] * 0.3 * np.cos(t[second]), t[second]) for force in (plain, slipping)]
    assert 0 < work[1] < 0.95 * work[0]  # it takes energy, but less


def test_a_ripple_is_the_sum_of_its_waves():
    model = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.5, "k": 0.0}})
    both = model.with_effect("torque_ripple", orders=[3.0, 7.0], A=[0.4, 0.2], phi=[0.3, 1.0])
    apart = model.with_effect("cogging_torque", "one", A=0.4, N=3.0, phi=0.3)
    apart = apart.with_effect("cogging_torque", "two", A=0.2, N=7.0, phi=1.0)
    t = np.arange(0.0, 5.0, 1e-2)
    u = np.where(np.sin(t) > 0, 1.0, -1.0)[:, None]
    np.testing.assert_allclose(simulate(both, t, u).x, simulate(apart, t, u).x, atol=1e-6)


def test_friction_falls_as_it_gets_warm():
    model = ELEMENT.with_effect("temperature_dependent_friction", mu=2.0, b=5.0, a_c=0.01, a_v=0.03, T_0=300.0)
    t = np.arange(0.0, 1.0, 1e-2)
    velocity, cold = np.full(t.size, 0.4), np.full(t.size, 300.0)
    np.testing.assert_allclose(moved(model, velocity, t, cold), 2.0 + 5.0 * 0.4, rtol=1e-9)
    warm = moved(model, velocity, t, cold + 20.0)
    np.testing.assert_allclose(warm, 2.0 * np.exp(-0.2) + 2.0 * np.exp(-0.6), rtol=1e-9)


@pytest.mark.parametrize("kind", ["exact", "smooth", "piecewise"])
def test_a_learned_line_is_viscous_friction(kind):
    base = Model.from_dict(
        {"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.0, "k": 4.0}, "update_period": 0.02}
    )
    line = {"over": "speed", "knots": [-1.0, 0.3, 0.9], "values": [-0.7, 0.21, 0.63]}
    t = np.arange(0.0, 5.0, 1e-2)
    u = np.sin(3.0 * t)[:, None]
    runs = [
        simulate(model, t, u, kind=kind).x
        for model in (base.with_effect("learned_force", **line), base.with_effect("viscous_friction", b=0.7))
    ]
    np.testing.assert_allclose(runs[0], runs[1], atol=1e-5)


def test_what_a_learned_jump_holds_stands_still():
    base = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.0, "k": 0.0}})
    model = base.with_effect("learned_force", over="speed", knots=[-1.0, 0.0, 1.0], values=[-0.5, 0.0, 0.5], jump=2.0)
    t = np.arange(0.0, 2.0, 1e-2)
    assert np.all(simulate(model, t, np.full((t.size, 1), 1.9)).x == 0.0)
    assert simulate(model, t, np.full((t.size, 1), 2.1)).x[-1, 1] > 0.0
