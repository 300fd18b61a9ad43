"""The catalogue of effects and plants as plain data: what `signlin effects` and `signlin plants` show.

Everything is read off the declarations in `signlin_ros.effects` and `signlin_ros.plants`.
"""

from __future__ import annotations

import inspect
import re
from typing import Any

from signlin_ros.effects import EFFECTS, Effect, SensorEffect, find_effect, load_entry_points
from signlin_ros.errors import ModelError
from signlin_ros.model import Model
from signlin_ros.par import HasPars, Par
from signlin_ros.plants import PLANTS, Plant, find_plant
from signlin_ros.recording.trace import resolve_unit

_SOURCE = re.compile(r"(?:\n|\s{3})\s*\[([^\[\]]+)\]")
"""A citation in a docstring: in brackets, on a line of its own or after three blanks."""


def source(cls: type[HasPars]) -> str | None:
    """Return the citation in the docstring of an effect or a plant, None where it has none."""
    found = _SOURCE.search(inspect.cleandoc(cls.__doc__ or ""))
    return " ".join(found[1].split()) if found else None


def nominal_model(plant: type[Plant], effect: type[Effect] | None = None) -> Model:
    """Return a plant, with one effect, at nominal values; raise `ModelError` if the effect does not apply."""
    parameters = {name: par.nominal for name, par in plant.pars().items()}
    model = Model.from_dict({"plant": plant.name, "parameters": parameters})
    return model if effect is None else model.with_effect(effect.name)


def applies(effect: type[Effect], plant: type[Plant]) -> bool:
    """Tell whether an effect can be added to a plant."""
    try:
        return bool(nominal_model(plant, effect).states)
    except ModelError:
        return False


def _parameter(par: Par, units: dict[str, str]) -> dict[str, Any]:
    default = None if par.default is None else par.written(par.default)
    return {
        "units": units,
        "low": par.low,
        "high": par.high,
        "low_excluded": par.positive,
        "nominal": par.written(par.nominal) if par.elements is None else list(par.elements),
        "default": [] if par.elements == () else default,
        "list": par.elements is not None,
        "along": par.along or None,
        "choices": [par.written(place) for place in range(len(par.words))] or None,
        "doc": par.doc,
    }


def effect_entry(effect: type[Effect]) -> dict[str, Any]:
    """Return the description of an effect; units by plant."""
    plants = [plant for plant in PLANTS.values() if applies(effect, plant)]

    def units(unit: str) -> dict[str, str]:
        return {plant.name: resolve_unit(unit, plant) for plant in plants}

    return {
        "name": effect.name,
        "summary": effect.summary(),
        "equation": effect.equation,
        "source": source(effect),
        "plants": [plant.name for plant in plants],
        "dissipative": effect.dissipative,
        "per_channel": issubclass(effect, SensorEffect),
        "states": {f"{effect.name}.{name}": units(unit) for name, unit in effect.states.items()},
        "parameters": {name: _parameter(par, units(par.unit)) for name, par in effect.pars().items()},
    }


def plant_entry(plant: type[Plant]) -> dict[str, Any]:
    """Return the description of a plant."""
    model = nominal_model(plant)
    optional = [plant.position] if plant.position_optional else []
    units = {**model.units, **plant.optional_inputs, **dict.fromkeys(optional, plant.position_unit)}
    outputs = plant.outputs or {name: units[name] for name in model.states}
    return {
        "name": plant.name,
        "summary": plant.summary(),
        "equation": plant.equation,
        "source": source(plant),
        "states": {name: units[name] for name in model.states},
        "optional_states": {name: units[name] for name in optional},
        "inputs": dict(plant.inputs),
        "optional_inputs": dict(plant.optional_inputs),
        "outputs": dict(outputs),
        "aliases": {alias: name or None for alias, name in plant.aliases().items()},
        "linearization": plant.linearization,
        "effects": [effect.name for effect in EFFECTS.values() if applies(effect, plant)],
        "parameters": {name: _parameter(par, {plant.name: par.unit}) for name, par in plant.pars().items()},
    }


def effects(name: str | None = None, model: str | None = None) -> dict[str, dict[str, Any]]:
    """Return the entries of all effects, or of one, by name; raise `ModelError` for an unknown name.

    ``model``: a model file whose effect files are among them.
    """
    load_entry_points()
    if model is not None:
        Model.load(model)
    chosen = [find_effect(name, "effects")] if name else list(EFFECTS.values())
    return {effect.name: effect_entry(effect) for effect in chosen}


def plants(name: str | None = None) -> dict[str, dict[str, Any]]:
    """Return the entries of all plants, or of one, by name; raise `ModelError` for an unknown name."""
    chosen = [find_plant(name, "plants")] if name else list(PLANTS.values())
    return {plant.name: plant_entry(plant) for plant in chosen}
