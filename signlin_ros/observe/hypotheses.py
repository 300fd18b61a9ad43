"""What may change in a machine, derived from its model: each hypothesis has one to three numbers, and makes a machine.

Input, sensors, delay, the levels of the model's effects, load, payload, base parameters and play; then the effects of
the catalogue that have one level, so that a new one comes in by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.effects import EFFECTS
from signlin_ros.effects.base import Effect, SensorEffect
from signlin_ros.errors import SignlinError
from signlin_ros.model import Model

Array = NDArray[np.float64]

LEVEL_SHARES = (0.3, 0.6)
"""Of the inertia behind a play that has opened."""
CONTACT_FREQUENCY, CONTACT_DAMPING = 150.0, 0.1
"""Natural frequency of that play in contact in rad/s, and its damping as a share of sqrt(k J)."""
INPUT_GAINS, LEVEL_FACTORS, PAYLOADS = (0.5, 1.6), (0.3, 3.0), (0.4, 2.5)
"""Factors between which the input, a level or base parameter, and what hangs on the machine may have changed."""
LATEST, GAPS = 0.05, (0.002, 0.06)
"""A delay in s that has come, and half widths of a play, rad or a share of the travel."""
INERTIAS = ("J", "m")
"""What the inertia of a plant is called."""


@dataclass(frozen=True)
class ObservedWindow:
    """What was seen for a while: times t (T,) in s, shown values (T,) by name, inputs u (T, m)."""

    t: Array
    measured: Mapping[str, Array]
    u: Array


@dataclass(frozen=True)
class Changed:
    """What a hypothesis makes of its numbers: another model, a gain of its input, offsets of its channels."""

    model: Model
    gain: float = 1.0
    offsets: Mapping[str, float] | None = None


@dataclass(frozen=True)
class Hypothesis:
    """Numbers between ``low`` and ``high`` (n,) that make another machine.

    ``unit`` of the first number, empty where it is a factor; ``further``: what the others are, with a place for each;
    ``channel``: of a sensor that has shifted, whose size the moment of the change tells.
    """

    name: str
    low: tuple[float, ...]
    high: tuple[float, ...]
    made: Callable[..., Changed]
    unit: str = ""
    further: str = ""
    channel: str = ""


def of_the_model(model: Model, since: ObservedWindow) -> Iterator[Hypothesis]:
    """Yield hypotheses of change of a modelled machine, the commonest first."""
    yield Hypothesis("input_gain", *_range(INPUT_GAINS), lambda g: Changed(model, g))
    yield from _offsets(model, since)
    yield _delay(model)
    for key, use in model.effects.items():
        yield from _levels(model, key, use.type)
    yield _load(model, since)
    yield from _payloads(model, since)
    for name, par in model.plant.pars().items():
        if name in model.parameters and model.parameters[name] != 0.0 and not par.structural:
            yield _scaled(model, name)
    yield from _plays(model, since)


def of_the_catalogue(model: Model, since: ObservedWindow) -> Iterator[Hypothesis]:
    """Yield every effect of the catalogue that has one level and nothing else, up to the size of the usual force."""
    used = {use.type for use in model.effects.values()}
    per_force = _per_force(model, since)
    for name, effect in EFFECTS.items():
        pars = effect.pars()
        if name in used or len(pars) != 1 or not effect.proposed or not _is_force(effect):
            continue
        parameter, par = next(iter(pars.items()))
        high = usual_force(model, since.u) * per_force.get(par.unit, 0.0)
        if par.words or par.elements is not None or not high > 0.0:
            continue

        def made(x: float, name: str = name, parameter: str = parameter) -> Changed:
            return Changed(model.with_effect(name, key=f"{name}_since", **{parameter: x}))

        if _is_possible(made, high):
            yield Hypothesis(name, (max(-high, par.low),), (min(high, par.high),), made, model.unit_of(par.unit))


def usual_force(model: Model, u: Array) -> float:
    """Return about how large the force of the input is, at rest, in the plant's unit of force."""
    size = float(np.sqrt(np.mean(u[:, 0] ** 2)))
    if "K_t" in model.parameters:
        return size * model.parameters["K_t"] / model.parameters["R_a"]
    return size


# --------------------------------------------------------------------------- one by one


def _range(bounds: tuple[float, float]) -> tuple[tuple[float], tuple[float]]:
    return (bounds[0],), (bounds[1],)


def _is_force(effect: type[Effect]) -> bool:
    return not issubclass(effect, SensorEffect) and effect.force is not Effect.force


def _is_possible(made: Callable[..., Changed], *values: float) -> bool:
    """Tell whether the plant allows an effect."""
    try:
        made(*values)
    except SignlinError:
        return False
    return True


def _offsets(model: Model, since: ObservedWindow) -> Iterator[Hypothesis]:
    """A sensor has shifted, by up to what it shows."""
    for name, values in since.measured.items():
        size = float(np.nanmax(values) - np.nanmin(values)) if np.isfinite(values).any() else 0.0

        def made(b: float, name: str = name) -> Changed:
            return Changed(model, offsets={name: b})

        if size > 0.0:
            yield Hypothesis("sensor_offset", (-size,), (size,), made, model.units.get(name, ""), channel=name)


def _delay(model: Model) -> Hypothesis:
    """The input acts later, or earlier, than the model says; the number is the whole delay."""
    key = next((key for key, use in model.effects.items() if use.type == "input_delay"), "")

    def made(T: float) -> Changed:
        late = max(T, 0.0)
        return Changed(model.with_parameters({f"{key}.T": late}) if key else model.with_effect("input_delay", T=late))

    return Hypothesis("input_delay", (0.0,), (model.delay + LATEST,), made, "s")


def _scaled(model: Model, name: str) -> Hypothesis:
    value = model.value(name)
    return Hypothesis(name, *_range(LEVEL_FACTORS), lambda s: Changed(model.with_parameters({name: s * value})))


def _levels(model: Model, key: str, kind: str) -> Iterator[Hypothesis]:
    """All levels of an effect of the model by one factor: those of its parameters that are in a unit of force."""
    if not _is_force(EFFECTS[kind]):
        return
    units = {name: par.unit for name, par in EFFECTS[kind].pars().items() if par.elements is None and not par.words}
    levels = {f"{key}.{n}": model.value(f"{key}.{n}") for n, unit in units.items() if unit.startswith("F")}
    if any(levels.values()):
        scaled = lambda s: Changed(model.with_parameters({n: s * v for n, v in levels.items()}))  # noqa: E731
        yield Hypothesis(key, *_range(LEVEL_FACTORS), scaled)


def _load(model: Model, since: ObservedWindow) -> Hypothesis:
    size = usual_force(model, since.u)
    key = "constant_load" if "constant_load" not in model.effects else "constant_load_since"
    added = lambda F: Changed(model.with_effect("constant_load", key=key, F0=F))  # noqa: E731
    return Hypothesis("constant_load", (-size,), (size,), added, model.plant.force_unit)


def _payloads(model: Model, since: ObservedWindow) -> Iterator[Hypothesis]:
    """Something was put on: the inertia grows, and its weight, or a weight that the model does not have yet."""
    inertia = next((name for name in INERTIAS if name in model.parameters), None)
    if inertia is None:
        return
    whole, unit = model.parameters[inertia], "times the inertia"
    weights = {f"{k}.A": model.value(f"{k}.A") for k, use in model.effects.items() if use.type == "gravity_load"}

    def grown(j: float, a: float) -> Changed:
        return Changed(model.with_parameters({inertia: j * whole, **{n: a * v for n, v in weights.items()}}))

    def hung(j: float, sine: float, cosine: float) -> Changed:
        size, hangs = float(np.hypot(sine, cosine)), float(np.arctan2(-cosine, sine))
        return Changed(model.with_parameters({inertia: j * whole}).with_effect("gravity_load", A=size, q0=hangs))

    if weights:
        low, high = ((bound, bound) for bound in PAYLOADS)
        yield Hypothesis("payload", low, high, grown, unit, ", the weight {1:.3g} times")
    elif model.plant.position in model.states and _is_possible(hung, 1.0, 0.0, 0.0):
        size, force = usual_force(model, since.u), model.plant.force_unit
        sizes = (PAYLOADS[0], -size, -size), (PAYLOADS[1], size, size)
        further = f", a weight of {{1:.3g}} {force} in the sine and {{2:.3g}} {force} in the cosine of the position"
        yield Hypothesis("payload", *sizes, hung, unit, further)


def _plays(model: Model, since: ObservedWindow) -> Iterator[Hypothesis]:
    """Part of the inertia comes loose, within a play that opens."""
    inertia = next((name for name in INERTIAS if name in model.parameters), None)
    if inertia is None or model.plant.position not in model.states or "backlash" in model.effects:
        return
    whole = model.parameters[inertia]
    for share in LEVEL_SHARES:
        loose, k = share * whole, share * whole * CONTACT_FREQUENCY**2

        def made(gap: float, loose: float = loose, k: float = k) -> Changed:
            rest = model.with_parameters({inertia: whole - loose})
            return Changed(rest.with_effect("backlash", gap=gap, k=k, c=CONTACT_DAMPING * (k * loose) ** 0.5, J=loose))

        reach = 1.0 if model.unit_of("Q") == "rad" else _travel(model, since)
        yield Hypothesis("backlash", (GAPS[0] * reach,), (GAPS[1] * reach,), made, model.unit_of("Q"))


def _travel(model: Model, since: ObservedWindow) -> float:
    """Return half of the way that the machine has gone to and fro."""
    q = since.measured.get(model.plant.position)
    return 1.0 if q is None else max(float(np.nanmax(q) - np.nanmin(q)) / 2, 1e-9)


def _per_force(model: Model, since: ObservedWindow) -> dict[str, float]:
    """Return, by the unit of a level, what one unit of force makes of it at the largest velocity and excursion."""
    found = {"F": 1.0}
    q = since.measured.get(model.plant.position)
    v = since.measured.get(model.plant.velocity)
    if v is None and q is not None:
        v = np.gradient(q, since.t)
    if q is not None:
        travel = _travel(model, since)
        found |= {"F/Q": 1 / travel, "F/Q³": 1 / travel**3}
    if v is not None:
        speed = max(float(np.nanpercentile(np.abs(v), 95)), 1e-9)
        found |= {"F·s/Q": 1 / speed, "F·s²/Q²": 1 / speed**2, "F·s³/Q³": 1 / speed**3}
    return found


__all__ = ["Changed", "Hypothesis", "ObservedWindow", "of_the_catalogue", "of_the_model", "usual_force"]
