"""One trace of a model's equations with recorded signs: everything else is a choice of s.

`trace` runs the plant and its effects once under `signlin_ros.mathops.Recorder` and returns F(x, u, p, s) with the
switching surfaces g, as CasADi expressions. Equal structures share one trace; numbers are inputs, not constants.
"""

from __future__ import annotations

import functools
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca

from signlin_ros.effects import Effect
from signlin_ros.engine.symbolic import symbolic
from signlin_ros.errors import ModelError
from signlin_ros.mathops import Recorder, Surface
from signlin_ros.par import POWER_DIGITS, Namespace, as_law_sees
from signlin_ros.plants import Plant
from signlin_ros.recording.asking import asked

if TYPE_CHECKING:
    from signlin_ros.recording.arm import ArmParts


@dataclass(frozen=True)
class EffectSlot:
    """An effect in a structure: its key, its class, the values baked into the equations, and its parameters' names."""

    key: str
    effect: type[Effect]
    structural: tuple[tuple[str, float], ...]
    parameters: tuple[str, ...]
    built_in: bool = False


@dataclass(frozen=True)
class Structure:
    """What decides a model's equations, apart from the numbers in them; hashable."""

    plant: type[Plant]
    plant_structural: tuple[tuple[str, float], ...]
    zeros: tuple[str, ...]
    slots: tuple[EffectSlot, ...]
    with_position: bool
    optional_inputs: tuple[str, ...]


@dataclass(frozen=True)
class Trace:
    """Equations of a model as CasADi expressions of x (n), u (m), p and the surfaces' symbols.

    ``f`` (n) state derivatives; ``y`` outputs beside the states; ``delay`` of the input in s, a function of p.
    Names are plain public names; ``units`` covers states, inputs and outputs. ``parts``: of an arm, what f is made of.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: dict[str, str]
    parameters: tuple[str, ...]
    x: ca.SX
    u: ca.SX
    p: ca.SX
    f: ca.SX
    y: ca.SX
    delay: ca.SX
    surfaces: tuple[Surface, ...]
    parts: ArmParts | None = None


class _Coordinates:
    """What an effect sees of the model; notes whether the position or the temperature was asked for."""

    velocity: Any
    own: Any
    external_force: Any
    drive_force: Any

    def __init__(self) -> None:
        self.asked_position = False
        self.asked_temperature = False

    def __getattr__(self, name: str) -> Any:
        if name in ("position", "temperature"):
            setattr(self, f"asked_{name}", True)
            return self.__dict__[f"_{name}"]
        raise AttributeError(name)


TEMPERATURE = "temperature"
"""Input of any plant that is the temperature in K of the drive: where an effect needs it, or a record holds it."""
ROOM_TEMPERATURE = 293.15
"""Taken where nothing is said of it, in K."""
ROTARY_UNITS = {"N": "N·m", "m": "rad", "m/s": "rad/s", "kg": "kg·m²", "N·s/m": "N·m·s/rad", "N/m": "N·m/rad"}
"""Units of forces and displacements, and those of torques and angles in their place."""

INERTIA = {"N·s²/m": "kg", "N·m·s²/rad": "kg·m²"}
"""What an inertia is in, by what a force over an acceleration is."""


def rotary_unit(unit: str) -> str:
    """Return a unit made of N, m, s and kg as its rotary one, e.g. ``N·s²/m²`` as ``N·m·s²/rad²``; others unchanged."""
    bare = "".join(letter for letter in unit if letter not in POWER_DIGITS)
    if unit in ROTARY_UNITS or "N·m" in unit or not set(re.split("[·/]", bare)) <= {"N", "m", "s", "1"}:
        return ROTARY_UNITS.get(unit, unit)
    return "".join(ROTARY_UNITS.get(letter, letter) for letter in unit)


def resolve_unit(unit: str, plant: type[Plant], rotary: bool = False) -> str:
    """Return a declared unit with F, Q and U written as the plant's units, e.g. ``F·s/Q`` as ``N·m·s/rad``.

    ``rotary``: a plant of forces and displacements stands for one of torques and angles.
    """
    names = {"F": plant.force_unit, "Q": plant.position_unit, "U": plant.input_unit}
    if rotary:
        names = {letter: ROTARY_UNITS.get(name, name) for letter, name in names.items()}
        unit = rotary_unit(unit)
    parts = (part.rstrip(POWER_DIGITS) for part in re.split("[·/]", unit))
    resolved = "".join(names.get(letter, letter) for letter in unit) if {"F", "Q", "U"} & {*parts} else unit
    return INERTIA.get(resolved, resolved)


class _Tracer:
    """Carries the symbols of one trace; acts as `signlin_ros.plants.base.Acting` for the plant."""

    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        self.m = Recorder()
        self.parameters: dict[str, ca.SX] = {}
        known = {**dict(structure.plant_structural), **dict.fromkeys(structure.zeros, 0.0)}
        self.plant_p = Namespace(self._symbols("", structure.plant.pars(), known))
        self.effects = [(slot, slot.effect(), self._effect_symbols(slot)) for slot in structure.slots]
        self._states()
        self._inputs()

    def _symbols(self, prefix: str, pars: Any, structural: Any) -> dict[str, Any]:
        values: dict[str, Any] = dict(structural)  # numbers that are part of the equations
        for name in pars:
            if name not in values:
                values[name] = self.parameters[prefix + name] = ca.SX.sym(prefix + name)
        return values

    def _effect_symbols(self, slot: EffectSlot) -> Namespace:
        if slot.built_in:
            return Namespace({name: getattr(self.plant_p, Namespace.attribute(name)) for name in slot.parameters})
        return as_law_sees(slot.effect.pars(), self._symbols(f"{slot.key}.", slot.parameters, slot.structural))

    def _states(self) -> None:
        plant = self.structure.plant
        values = {name: 0.0 if name in self.structure.zeros else 1.0 for name in plant.pars()}
        self.units, self.algebraic = dict(plant.states(values)), plant.algebraic(values)
        self.symbols = {name: ca.SX.sym(name) for name in self.units}
        self.x = _Coordinates()
        for name, symbol in self.symbols.items():
            setattr(self.x, name, symbol)
        if plant.position not in self.symbols:
            self.symbols[plant.position] = ca.SX.sym(plant.position)
            self.units[plant.position] = plant.position_unit
        self.x.__dict__["_position"] = self.symbols[plant.position]
        if plant.position_optional:
            self.x.__dict__.pop(plant.position, None)
        else:
            self.x.__dict__["position"] = self.symbols[plant.position]
        if plant.velocity in self.symbols:
            self.x.velocity = self.symbols[plant.velocity]
        for slot, _, _ in self.effects:
            for name, unit in slot.effect.states.items():
                full = plant.own_state_names.get(f"{slot.key}.{name}", f"{slot.key}.{name}")
                self.symbols[full] = ca.SX.sym(full)
                self.units[full] = resolve_unit(unit, plant)

    def _inputs(self) -> None:
        plant = self.structure.plant
        optional = (n for n in self.structure.optional_inputs if n != TEMPERATURE)
        units = {**plant.inputs, **{n: plant.optional_inputs[n] for n in optional}}
        self.input_symbols = {name: ca.SX.sym(name) for name in units}
        self.units.update(units)
        self.x.__dict__["_temperature"] = ca.SX.sym(TEMPERATURE)
        effective = dict(self.input_symbols)
        first = next(iter(units))
        if not plant.closed_loop:
            effective[first] = self.input(effective[first])
        self.u = Namespace(effective)

    def input(self, value: Any) -> Any:
        """Return an input, or the error of the plant's own loop, as the effects of the input leave it."""
        for entry in self.effects:
            value = self._asked(entry, "input", value)
        return value

    def _asked(self, entry: tuple[EffectSlot, Effect, Namespace], method: str, *given: Any) -> Any:
        """Return the recorded expression of an effect's method; ``given``: its arguments beside m and p."""
        _, effect, p = entry
        first, more = given[:1], given[1:]
        arguments = {"delay": (p,), "input": (self.m, *given, p)}.get(method, (self.m, *first, p, *more))
        return asked(effect, method, self.structure.plant, *arguments)

    def _own(self, slot: EffectSlot) -> _Coordinates:
        plant = self.structure.plant
        names = {n: plant.own_state_names.get(f"{slot.key}.{n}", f"{slot.key}.{n}") for n in slot.effect.states}
        self.x.own = Namespace({name: self.symbols[full] for name, full in names.items()})
        return self.x

    def spring(self, k: Any) -> Any:
        """See `Acting`."""
        for entry in self.effects:
            changed = None if hasattr(entry[2], "k") else self._asked(entry, "spring", self._own(entry[0]), k)
            if changed is not None:
                return changed
        return k * self.x.position

    def torque_constant(self, K_t: Any) -> Any:
        """See `Acting`."""
        for entry in self.effects:
            K_t = self._asked(entry, "torque_constant", self._own(entry[0]), K_t)
        return K_t

    def resistance(self, R_a: Any) -> Any:
        """See `Acting`."""
        for entry in self.effects:
            R_a = self._asked(entry, "resistance", self._own(entry[0]), R_a)
        return R_a

    def force(self, drive: Any, elastic: Any) -> Any:
        """See `Acting`; external forces first, because friction may depend on their sum."""
        external = sum(
            (self._asked(e, "force", self._own(e[0])) for e in self.effects if e[0].effect.external),
            ca.SX(0),
        )
        self.x.external_force = external + elastic
        if drive is not None:
            self.x.drive_force = drive
        others = (self._asked(e, "force", self._own(e[0])) for e in self.effects if not e[0].effect.external)
        return external + sum(others, ca.SX(0))

    def run(self) -> tuple[dict[str, Any], ca.SX]:
        """Return every derivative and output by name, and the delay."""
        plant = self.structure.plant()
        results = dict(plant.rates(self.m, self.x, self.u, self.plant_p, self))
        for entry in self.effects:
            slot = entry[0]
            for name, rate in self._asked(entry, "rates", self._own(slot)).items():
                results[plant.own_state_names.get(f"{slot.key}.{name}", f"{slot.key}.{name}")] = rate
        if self.x.asked_temperature or TEMPERATURE in self.structure.optional_inputs:  # an input of any plant
            self.input_symbols[TEMPERATURE], self.units[TEMPERATURE] = self.x.__dict__["_temperature"], "K"
        delay = sum((ca.SX(self._asked(entry, "delay")) for entry in self.effects), ca.SX(0))
        if plant.position_optional:
            if self.structure.with_position or self.x.asked_position:
                results[plant.position] = self.x.velocity
            else:
                del self.symbols[plant.position]
        return results, delay


def _check_switches(result: Trace) -> None:
    """Refuse what the set-valued simulation cannot handle: a right-hand side that is not affine in the signs."""
    switches = [s.symbol for s in result.surfaces if s.kind == "switch"]
    if switches and any(ca.which_depends(result.f, ca.vertcat(*switches), 2, True)):
        raise ModelError("the equations are not affine in sign(.): two signs are multiplied, or one is squared")


@functools.cache
@symbolic
def trace(structure: Structure) -> Trace:
    """Trace the equations of a structure; raise `ModelError` if an effect does not apply to the plant.

    What was traced is kept until the process ends, as is its machine code: expressions that are forgotten in one thread
    must not be written in another (`signlin_ros.engine.symbolic`).
    """
    if structure.plant.name == "arm":
        from signlin_ros.recording.arm import ArmTracer

        result = ArmTracer(structure).run()
        _check_switches(result)
        return result
    tracer = _Tracer(structure)
    results, delay = tracer.run()
    states, inputs = tuple(tracer.symbols), tuple(tracer.input_symbols)
    extra = {**structure.plant.outputs, **tracer.algebraic}
    shown = dict(zip(states, tracer.symbols.values(), strict=True)) if tracer.algebraic else {}
    shown |= {name: results[name] for name in extra}
    result = Trace(
        states=states,
        inputs=inputs,
        outputs=tuple(shown) or states,
        units={**tracer.units, **extra},
        parameters=tuple(tracer.parameters),
        x=ca.vertcat(*tracer.symbols.values()),
        u=ca.vertcat(*tracer.input_symbols.values()),
        p=ca.vertcat(*tracer.parameters.values()) if tracer.parameters else ca.SX(0, 1),
        f=ca.vertcat(*(results[name] for name in states)),
        y=ca.vertcat(*shown.values()) if shown else ca.SX(0, 1),
        delay=delay,
        surfaces=tuple(tracer.m.surfaces),
    )
    _check_switches(result)
    return result


@symbolic
def delay_of(t: Trace, p: Any) -> float:
    """Return the delay of the input in s for values p of the parameters."""
    return float(t.delay if t.delay.is_constant() else ca.Function("delay", [t.p], [t.delay])(p))
