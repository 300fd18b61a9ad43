"""The effects in a model: read, checked and written, each with the values of its parameters."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from signlin_ros.effects import Effect, SensorEffect, find_effect
from signlin_ros.errors import ModelError, choices, suggest
from signlin_ros.par import Par, Pars, as_law_sees, check_values, gathered, nominal_values
from signlin_ros.plants import Plant
from signlin_ros.recording.trace import EffectSlot, resolve_unit


@dataclass(frozen=True)
class EffectUse:
    """An effect in a model: its type and the values of its parameters, of lists those of their elements (``A[0]``)."""

    type: str
    parameters: dict[str, float]

    def written(self) -> dict[str, Any]:
        """Return the type and the parameters as a model file has them: lists as lists, words as words."""
        pars = find_effect(self.type, "effects").pars()
        found: dict[str, Any] = {"type": self.type}
        for name, value in gathered(self.parameters).items():
            found[name] = pars[name].written(value) if name in pars and pars[name].words else value
        return found


def nominal(pars: Pars, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return nominal values as a model file has them; a list that goes along with a given one is left to its default,
    or as long as that.
    """
    values = {n: v if isinstance(v, list) else pars[n].written(v) for n, v in gathered(nominal_values(pars)).items()}
    for name, par in pars.items():
        if not isinstance(given.get(par.along), (list, tuple)):
            continue
        del values[name]
        if par.default is None:
            values[name] = [par.element(i).nominal for i in range(len(given[par.along]))]
    return values


def effect_class(use: EffectUse) -> type[Effect]:
    """Return the class of an effect."""
    return find_effect(use.type, "effects")


def is_sensor(use: EffectUse) -> bool:
    """Tell whether it is an effect of a sensor."""
    return issubclass(effect_class(use), SensorEffect)


def has_spring(plant: type[Plant], base: Mapping[str, float]) -> bool:
    """Tell whether a plant with these numbers has a spring of its own."""
    return "k" in base and not ("k" in plant.zero_matters and base["k"] == 0.0)


def own_name(plant: type[Plant], name: str, known: Collection[str]) -> str:
    """Return the plant's own name for position, velocity or effort, unless it is a known name itself."""
    return name if name in known else plant.aliases().get(name, name)


def slot(key: str, use: EffectUse) -> EffectSlot:
    """Return the structure of an effect's use: its type and whatever changes the equations."""
    effect = effect_class(use)
    pars = effect.pars()
    structural = tuple((n, v) for n, v in use.parameters.items() if pars[n].structural)
    return EffectSlot(key, effect, structural, tuple(use.parameters))


def effects_of(value: Any, plant: type[Plant], base: Mapping[str, float]) -> dict[str, EffectUse]:
    """Return the effects that a model file names, by their keys; raise `ModelError` on any fault."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise ModelError(f"effects: found {value!r}; allowed: a mapping such as {{coulomb_friction: {{mu: 0.033}}}}")
    return {str(key): _effect(str(key), item, plant, base) for key, item in value.items()}


def _effect(key: str, item: Any, plant: type[Plant], base: Mapping[str, float]) -> EffectUse:
    where = f"effects.{key}"
    if "." in str(key):
        raise ModelError(f"{where}: a key must not have a dot: ROS parts names there")
    if item is not None and not isinstance(item, Mapping):
        raise ModelError(f"{where}: found {item!r}; allowed: a mapping of its parameters")
    given = dict(item or {})
    name = given.pop("type", key)
    effect: type[Effect] = find_effect(str(name), where)
    if effect.plants and plant.name not in effect.plants:
        raise ModelError(f"{where}: {name} does not apply to {plant.name}, only to {', '.join(effect.plants)}")
    if name in plant.built_in:
        raise ModelError(f"{where}: {name} is part of the plant {plant.name} already")
    pars = effect.pars_on(plant.channels(base))
    if issubclass(effect, SensorEffect):
        return EffectUse(str(name), _by_channel(pars, given, plant, where))
    pars = pars.with_units(lambda unit: resolve_unit(unit, plant))
    values, spring = check_values(pars, given, where), has_spring(plant, base)
    for free in (n for n, par in pars.items() if par.free_standing):
        if spring and free in values:
            raise ModelError(f"{where}.{free}: the plant {plant.name} has a spring of its own; leave it out")
        if not spring and free not in values:
            raise ModelError(f"{where}.{free}: missing; the plant has no spring of its own ({pars[free].doc})")
    fault = effect.fault(as_law_sees(pars, values))
    if fault:
        raise ModelError(f"{where}.{fault}")
    return EffectUse(str(name), values)


def _by_channel(pars: Mapping[str, Par], given: Mapping[str, Any], plant: type[Plant], where: str) -> dict[str, float]:
    """Return the checked values of a sensor's effect by channel, under the plant's own names."""
    values: dict[str, float] = {}
    for name, value in given.items():
        channel = own_name(plant, str(name), pars)
        if channel not in pars:
            near = suggest(str(name), (*pars, *(alias for alias, own in plant.aliases().items() if own in pars)))
            raise ModelError(f"{where}.{name}: unknown channel; known: {choices(pars)}{near}")
        if channel in values:
            raise ModelError(f"{where}: {channel} is given twice, once as {name}")
        values[channel] = pars[channel].check(value, f"{where}.{name}")
    if not values:
        raise ModelError(f"{where}: names no channel; allowed: {{{next(iter(pars))}: value, ...}} with {choices(pars)}")
    return values


__all__ = ["EffectUse", "effect_class", "effects_of", "has_spring", "is_sensor", "nominal", "own_name", "slot"]
