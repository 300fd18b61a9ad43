"""All parameters of a model by one name each: those of the plant by their own, those of effects by ``key.name``."""

from __future__ import annotations

from signlin_ros.model.model import Model
from signlin_ros.par import Par


def numbers(model: Model) -> dict[str, float]:
    """Return all parameters of a model by name, in SI units."""
    own = {f"{key}.{n}": x for key, use in model.effects.items() for n, x in use.parameters.items()}
    return {**model.parameters, **own}


def declared(model: Model) -> dict[str, Par]:
    """Return the declarations of all parameters of a model by the same names, their units resolved."""
    return {name.partition(".")[2]: par for name, par in model.par_declarations().items()}


__all__ = ["declared", "numbers"]
