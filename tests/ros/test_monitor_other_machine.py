"""The monitor's logic on a machine that is not the shipped motor: Stribeck friction, a weight, a coarse encoder."""

from __future__ import annotations

from collections.abc import Collection, Iterable

import numpy as np
import pytest

from signlin_ros.model import Model
from signlin_ros.nodes.linearizer_logic import NANO
from signlin_ros.nodes.monitor_logic import MonitorLogic, MonitorSettings
from signlin_ros.observe.naming import Named
from signlin_ros.simulation import Stepper

STEP, QUANTUM, NOISE = 0.005, 2 * np.pi / 2**14, 1e-4
LEARN, AT, SEEN = 30.0, 40.0, 22.0
SHIFT, DELAY, GAIN, PAYLOAD, FRICTION = 0.02, 0.01, 1.2, 1.3, 1.5
MOTOR = (
    Model.load("dc_motor")
    .with_options(with_position=True)
    .without_effect("coulomb_friction")
    .with_effect("stribeck_friction", mu=0.03, excess=0.015, v_s=1.0)
    .with_effect("gravity_load", A=0.04)
    .with_parameters(J=0.003, B=5e-4)
)
LEVELS = ("stribeck_friction.mu", "stribeck_friction.excess")


class Rig:
    """The machine, its controller, and the monitor's logic on a model whose parameters are wrong by up to a share."""

    def __init__(self, seed: int, wrong: float = 0.02, channels: Iterable[str] = ("position",)) -> None:
        self.random, self.channels = np.random.default_rng(seed), tuple(channels)
        names = ("R_a", "K_t", "K_m", "J", "stribeck_friction.mu", "gravity_load.A")
        self.true = MOTOR.with_parameters({n: MOTOR.value(n) * (1 + wrong * self.random.uniform(-1, 1)) for n in names})
        self.plant = Stepper(self.true, np.array([0.0, 0.0, self.reference(0.0)[0]]))
        self.k, self.shift, self.gain, self.u = 0, 0.0, 1.0, 0.0
        self.logic = MonitorLogic(MonitorSettings(keep=AT + SEEN + 1, learn=LEARN), 0)
        self.logic.configure(MOTOR, 0)

    @staticmethod
    def reference(t: float) -> tuple[float, float]:
        w = 2 * np.pi / 5
        v = 3 * w * np.cos(w * t) + 1.84 * w * np.cos(2.3 * w * t)
        return 3 * np.sin(w * t) + 0.8 * np.sin(2.3 * w * t), v

    def go(
        self, until: float, lost: Collection[tuple[float, float]] = (), without: Collection[str] = ("states",)
    ) -> None:
        """Run until a time in s; states, or inputs, do not come in the ``lost`` spans (from, to)."""
        while self.k * STEP < until:
            t = self.k * STEP
            now = round(t * NANO)
            q = self.plant.x[2] + self.shift + NOISE * self.random.standard_normal()
            shown = {"position": float(np.round(q / QUANTUM) * QUANTUM)}
            shown["speed"] = self.plant.x[1] + 0.01 * self.random.standard_normal()
            shown["current"] = self.plant.x[0] + 0.01 * self.random.standard_normal()
            wanted, v = self.reference(t)
            push = 0.03 * np.tanh(v / 0.3) + 0.04 * np.sin(wanted)
            self.u = 0.0805 * v + 0.764 / 0.0805 * push + 3.0 * (wanted - shown["position"])
            away = any(begun <= t < ended for begun, ended in lost)
            if not away or "inputs" not in without:
                self.logic.take_input(np.array([self.u]), now)
            if not away or "states" not in without:
                self.logic.take_shown({name: shown[name] for name in self.channels}, now)
            self.plant.advance(STEP, [self.gain * self.u])
            if self.k % 20 == 19:
                self.logic.work(now)
            self.k += 1

    def become(self, model: Model) -> None:
        """Go on as another machine."""
        self.plant = Stepper(model, self.plant.x)

    def change(self, what: str) -> None:
        true = self.true
        if what == "payload":
            self.become(true.with_parameters({n: PAYLOAD * true.value(n) for n in ("J", "gravity_load.A")}))
        elif what == "friction":
            self.become(true.with_parameters({n: FRICTION * true.value(n) for n in LEVELS}))
        elif what == "delay":
            self.become(true.with_effect("input_delay", T=DELAY))
            self.plant.advance(1e-9, [self.u])  # what came before goes on until the first late input
        elif what == "cogging":
            self.become(true.with_effect("cogging_torque", A=0.02, N=7))
        self.shift = SHIFT if what == "shift" else 0.0
        self.gain = GAIN if what == "gain" else 1.0


def named(what: str, seed: int) -> list[Named]:
    """Return what the monitor calls a change."""
    rig = Rig(seed)
    rig.go(AT)
    assert rig.logic.alarm is None
    rig.change(what)
    rig.go(AT + SEEN)
    question = rig.logic.question(round((AT + SEEN) * NANO))
    assert question is not None
    return question.answer()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("what", "name", "value", "near"),
    [
        ("payload", "payload", PAYLOAD, 0.1),
        ("shift", "sensor_offset", SHIFT, 0.002),
        ("friction", "stribeck_friction", FRICTION, 0.1),
        ("delay", "input_delay", DELAY, 0.002),
        ("gain", "input_gain", GAIN, 0.06),
    ],
)
def test_what_a_machine_does_most_is_named_with_its_size(what: str, name: str, value: float, near: float) -> None:
    first = named(what, seed=5)[0]
    assert first.name == name
    assert first.value == pytest.approx(value, abs=near)
    assert first.explained > 0.9


@pytest.mark.slow
def test_a_change_that_no_hypothesis_holds_is_not_named() -> None:
    assert named("cogging", seed=5) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("channels", "without"),
    [
        (("position",), ("states",)),
        (("position", "speed", "current"), ("states",)),
        (("position", "speed", "current"), ("states", "inputs")),
        (("position",), ("inputs",)),
    ],
)
def test_what_is_lost_is_no_change(channels: tuple[str, ...], without: tuple[str, ...]) -> None:
    rig = Rig(1, wrong=0.5, channels=channels)
    gaps = [(38.0 + 2.37 * k, 38.0 + 2.37 * k + (0.17 if k % 2 else 0.4)) for k in range(10)]
    rig.go(62.0, gaps, without)
    assert rig.logic.alarm is None
    assert rig.logic.health(round(62 * NANO)).values["gaps"] == "10"
    rig.change("shift")
    rig.go(63.0)
    assert rig.logic.alarm is not None
    assert rig.logic.alarm.onset == pytest.approx(62.0, abs=0.1)
