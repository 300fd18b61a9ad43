"""Margins of sampled loops: against simulation, at every delay; what does not hold is refused with what does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from signlin_ros.control.controller import Controller, ControllerSettings
from signlin_ros.control.designs import DESIGNS, Task, Tuning, known
from signlin_ros.control.holding import holding, linear_drives, margins_at
from signlin_ros.control.lqr import Weights, lqr_gains
from signlin_ros.control.margins import MAX_SENSITIVITY, loop_margins, rigid_drive, sampled_drives
from signlin_ros.errors import InputError
from signlin_ros.model import Model

MODEL = Model.load("dc_motor")
PERIOD = 0.02


def task(position: bool = False, period: float = PERIOD, least: float | None = 0.0) -> Task:
    return Task(position, period, period, 12.0, 5.0, least=least)


def simulated(row: np.ndarray, kV: float, kA: float, period: float, delay: float, position: bool) -> float:
    """Growth per period of a rigid drive in a loop, marched in small steps: another way to the spectral radius."""
    parts = 400
    h, late = period / parts, round(delay / period * parts)
    q, v, summed, past = 0.1, 1.0, 0.0, [0.0] * (row.size - 3)
    held, sizes, coming = 0.0, [], 0.0
    for _ in range(400):
        error_q, error_v = -q, -v
        u = row[1] * error_v + summed - sum(g * w for g, w in zip(row[3:], past, strict=True))
        u += row[0] * error_q if position else 0.0
        summed += row[2] * (error_q if position else error_v) * period
        past = [*past[1:], u] if past else []
        coming = u
        for k in range(parts):
            if k == late:
                held = coming
            a = (held - kV * v) / kA
            q, v = q + h * (v + h * a / 2), v + h * a
        if late == parts:
            held = coming
        sizes.append(abs(v) + abs(u) / kA * period + (20.0 * abs(q) if position else 0.0))
    grown = np.log(np.maximum(sizes, 1e-280))
    return float(np.exp((grown[300:].max() - grown[100:200].max()) / 200.0))


@pytest.mark.parametrize("position", [False, True])
@pytest.mark.parametrize("bandwidth", [10.0, 20.0, 30.0])
@pytest.mark.parametrize("delay", [0.0, 0.005, 0.015, 0.02])
def test_the_spectral_radius_is_that_of_a_simulation(position, bandwidth, delay):
    """Gains that believe in a delay of one period, at whatever it is."""
    c = known(MODEL, task(position))
    row = lqr_gains(c.kV, c.kA, 0.0, Weights(bandwidth), PERIOD, PERIOD, position).row
    drives = sampled_drives([rigid_drive(c.kV, c.kA, 0.0)], PERIOD, (delay, delay))
    found = loop_margins(drives, row[None, :], PERIOD, position).radius
    assert found == pytest.approx(simulated(row, c.kV, c.kA, PERIOD, delay, position), abs=0.02)


def test_gains_that_believe_in_one_period_do_not_hold_where_the_input_acts_at_once():
    """What was by default in a position loop: stable as designed, with 1.34 a period where it acts sooner."""
    c = known(MODEL, task(True))
    row = lqr_gains(c.kV, c.kA, 0.0, Weights(20.0), PERIOD, PERIOD, True).row
    drives = [rigid_drive(c.kV, c.kA, 0.0)]
    assert loop_margins(sampled_drives(drives, PERIOD, (PERIOD, PERIOD)), row, PERIOD, True).stable
    soon = loop_margins(sampled_drives(drives, PERIOD, (0.0, PERIOD)), row, PERIOD, True)
    assert soon.radius == pytest.approx(1.345, abs=0.01)
    assert not soon.stable
    assert "unstable (spectral radius 1.3" in soon.fault


@pytest.mark.parametrize("position", [False, True])
@pytest.mark.parametrize("period", [0.001, 0.02, 0.2])
def test_the_default_holds_at_every_delay(position, period):
    asked = task(position, period)
    design = DESIGNS["along_reference"]
    tuning = holding(design, MODEL, asked, Tuning(Weights(1.0)))
    found = margins_at(design, MODEL, asked, tuning)(tuning.weights.bandwidth)
    assert found.stable
    assert found.sensitivity <= MAX_SENSITIVITY


def test_the_current_counts_where_the_period_is_short():
    """Without its current the motor holds 400 rad/s at 1 kHz; with it, a quarter of that."""
    asked = task(False, 0.001)
    drives = linear_drives(MODEL, asked)
    assert {d.A.shape[0] for d in drives} == {2, 3}
    tuning = holding(DESIGNS["along_reference"], MODEL, asked, Tuning(Weights(1.0)))
    assert 50.0 < tuning.weights.bandwidth < 200.0
    slow = MODEL.with_parameters(L_a=0.01)
    slower = holding(DESIGNS["along_reference"], slow, asked, Tuning(Weights(1.0)))
    assert slower.weights.bandwidth < 0.6 * tuning.weights.bandwidth


@pytest.mark.parametrize("position", [False, True])
def test_what_does_not_hold_is_refused_with_the_largest_that_does(position):
    settings = ControllerSettings(limit=12.0, speed=5.0, position=position, bandwidth=30.0)
    with pytest.raises(InputError, match=r"bandwidth: found 30 rad/s.*the largest that holds is ") as refused:
        Controller(MODEL, settings)
    largest = float(str(refused.value).rpartition("holds is ")[2].removesuffix(" rad/s"))
    assert Controller(MODEL, replace(settings, bandwidth=largest)).bandwidth == largest
    with pytest.raises(InputError, match="bandwidth"):
        Controller(MODEL, replace(settings, bandwidth=1.03 * largest))


def test_a_longer_delay_leaves_room_for_less():
    found = [Controller(MODEL, ControllerSettings(12.0, speed=5.0, delay=d)).bandwidth for d in (0.02, 0.06, 0.2)]
    assert found == sorted(found, reverse=True)
    delayed = MODEL.with_effect("input_delay", T=0.1)
    assert Controller(delayed, ControllerSettings(12.0, speed=5.0)).bandwidth < found[0] / 2


def test_a_load_on_a_spring_counts():
    soft = MODEL.with_effect("compliant_load", k=0.5, c=0.002, J=0.002)
    asked = task()
    assert max(d.A.shape[0] for d in linear_drives(soft, asked)) == 5
    with pytest.raises(InputError, match="along_reference"):
        holding(DESIGNS["along_reference"], soft, asked, Tuning(Weights(1.0)), bandwidth=20.0)


def test_what_holds_only_above_some_bandwidth_is_found():
    """A weight that is not at rest where the drive stands has to be held: a loop that is too slow lets it fall."""
    hanging = MODEL.with_options(with_position=True).with_effect("gravity_load", A=-0.05)
    controller = Controller(hanging, ControllerSettings(limit=12.0, speed=5.0, position=True))
    assert controller.bandwidth > 5.0
