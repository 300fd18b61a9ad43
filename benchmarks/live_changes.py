"""Does the monitor notice that a machine has changed, and keep quiet while it has not?

    python benchmarks/live_changes.py                 6 changes, 2 healthy minutes: some minutes
    python benchmarks/live_changes.py --full          60 changes, 60 healthy runs of 10 minutes: some hours
    python benchmarks/live_changes.py --ros           the same 6 and 2 through the nodes, in real time (live_ros.py)

A motor with Coulomb friction follows slow references (sines, triangles, ramps with stops, two sines; 2 to 10 rad/s, 4
to 9 s) under a position controller. All that is seen is a 16-bit encoder with noise, at 200 Hz, and the voltage; every
base parameter of the monitor's model is wrong by up to 2 %. The monitor's logic runs in simulated time: it learns for
30 s; after 45 s, in motion, friction grows by half, or a load of a quarter of the driving force appears, or a play
of 0.04 rad opens with half of the inertia behind it, or the encoder shifts by ten times its noise, or the input comes
10 ms late, or 1.2 times as large. Seeds: 61, 62, ... for healthy runs, 1061, ... for changes (``--first 60``); others
were used while the detector was made (up to 39, up to 1060, 71, 201 to 260, 324, 355 to 361, 401 to 460, 1201 to 1260,
1355 to 1361, 1401 to 1460, 501 to 636, 1501 to 1636, and from 2000, 6000 and 9000 on).
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.model import Model
from signlin_ros.nodes.monitor_logic import MonitorLogic, MonitorSettings
from signlin_ros.nodes.told import NANO
from signlin_ros.simulation import Stepper

Array = NDArray[np.float64]
Reference = Callable[[float], tuple[float, float]]

RATE, STEP = 200.0, 0.005
QUANTUM, NOISE = 2 * np.pi / 2**16, 5e-5
NOMINAL = Model.load("dc_motor").with_options(with_position=True)
VOLTAGE = 24.0
"""What the amplifier gives at most: a controller that comes late, on a busy machine, must not run away."""
WRONG_BY = 0.02
LEARN, AT = 30.0, 45.0
CHANGES = {
    "friction": "coulomb_friction",
    "load": "constant_load",
    "play": "backlash",
    "shift": "sensor_offset",
    "delay": "input_delay",
    "gain": "input_gain",
}
"""What is changed, and what it should be called."""
IN_TIME, SEEN_FOR = 5.0, 30.0


def machine(random: np.random.Generator) -> Model:
    """Return a machine that is not quite what its model says."""
    names = ("R_a", "K_t", "K_m", "J", "coulomb_friction.mu")
    values = {n: NOMINAL.value(n) * (1 + WRONG_BY * random.uniform(-1, 1)) for n in names}
    return NOMINAL.with_parameters(values)


def reference(random: np.random.Generator) -> Reference:
    """Return a slow reference: position and velocity at a time."""
    kind = random.choice(["sine", "triangle", "ramps", "two sines"])
    T, v, phase, share = random.uniform(4, 9), random.uniform(2, 10), random.uniform(0, 1), random.uniform(0.3, 0.7)

    def sine(t: float, T: float = T, v: float = v) -> tuple[float, float]:
        angle = 2 * np.pi * (t / T + phase)
        return v * T / 2 / np.pi * np.sin(angle), v * np.cos(angle)

    def triangle(t: float) -> tuple[float, float]:
        p = (t / T + phase) % 1
        return v * T * min(p, 1 - p), v if p < 0.5 else -v

    def ramps(t: float) -> tuple[float, float]:
        p = (t / T + phase) % 1
        moving = v if p < 0.4 else -v if 0.5 <= p < 0.9 else 0.0
        return v * T * max(min(p, 0.4, 0.9 - p), 0.0), moving

    def two(t: float) -> tuple[float, float]:
        first, second = sine(t), sine(t, share * T, 0.4 * v)
        return first[0] + second[0], first[1] + second[1]

    return {"sine": sine, "triangle": triangle, "ramps": ramps, "two sines": two}[kind]


class Machine:
    """The machine under its controller, which may change while it runs."""

    def __init__(self, random: np.random.Generator) -> None:
        self.random, self.reference = random, reference(random)
        self.model = machine(random)
        self.gain, self.shift = 1.0, 0.0
        self.drive: list[float] = []
        self._stepper(self.model, np.array([0.0, 0.0, self.reference(0.0)[0]]))

    def _stepper(self, model: Model, x: Array) -> None:
        self.plant = Stepper(model, x)

    def change(self, what: str) -> None:
        """Change in one way."""
        m, x = self.model, self.plant.x
        side = float(self.random.choice([-1.0, 1.0]))
        if what == "friction":
            self._stepper(m.with_parameters({"coulomb_friction.mu": 1.5 * m.value("coulomb_friction.mu")}), x)
        elif what == "load":
            force = 0.25 * m.parameters["K_t"] * float(np.sqrt(np.mean(np.square(self.drive[-2000:]))))
            self._stepper(m.with_effect("constant_load", F0=side * force), x)
        elif what == "play":
            half = 0.5 * m.parameters["J"]
            loose = m.with_parameters(J=half).with_effect("backlash", gap=0.02, k=50.0, c=0.05, J=half)
            self._stepper(loose, np.append(x, [x[2], x[1]]))
        elif what == "delay":
            before = self.plant
            self._stepper(m.with_effect("input_delay", T=0.01), x)
            self.plant.advance(1e-9, [self.u])  # what came before goes on until the first late input
            del before
        self.shift = side * 10 * float(np.hypot(NOISE, QUANTUM / 12**0.5)) if what == "shift" else 0.0
        self.gain = 1.2 if what == "gain" else 1.0

    def step(self, t: float) -> tuple[float, float]:
        """Return what the encoder shows at t, and the input from t on; go on to the next sample."""
        found = self.look(t)
        self.go_on(STEP)
        return found

    def look(self, t: float) -> tuple[float, float]:
        """Return what the encoder shows at t, and the input from t on."""
        seen = self.plant.x[2] + self.shift + NOISE * self.random.standard_normal()
        shown = float(np.round(seen / QUANTUM) * QUANTUM)
        q, v = self.reference(t)
        asked = 0.0805 * v + 0.764 * 0.033 / 0.0805 * np.sign(v) + 3.0 * (q - shown)
        self.u = float(np.clip(asked, -VOLTAGE, VOLTAGE))
        return shown, self.u

    def go_on(self, span: float) -> None:
        """Let the machine run for some seconds under its last input."""
        self.plant.advance(span, [self.gain * self.u])
        self.drive.append(float(self.plant.x[0]))


@dataclass(frozen=True)
class Outcome:
    """What the monitor said of one run."""

    seed: int
    change: str
    onset: float
    alarm: float | None
    began: float | None
    names: list[str]
    seconds: float

    @property
    def in_time(self) -> bool:
        """Whether the change was called within `IN_TIME` s, not before it."""
        return self.alarm is not None and 0 <= self.alarm - self.onset <= IN_TIME

    @property
    def named(self) -> bool:
        """Whether the first name is right."""
        return bool(self.names) and self.names[0] == CHANGES.get(self.change)


def run(seed: int, change: str, length: float, naming: bool = True) -> Outcome:
    """Run one machine under the monitor's logic; ``change`` "" for none."""
    begun = time.perf_counter()
    rig, logic = Machine(np.random.default_rng(seed)), MonitorLogic(MonitorSettings(keep=length + 1, learn=LEARN), 0)
    logic.configure(NOMINAL, 0)
    onset = _moving_from(rig.reference, AT) if change else np.inf
    alarm, changed = None, False
    for k in range(round(length * RATE)):
        t = k * STEP
        if not changed and t >= onset:
            rig.change(change)
            changed = True
        now = round(t * NANO)
        shown, u = rig.step(t)
        logic.take_input(np.array([u]), now)
        logic.take_shown({"position": shown}, now)
        if k % 20 == 19:
            alarm = logic.work(now)[1] or alarm
    question = logic.question(round(length * NANO)) if naming else None
    names = [] if question is None else [found.name for found in question.answer()]
    called, began = (None, None) if alarm is None else (alarm.t, alarm.onset)
    return Outcome(seed, change, onset, called, began, names, time.perf_counter() - begun)


def _moving_from(ref: Reference, t: float) -> float:
    """Return the first time from t on at which the reference moves: nobody sees a change in a machine at rest."""
    while abs(ref(t)[1]) < 0.5:
        t += STEP
    return t


def run_over_ros(seed: int, change: str, length: float, naming: bool = True) -> Outcome:
    """Run one machine beside a linearizer and a monitor, in real time; it ends once a change is named."""
    from live_ros import watched

    begun = time.perf_counter()
    rig = Machine(np.random.default_rng(seed))
    compile_ahead(seed, change)
    onset = _moving_from(rig.reference, AT) if change else np.inf
    until = min(length, onset + (SEEN_FOR if naming else 2 * IN_TIME))
    alarm, began, names = watched(rig, NOMINAL, change, onset, until, LEARN, RATE, naming)
    return Outcome(seed, change, onset, alarm, began, names, time.perf_counter() - begun)


def compile_ahead(seed: int, change: str) -> None:
    """Run a machine like that of a seed before and after its change: nothing is compiled once the clock runs."""
    other = Machine(np.random.default_rng(seed))
    for what in ("", change):
        other.change(what)
        other.step(0.0)


def study(
    changes: int, healthy: int, minutes: float, naming: bool, first: int = 0, run: Callable[..., Outcome] = run
) -> Iterator[Outcome]:
    """Yield the outcomes of all runs."""
    for k in range(first, first + healthy):
        yield run(1 + k, "", 60 * minutes, naming)
    names = list(CHANGES)
    for k in range(first, first + changes):
        yield run(1001 + k, names[k % len(names)], AT + SEEN_FOR, naming)


def main() -> None:
    """Print what was found, one line a run, and the summary."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--full", action="store_true", help="60 changes, and 60 healthy runs of 10 minutes")
    parser.add_argument("--changes", type=int, default=6)
    parser.add_argument("--healthy", type=int, default=2)
    parser.add_argument("--minutes", type=float, default=2.0, help="length of a healthy run")
    parser.add_argument("--first", type=int, default=0, help="number of the first run of either kind")
    parser.add_argument("--no-names", action="store_true", help="do not ask what has changed")
    parser.add_argument("--ros", action="store_true", help="through the nodes, in real time")
    given = parser.parse_args()
    counts = (60, 60, 10.0) if given.full else (given.changes, given.healthy, given.minutes)
    found = []
    for outcome in study(*counts, not given.no_names, given.first, run_over_ros if given.ros else run):
        found.append(outcome)
        print(json.dumps(outcome.__dict__), flush=True)
    changed, healthy = [o for o in found if o.change], [o for o in found if not o.change]
    summary = {
        "changes": len(changed),
        "called within 5 s": sum(o.in_time for o in changed),
        "rightly named": sum(o.named for o in changed),
        "healthy runs": len(healthy),
        "false alarms": sum(o.alarm is not None for o in healthy),
    }
    for name in CHANGES:
        part = [o for o in changed if o.change == name]
        summary[name] = f"{sum(o.in_time for o in part)} called, {sum(o.named for o in part)} named, of {len(part)}"
    print(json.dumps(summary, indent=2))


if __name__ == "__main__":
    main()
