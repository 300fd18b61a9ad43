"""Twelve ties: two machines each that one first record does not tell apart, as users make such records.

The second machine of each is what the second law, fitted to the first machine's record without noise, arrives at: both
tie by construction. Limits are those of a user; what a machine shows is simulated exactly, with white noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from signlin_ros.model import Model
from signlin_ros.simulation import simulate

Array = NDArray[np.float64]
DT = 0.005
TRUE = {"R_a": 0.77063, "K_t": 0.082171, "K_m": 0.081168, "B": 0.00016449, "J": 0.0022504, "L_a": 0.0026292}
"""Base parameters of the first machine: off the data sheet by half of what is known of them."""


@dataclass(frozen=True)
class Machine:
    """A true machine: the effects that nobody listed, its base parameters, what its sensors do."""

    effects: dict[str, dict[str, float]]
    base: dict[str, float]
    names: tuple[str, ...]
    """What a right verdict names."""
    listed: tuple[str, ...] = ()
    """What else it has that may be named."""


@dataclass(frozen=True)
class Tie:
    """Two machines, the model that the user has (``given``), the first command, and what is recorded."""

    key: str
    given: Model
    machines: tuple[Machine, Machine]
    first: tuple[Array, Array]
    noise: dict[str, float]
    limits: dict[str, float]
    x0: dict[str, float] = field(default_factory=dict)
    skip: int = 0
    duration: float = 5.0
    pair: tuple[str, str] = ("", "")

    def record(self, which: int, t: Array, u: Array, seed: int, path: Path, start: bool = False) -> Path:
        """Write what a machine shows of a command, with fresh noise; ``start``: from the first record's state."""
        shown, skip = self.shown(which, t, u, start)
        g = np.random.default_rng(seed)
        columns = [t[skip:] - t[skip], u[skip:]]
        columns += [shown[c][skip:] + sd * g.normal(size=t.size - skip) for c, sd in self.noise.items()]
        head = ",".join(["t", self.given.inputs[0], *self.noise])
        np.savetxt(path, np.column_stack(columns), delimiter=",", comments="", header=head, fmt="%.7g")
        return path

    def shown(self, which: int, t: Array, u: Array, start: bool = False) -> tuple[dict[str, Array], int]:
        """Return what a machine does, by state or output (T,), without noise, and the samples to leave out."""
        machine = self.machines[which]
        model = true_model(self.given, machine)
        x0 = np.zeros(len(model.states))
        for i, name in enumerate(model.states):
            x0[i] = (self.x0 if start else {}).get(name.rpartition(".")[2], 0.0)
        run = simulate(model, t, u[:, None], x0)
        found = {c: run[c] for c in dict.fromkeys((*model.states, *model.outputs))}
        for c, sensor in model.sensors.items():
            if c in found:
                found[c] = sensor.show(np.interp(t - sensor.delay, t, found[c]))
        return found, self.skip if start else 0


def true_model(given: Model, machine: Machine) -> Model:
    """Return the model of a true machine."""
    model = given.with_parameters(machine.base)
    for name, values in machine.effects.items():
        key, _, of = name.partition("@")
        model = model.with_effect(of or key, key if of else None, **values)
    return model


def motor(inductance: float = 0.0026, position: bool = False, **effects: dict[str, float]) -> Model:
    """Return what the user knows of the motor."""
    model = Model.load("dc_motor").without_effect("coulomb_friction")
    model = model.with_parameters({"B": 2e-4, "L_a": inductance})
    tolerance = dict.fromkeys(("R_a", "K_t", "K_m", "J", *(("L_a",) if inductance else ())), 0.05) | {"B": 0.3}
    model = model.with_options(tolerance=tolerance, with_position=position)
    for name, values in effects.items():
        model = model.with_effect(name, None, **values)
    return model


def multisine(duration: float, peak: float, highest: float, seed: int = 3) -> tuple[Array, Array]:
    """Return a command of 24 sines up to a frequency in Hz, ramped in and out."""
    t = np.arange(0, duration, DT)
    f = np.arange(1, int(highest * duration) + 1) / duration
    f = f[np.unique(np.geomspace(1, f.size, 24).astype(int)) - 1]
    g = np.random.default_rng(seed)
    s = np.sin(2 * np.pi * np.outer(t, f) + g.uniform(0, 2 * np.pi, f.size)).sum(1)
    s *= np.clip(np.minimum(t / 0.1, (duration - t) / 0.2), 0, 1)
    return t, peak * s / np.abs(s).max()


def chirp(duration: float, peak: float, low: float = 0.1, high: float = 10.0) -> tuple[Array, Array]:
    """Return a sweep between two frequencies in Hz, ramped in and out."""
    t = np.arange(0, duration, DT)
    k = (high / low) ** (1 / duration)
    s = np.sin(2 * np.pi * low * (k**t - 1) / np.log(k)) * np.clip(np.minimum(t / 0.1, (duration - t) / 0.2), 0, 1)
    return t, peak * s


def _t(duration: float) -> Array:
    return np.arange(0, duration, DT)


def _up(t: Array, ramp: float = 0.2) -> Array:
    return np.clip(t / ramp, 0, 1)


def _second(values: str, inductance: bool = True) -> dict[str, float]:
    names = ("R_a", "K_t", "K_m", "B", "J", *(("L_a",) if inductance else ()))
    return dict(zip(names, map(float, values.split()), strict=True))


def _first(inductance: bool = True, **more: float) -> dict[str, float]:
    return {n: v for n, v in TRUE.items() if inductance or n != "L_a"} | more


CURRENT = {"current": 0.05, "speed": 0.4}
LIMITS = {"voltage": 6.0, "speed": 80.0}


def coulomb_stribeck() -> Tie:
    t, u = multisine(5, 1.8, 5.0)
    stribeck = {"stribeck_friction": {"mu": 0.031435, "excess": 0.006, "v_s": 1.0}}
    b = _second("0.77075 0.080644 0.081165 0.0001867 0.0022095 0.0026198")
    machines = (
        Machine({"coulomb_friction": {"mu": 0.033}}, _first(), ("coulomb_friction",)),
        Machine(stribeck, b, ("stribeck_friction",)),
    )
    return Tie("coulomb_stribeck", motor(), machines, (t, (u + 3.5) * _up(t)), CURRENT, LIMITS)


def coulomb_dahl() -> Tie:
    t = _t(4)
    b = _second("0.76989 0.079956 0.081172 0.00015352 0.0021943 0.0025841")
    machines = (
        Machine({"coulomb_friction": {"mu": 0.033}}, _first(), ("coulomb_friction",)),
        Machine({"dahl_presliding": {"F_c": 0.032424, "sigma": 12.0}}, b, ("dahl_presliding",)),
    )
    u = 5 * np.sin(2 * np.pi * 0.25 * t) * _up(t)
    return Tie("coulomb_dahl", motor(), machines, (t, u), {"current": 0.05, "speed": 0.5}, LIMITS)


def lugre_stribeck() -> Tie:
    t = _t(4)
    lugre = {"sigma0": 3.0, "sigma1": 0.02, "sigma2": 0.0, "F_c": 0.025, "F_s": 0.037, "v_s": 3.0}
    b = _second("0.77086 0.080659 0.081164 0.000167 0.0022048 0.0026374")
    stribeck = {"mu": 0.024297, "excess": 0.0018288, "v_s": 11.449}
    machines = (
        Machine({"lugre_friction": lugre}, _first(), ("lugre_friction",)),
        Machine({"stribeck_friction": stribeck}, b, ("stribeck_friction",)),
    )
    u = 5 * np.sin(2 * np.pi * 0.25 * t) * _up(t)
    return Tie("lugre_stribeck", motor(), machines, (t, u), {"current": 0.05, "speed": 0.5}, LIMITS)


def backlash_compliant() -> Tie:
    t = _t(3)
    given = motor(coulomb_friction={"mu": 0.01}).with_parameters({"J": 0.0016})
    a = _first() | {"J": 0.0016366, "coulomb_friction.mu": 0.01}
    b = _second("0.76964 0.081099 0.081169 0.0001727 0.0016008 0.0026002") | {"coulomb_friction.mu": 0.0093723}
    machines = (
        Machine({"backlash": {"k": 6.0, "c": 0.01, "J": 0.0006, "gap": 0.03}}, a, ("backlash",)),
        Machine({"compliant_load": {"k": 2.9918, "c": 0.0099985, "J": 0.00061155}}, b, ("compliant_load",)),
    )
    u = (4 + 0.6 * np.sin(2 * np.pi * (0.15 * t + 0.03 * t * t))) * _up(t, 0.6)
    return Tie("backlash_compliant", given, machines, (t, u), CURRENT, LIMITS, skip=200)


def gravity_spring() -> Tie:
    t = _t(5)
    given = motor(0.0, position=True, coulomb_friction={"mu": 0.004})
    a = _first(False) | {"coulomb_friction.mu": 0.004}
    b = _second("0.76383 0.08044 0.080722 0.0002004 0.0022227", False) | {"coulomb_friction.mu": 0.0039589}
    machines = (
        Machine({"gravity_load": {"A": 0.08, "q0": 0.0}}, a, ("gravity_load",)),
        Machine({"linear_stiffness": {"k": 0.078618}}, b, ("linear_stiffness",)),
    )
    u = 0.15 * np.sin(2 * np.pi * (0.1 * t + 0.12 * t * t)) * _up(t)
    return Tie("gravity_spring", given, machines, (t, u), {"position": 0.0015}, LIMITS | {"position": 1.5})


def constant_coulomb() -> Tie:
    t, u = multisine(6, 1.8, 5.0)
    b = _second("0.77049 0.080582 0.081168 0.00016885 0.0022074 0.0026182")
    machines = (
        Machine({"constant_load": {"F0": -0.03}}, _first(), ("constant_load",)),
        Machine({"coulomb_friction": {"mu": 0.029134}}, b, ("coulomb_friction",)),
    )
    start = {"speed": 38.0}
    return Tie("constant_coulomb", motor(), machines, (t, u + 3.5), CURRENT, LIMITS, start, 200)


def delays() -> Tie:
    t = _t(5)
    given = motor(coulomb_friction={"mu": 0.02})
    a = _first() | {"coulomb_friction.mu": 0.02}
    b = _second("0.77485 0.080523 0.080883 0.00018255 0.0022073 0.0026185") | {"coulomb_friction.mu": 0.019571}
    machines = (
        Machine({"input_delay": {"T": 0.008}}, a, ("input_delay",)),
        Machine({"sensor_delay": {"speed": 0.0065568}}, b, ("sensor_delay",)),
    )
    u = 4 * np.clip(1.5 * np.arcsin(np.sin(2 * np.pi * 0.2 * t)) * 2 / np.pi, -1, 1)
    return Tie("delays", given, machines, (t, u), {"current": 0.15, "speed": 0.6}, LIMITS)


def deadzone_coulomb() -> Tie:
    t, u = multisine(5, 1.8, 5.0)
    b = _second("0.76676 0.080211 0.08079 0.00020062 0.0022077", False)
    machines = (
        Machine({"input_deadzone": {"d": 0.3}}, _first(False), ("input_deadzone",)),
        Machine({"coulomb_friction": {"mu": 0.031392}}, b, ("coulomb_friction",)),
    )
    return Tie("deadzone_coulomb", motor(0.0), machines, (t, (u + 3.5) * _up(t)), {"speed": 0.4}, LIMITS)


def quadratic_cubic() -> Tie:
    t = _t(4)
    given = motor(coulomb_friction={"mu": 0.02})
    a = _first() | {"coulomb_friction.mu": 0.02}
    b = _second("0.77069 0.080013 0.081159 0.00034997 0.0021912 0.0026058") | {"coulomb_friction.mu": 0.019164}
    machines = (
        Machine({"quadratic_drag": {"c2": 1.2e-5}}, a, ("quadratic_drag",)),
        Machine({"cubic_viscous_friction": {"b": 1e-6, "b3": 1.7228e-7}}, b, ("cubic_viscous_friction",)),
    )
    u = 5 * np.sin(2 * np.pi * (0.25 * t + 0.15 * t * t)) * _up(t)
    return Tie("quadratic_cubic", given, machines, (t, u), CURRENT, {"voltage": 12.0, "speed": 150.0})


def load_coulomb() -> Tie:
    t, u = multisine(6, 0.7, 2.0)
    given = motor(constant_load={"F0": -0.06})
    a = _first() | {"constant_load.F0": -0.06}
    b = _second("0.7708 0.074304 0.081162 0.00018438 0.0023908 0.0026066") | {"constant_load.F0": -0.059805}
    machines = (
        Machine({"load_dependent_friction": {"kappa_d": 0.15, "kappa_e": 0.15}}, a, ("load_dependent_friction",)),
        Machine({"coulomb_friction": {"mu": 0.013238}}, b, ("coulomb_friction",)),
    )
    return Tie("load_coulomb", given, machines, (t, u + 4.0), CURRENT, LIMITS, {"speed": 38.0}, 200)


def bouc_wen_dahl() -> Tie:
    """A spring whose hysteresis a slow sine of one size shows as either law: what is known of the stiffness holds both
    that at the start of a branch (Bouc-Wen's k) and that beside the bristles (Dahl's).
    """
    t = _t(8)
    given = Model.load("mass_spring_damper").without_effect("coulomb_friction")
    tolerance = {"m": 0.05, "c": 0.05, "k": 0.2}
    given = given.with_parameters({"m": 1.0, "c": 1.0, "k": 34.0}).with_options(tolerance=tolerance)
    a = {"m": 1.02, "c": 1.03, "k": 40.8}
    law = {"alpha": 0.7, "D": 0.04, "lambda": 1.0, "beta": 0.5, "gamma": 0.5, "n": 1.0}
    b = {"m": 1.0377, "c": 1.0076, "k": 29.37}
    machines = (
        Machine({"bouc_wen_hysteresis": law}, a, ("bouc_wen_hysteresis",)),
        Machine({"dahl_presliding": {"F_c": 0.555, "sigma": 9.748}}, b, ("dahl_presliding",)),
    )
    u = 1.2 * np.sin(2 * np.pi * 0.5 * t) * _up(t)
    noise, limits = {"displacement": 1e-3, "velocity": 0.012}, {"force": 12.0, "displacement": 0.5}
    return Tie("bouc_wen_dahl", given, machines, (t, u), noise, limits)


TIES: tuple[Callable[[], Tie], ...] = (
    *(coulomb_stribeck, coulomb_dahl, lugre_stribeck, backlash_compliant, gravity_spring, constant_coulomb, delays),
    *(deadzone_coulomb, quadratic_cubic, load_coulomb, bouc_wen_dahl),
)
"""What is scored. Cogging against an encoder's ripple is not among them: no listed effect is a ripple of the sensor."""
